"""The solver on form factors typed in: closed rooms, open scenes, the power, and what must be refused."""

import time

import numpy as np
import pytest

from lib.radiosity import shooting
from lib.radiosity.shooting import DoesNotConverge, FormFactors, solve
from tests.tolerances import EXACT


def closed(n=6):
    """Rows of a closed room whose n equal elements see all others alike: F_ij = 1 / (n - 1)."""
    return np.array([[j for j in range(n) if j != i] for i in range(n)], dtype=np.int32)


def random_rows(seed, n=12, R=64, escaping=0.2):
    """Rows of a random reciprocal scene: areas, and entries whose counts are R F_ij, rounded; the rest escapes."""
    rng = np.random.default_rng(seed)
    area = rng.uniform(0.5, 2, n)
    exchange = rng.random((n, n)) * (1 - np.eye(n))
    exchange = exchange + exchange.T
    F = exchange / area[:, None]
    F *= (1 - escaping) / F.sum(axis=1).max()
    entries = np.full((n, R), -1, dtype=np.int32)
    for i, counts in enumerate(np.floor(F * R).astype(int)):
        entries[i, : counts.sum()] = np.repeat(np.arange(n), counts)
    return entries, area


def dense(entries):
    n = len(entries)
    return np.stack([(entries == j).mean(axis=1) for j in range(n)], axis=1)


def direct(n, seed=None):
    """Direct irradiance (n, 1, 3): 1 everywhere, or random."""
    return np.ones((n, 1, 3)) if seed is None else np.random.default_rng(seed).uniform(0, 2, (n, 1, 3))


def exact(H_direct, rho, F):
    """(I - F diag rho) H = H_direct, channel by channel."""
    n = len(F)
    return np.stack([np.linalg.solve(np.eye(n) - F * rho[None, :, c], H_direct[:, 0, c]) for c in range(3)], axis=-1)[
        :, None
    ]


def test_products_are_those_of_the_dense_matrix():
    entries, _ = random_rows(3)
    F, whole = FormFactors(entries), dense(entries)
    B = np.random.default_rng(4).random((12, 6))
    assert F.gather(B) == pytest.approx(whole @ B, rel=EXACT)
    assert F.scatter(B) == pytest.approx(whole.T @ B, rel=EXACT)
    assert F.gather(B[:, ::2]) == pytest.approx(whole @ B[:, ::2], rel=EXACT)  # not in C order


@pytest.mark.parametrize("rho, tolerance", [(0.5, 1e-3), (0.9, 2e-3), (0.99, 5e-3), (0.999, 0.02)])
def test_closed_room(rho, tolerance):
    """H = H_direct / (1 - rho) everywhere; what convergence at 0.001 leaves."""
    found = solve(direct(6), np.full((6, 3), rho), np.ones(6), FormFactors(closed()))
    assert found.H == pytest.approx(np.full((6, 1, 3), 1 / (1 - rho)), rel=tolerance)


@pytest.mark.parametrize("rho", [0.5, 0.9, 0.99])
def test_closed_room_with_one_lamp_keeps_the_mean(rho):
    """Any emission in a closed room of one rho: mean H = mean H_direct / (1 - rho)."""
    H_direct = np.zeros((6, 1, 3))
    H_direct[2] = [6, 3, 1]
    found = solve(H_direct, np.full((6, 3), rho), np.ones(6), FormFactors(closed()), residual=1e-5)
    assert found.H.mean(axis=0)[0] == pytest.approx(np.array([1, 0.5, 1 / 6]) / (1 - rho), rel=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_against_a_dense_solver(seed):
    entries, area = random_rows(seed)
    rho = np.random.default_rng(seed).uniform(0, 0.95, (12, 3))
    found = solve(direct(12, seed), rho, area, FormFactors(entries), residual=1e-8)
    assert found.H == pytest.approx(exact(direct(12, seed), rho, dense(entries)), rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_the_usual_convergence_is_within_a_thousandth(seed):
    entries, area = random_rows(seed, escaping=0.02)
    rho = np.full((12, 3), 0.8)
    truth = exact(direct(12, seed), rho, dense(entries))
    found = solve(direct(12, seed), rho, area, FormFactors(entries), residual=1e-3)
    assert np.abs(found.H - truth).sum() < 2e-3 * truth.sum()


def sampled_rows(groups, R=64, seed=1):
    """Rows by chance, as rays make them: every element meets those of its own room alone; rooms of so many elements."""
    rng = np.random.default_rng(seed)
    first = np.cumsum([0, *groups])
    rows = [rng.integers(a, b, (b - a, R)) for a, b in zip(first[:-1], first[1:], strict=True)]
    return np.concatenate(rows).astype(np.int32)


@pytest.mark.parametrize("rho", [0.5, 0.9, 0.99, 0.999])
def test_noise_of_shooting_does_not_pass_for_convergence(rho):
    """Shooting through sampled rows is off by some per cent, evenly; changes between sweeps are small at once."""
    found = solve(direct(200), np.full((200, 3), rho), np.ones(200), FormFactors(sampled_rows([200])))
    assert found.H * (1 - rho) == pytest.approx(np.ones((200, 1, 3)), rel=1e-3)
    assert found.sweeps < 40


@pytest.mark.parametrize("rho", [0.8, 0.95, 0.99])
def test_a_white_room_beside_a_large_dark_one(rho):
    """The mean reflectance says nothing of the white room's; the changes do, after some sweeps."""
    entries = sampled_rows([50, 500])
    reflectance = np.repeat([[rho] * 3, [0.1] * 3], [50, 500], axis=0)
    truth = exact(direct(550, 2), reflectance, dense(entries))
    found = solve(direct(550, 2), reflectance, np.ones(550), FormFactors(entries))
    assert np.abs(found.H - truth).sum() < 3e-3 * truth.sum()


@pytest.mark.parametrize("ratio", [1e3, 1e6, 1e9])
def test_a_dim_room_beside_a_bright_one(ratio):
    """Errors are relative in each room: none of the bright light goes to the dim one, whose own is not dropped."""
    entries = sampled_rows([100, 100])
    rho = np.full((200, 3), 0.8)
    H_direct = direct(200, 3) * np.repeat([ratio, 1], 100)[:, None, None]
    truth = exact(H_direct, rho, dense(entries))
    error = np.abs(solve(H_direct, rho, np.ones(200), FormFactors(entries)).H / truth - 1)
    assert error[:100].mean() < 2e-3 and error[100:].mean() < 2e-3


@pytest.mark.parametrize("seed", range(4))
def test_the_account_of_the_power_adds_up(seed):
    """Received = absorbed + escaped + unshot to rounding, channel by channel, negative unshot light included."""
    entries, area = random_rows(seed)
    rho = np.random.default_rng(seed).uniform(0, 0.9, (12, 3))
    ledger = solve(direct(12, seed), rho, area, FormFactors(entries)).ledger
    spent = ledger["absorbed"] + ledger["escaped"] + ledger["unshot"]
    assert ledger["received"] == pytest.approx(spent, rel=1e-10)
    assert ledger["received"][0] == pytest.approx((direct(12, seed)[:, 0] * area[:, None]).sum(axis=0), rel=EXACT)
    assert (ledger["absorbed"] > 0).all() and (ledger["escaped"] > 0).all()


def test_the_residue_is_what_gathering_finds_beyond_shooting():
    """Exact reciprocal rows: both find the same, to the convergence asked."""
    found = solve(direct(6), np.full((6, 3), 0.5), np.ones(6), FormFactors(closed()), residual=1e-6)
    assert np.abs(found.ledger["residue"]).max() < 1e-5 * found.ledger["received"].max()


@pytest.mark.parametrize("overshoot", [0.0, 0.5, 1.0])
def test_overshooting_does_not_move_the_answer(overshoot, monkeypatch):
    """Unshot light becomes negative and is shot like any other."""
    monkeypatch.setattr(shooting, "OVERSHOOT", overshoot)
    entries, area = random_rows(3)
    rho, F = np.full((12, 3), 0.8), FormFactors(entries)
    H, dB, history, *_ = shooting._shoot(direct(12, 3)[:, 0], rho, area, F, 1e-6)
    assert history[-1, 1] <= 1e-6
    # reciprocal rows, rounded to 1/64: what is shot is what would be gathered
    reciprocal = area[:, None] * dense(entries)
    transposed = reciprocal.T / area[:, None]
    assert H[:, None] == pytest.approx(exact(direct(12, 3), rho, transposed), rel=1e-4)


def test_overshooting_needs_fewer_shots(monkeypatch):
    shots = []
    for overshoot in (0.0, 0.5):
        monkeypatch.setattr(shooting, "OVERSHOOT", overshoot)
        H_direct = np.zeros((6, 1, 3))
        H_direct[0] = 1
        shots.append(solve(H_direct, np.full((6, 3), 0.9), np.ones(6), FormFactors(closed())).shots)
    assert shots[1] < shots[0]


def test_history_starts_full_and_ends_below_the_residual():
    history = solve(direct(6), np.full((6, 3), 0.9), np.ones(6), FormFactors(closed()), residual=1e-3).history
    assert history[0].tolist() == [0, 1] and history[-1, 1] <= 1e-3
    assert (np.diff(history[:, 0]) > 0).all()


@pytest.mark.parametrize("bounces", [1, 2, 3, 4, 7])
def test_a_fixed_number_of_reflections(bounces):
    """The final gather is one of them: H here is the sum of bounces - 1 terms of Neumann's series."""
    entries, area = random_rows(5)
    rho, F = np.random.default_rng(5).uniform(0, 1, (12, 3)), dense(entries)
    term = H = direct(12, 5)[:, 0]
    for _ in range(bounces - 2):
        term = F @ (rho * term)
        H = H + term
    found = solve(direct(12, 5), rho, area, FormFactors(entries), bounces=bounces)
    assert found.H[:, 0] == pytest.approx(H, rel=1e-12)
    assert found.shots == 0 and found.sweeps == max(0, bounces - 2)
    ledger = found.ledger
    assert ledger["received"] == pytest.approx(
        ledger["absorbed"] + ledger["escaped"] + ledger["unshot"] + ledger["residue"], rel=EXACT
    )


def test_many_reflections_are_all_of_them():
    entries, area = random_rows(6)
    rho = np.full((12, 3), 0.5)
    few = solve(direct(12, 6), rho, area, FormFactors(entries), bounces=60)
    all_ = solve(direct(12, 6), rho, area, FormFactors(entries), residual=1e-9)
    assert few.H == pytest.approx(all_.H, rel=1e-7)


def test_white_closed_rooms_are_refused_at_once():
    started = time.monotonic()
    with pytest.raises(DoesNotConverge):
        solve(direct(6), np.ones((6, 3)), np.ones(6), FormFactors(closed()))
    assert time.monotonic() - started < 5


def test_a_white_channel_is_enough_to_refuse():
    rho = np.full((6, 3), 0.5)
    rho[:, 1] = 1
    with pytest.raises(DoesNotConverge):
        solve(direct(6), rho, np.ones(6), FormFactors(closed()))


def test_white_open_rooms_are_not():
    """Half of all rays leave: H = H_direct / (1 - 1/2)."""
    entries = np.concatenate([closed(), np.full((6, 5), -1, dtype=np.int32)], axis=1)
    found = solve(direct(6), np.ones((6, 3)), np.ones(6), FormFactors(entries), residual=1e-6)
    assert found.H == pytest.approx(np.full((6, 1, 3), 2.0), rel=1e-4)


def test_black_rooms_take_one_pass():
    found = solve(direct(6), np.zeros((6, 3)), np.ones(6), FormFactors(closed()))
    assert (found.H == 1).all() and found.shots == 0


def test_no_light():
    for bounces in (None, 1, 5):
        found = solve(np.zeros((6, 1, 3)), np.full((6, 3), 0.5), np.ones(6), FormFactors(closed()), bounces=bounces)
        assert not found.H.any() and not any(power.any() for power in found.ledger.values())


def test_no_elements():
    found = solve(np.zeros((0, 1, 3)), np.zeros((0, 3)), np.zeros(0), FormFactors(np.zeros((0, 4), dtype=np.int32)))
    assert found.H.shape == (0, 1, 3) and found.shots == 0


def test_light_scales():
    entries, area = random_rows(7)
    rho = np.full((12, 3), 0.7)
    one, many = (solve(k * direct(12, 7), rho, area, FormFactors(entries)).H for k in (1.0, 1e9))
    assert many == pytest.approx(1e9 * one, rel=1e-9)


def test_groups_add_up():
    entries, area = random_rows(8)
    rho = np.random.default_rng(8).uniform(0, 0.9, (12, 3))
    both = np.random.default_rng(9).uniform(0, 1, (12, 2, 3))
    apart = solve(both, rho, area, FormFactors(entries), residual=1e-7)
    together = solve(both.sum(axis=1, keepdims=True), rho, area, FormFactors(entries), residual=1e-7)
    assert apart.H.sum(axis=1) == pytest.approx(together.H[:, 0], rel=1e-5)
    assert apart.ambient.shape == (2, 3)


def test_hidden_elements_neither_shoot_nor_receive():
    """Element 5 is buried: no area, no rays; others that met it by mistake lose that light, and nothing is NaN."""
    entries = closed()
    entries[5] = -3
    area = np.array([1.0, 1, 1, 1, 1, 0])
    found = solve(direct(6), np.full((6, 3), 0.5), area, FormFactors(entries))
    assert np.isfinite(found.H).all() and np.isfinite(found.history).all()
    ledger = found.ledger
    assert ledger["received"] == pytest.approx(ledger["absorbed"] + ledger["escaped"] + ledger["unshot"], rel=EXACT)


def test_shares_of_a_row():
    F = FormFactors(np.array([[0, 1, 1, -1], [-2, -2, 0, -3], [-3, -3, -3, -3]], dtype=np.int32))
    assert F.escaped.tolist() == [0.25, 0, 0] and F.absorbed.tolist() == [0, pytest.approx(2 / 3), 0]
    B = np.array([[1.0], [10], [100]])
    assert F.gather(B)[:, 0] == pytest.approx([0.25 + 5, 1 / 3, 0], rel=EXACT)
    assert F.scatter(B)[:, 0] == pytest.approx([0.25 + 10 / 3, 0.5, 0], rel=EXACT)


def test_elements_of_different_size_keep_the_power():
    """A small element's light on a large one: x F_ij area_i / area_j."""
    entries = np.array([[1], [0]], dtype=np.int32)  # each sees the other alone
    H_direct = np.array([8.0, 0])[:, None, None] * np.ones(3)
    H, *_ = shooting._shoot(H_direct[:, 0], np.full((2, 3), 1e-9), np.array([1.0, 4]), FormFactors(entries), 1e-3)
    assert H[1, 0] == pytest.approx(1e-9 * 8 / 4, rel=1e-6)


def test_light_known_finer_than_by_elements_counts_once_where_it_is_met():
    """Two plates that see each other; one half of each is lit, and all rays meet the lit halves."""
    entries, met = np.array([[1, 1, 1, 1], [0, 0, 0, 0]], dtype=np.int32), np.zeros((2, 4), dtype=np.uint8)
    F, rho = FormFactors(entries), np.full((2, 3), 0.5)
    points = np.zeros((2, 16, 3))
    points[:, :8] = 2.0
    first = F.gather_points(points * 0.5, met)
    assert first == pytest.approx(np.ones((2, 3)))
    H_direct = points.mean(axis=1)[:, None]
    found = solve(H_direct, rho, np.ones(2), F, residual=1e-7, first=first[:, None]).H
    assert found == pytest.approx(np.full((2, 1, 3), 1 + 1 + 0.5 * 1 / (1 - 0.5)), rel=1e-6)
    assert solve(H_direct, rho, np.ones(2), F, bounces=3, first=first[:, None]).H == pytest.approx(
        np.full((2, 1, 3), 2)
    )


def test_no_finer_light_changes_nothing():
    entries = closed()
    F, rho, H_direct = FormFactors(entries), np.full((6, 3), 0.5), direct(6, 1)
    same = F.gather_points(np.repeat((rho * H_direct[:, 0])[:, None], 16, axis=1), np.zeros(entries.shape, np.uint8))
    assert solve(H_direct, rho, np.ones(6), F, first=same[:, None]).H == pytest.approx(
        solve(H_direct, rho, np.ones(6), F).H
    )


def test_rays_count_by_the_area_their_point_stands_for():
    """Two elements of two points, each sending two rays: by hand."""
    entries = np.array([[1, -1, -2, 1], [0, 0, -3, -3]])
    F = FormFactors(entries, np.array([[3.0, 1.0], [1.0, 0.0]]))
    assert F.escaped == pytest.approx([3 / 8, 0]) and F.absorbed == pytest.approx([1 / 8, 0])
    B = np.array([[5.0], [7.0]])
    assert F.gather(B) == pytest.approx(np.array([[7 / 2], [5]]))
    met = np.array([[0, 0, 0, 1], [0, 1, 0, 0]])
    B = np.array([[[2.0], [4.0]], [[10.0], [30.0]]])
    assert F.gather_points(B, met) == pytest.approx(np.array([[(3 * 10 + 1 * 30) / 8], [3]]))
    assert F.scatter(np.array([[1.0], [1.0]])) == pytest.approx(np.array([[1], [1 / 2]]))
