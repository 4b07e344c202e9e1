"""The texture budget: bytes, losses, the low pass, and the order of removal against a plain oracle."""

import numpy as np
import pytest

from lib.maps import budget
from lib.maps.mapset import pack, side_lengths
from lib.refusal import Refusal

ROUND = 1e-6  # float32 maps


def grey(values):
    return np.repeat(np.asarray(values, np.float32)[..., None], 3, axis=2)


def visible(value):
    return np.zeros(value.shape[:2], bool)


def random_maps(seed, hidden_share=0.0):
    rng = np.random.default_rng(seed)
    roots, level = [[1, 1], [2, 1], [1, 3], [1, 1], [1, 1]], [4, 3, 2, 4, 0]
    maps, hidden = [], []
    for k in range(5):
        w, h = side_lengths(roots[k], level[k])
        maps.append(rng.random((h, w, 3)) * 10.0 ** rng.integers(-2, 2))
        hidden.append(rng.random((h, w)) < hidden_share)
    maps[3], hidden[3] = maps[0], hidden[0]  # a tie
    return pack(np.arange(5) * 2, roots, level, maps, hidden)


@pytest.mark.parametrize(
    "w, h, expected",
    [
        (1, 1, 4),
        (2, 2, 16 + 4),
        (3, 3, 36 + 4),
        (5, 3, 60 + 8 + 4),
        (1024, 1024, 4 * (4**11 - 1) // 3),
        (1, 8, 32 + 16 + 8 + 4),
    ],
)
def test_bytes_of_a_mip_chain(w, h, expected):
    assert budget.gpu_bytes(w, h) == expected


# ---- D_i


def test_a_bilinear_map_loses_nothing():
    v, u = np.meshgrid(np.arange(9) / 8, np.arange(17) / 16, indexing="ij")
    value = grey(1 + 2 * u - 0.5 * v + 4 * u * v)  # dyadic numbers: no rounding
    assert budget.detail(value, visible(value)) == 0


def test_loss_of_a_map_drawn_by_hand():
    value = grey([[0, 1, 0], [2, 4, 0], [0, 0, 8]])
    # predictions: top 0, left 0, right 4, bottom 4, centre 2; misses 1 + 2 + 4 + 4 + 2, times three channels
    assert budget.detail(value, visible(value)) == 3 * 13


def test_hidden_samples_do_not_count_and_predict_what_is_beside_them():
    value = grey([[0, 1, 999], [2, 4, 999], [0, 0, 8]])
    hidden = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]], bool)
    # the hidden corner takes (2 x 1 + 4) / 3 = 2; predictions: top 1, left 0, bottom 4, centre 10/4
    assert np.isclose(budget.detail(value, hidden), 3 * (0 + 2 + 4 + 1.5))


def test_a_visible_sample_between_hidden_ones_goes_on_in_them():
    value, hidden = grey([[9, 9, 9], [9, 2, 9], [9, 9, 9]]), np.ones((3, 3), bool)
    hidden[1, 1] = False
    assert budget.detail(value, hidden) == 0
    kept, kept_hidden = budget.low_pass(value, hidden)
    assert (kept == 2).all() and not kept_hidden.any()


def test_a_disc_in_its_map_keeps_its_light_down_to_the_root():
    """A face trimmed to a disc: all four corners of its map are outside."""
    v, u = np.meshgrid(np.linspace(-1, 1, 17), np.linspace(-1, 1, 17), indexing="ij")
    value, hidden = np.full((17, 17, 3), 7, np.float32), u**2 + v**2 > 0.8
    for closed in ((False, False), (True, False), (False, True)):
        kept, out = value, hidden
        for _ in range(4):
            kept, out = budget.low_pass(kept, out, closed)
            assert kept[~out] == pytest.approx(7)
        assert kept.shape == (2, 2, 3) and not out.any()


# ---- low pass


def test_weights_are_one_two_one_along_both_directions():
    for j, i, expected in [(2, 2, 4 / 16), (2, 1, 2 / 16), (1, 2, 2 / 16), (3, 3, 1 / 16), (1, 1, 1 / 16)]:
        value = np.zeros((5, 5))
        value[j, i] = 1
        assert budget.low_pass(grey(value), np.zeros((5, 5), bool))[0][1, 1, 0] == np.float32(expected)


def test_a_border_row_is_filtered_along_itself_only_and_corners_stay():
    rng = np.random.default_rng(0)
    value = rng.random((9, 9, 3)).astype(np.float32)
    changed = value.copy()
    changed[1:-1] += rng.random((7, 9, 3)).astype(np.float32)
    one, two = budget.low_pass(value, visible(value))[0], budget.low_pass(changed, visible(value))[0]
    assert np.array_equal(one[[0, -1]], two[[0, -1]])
    assert np.array_equal(one[[0, 0, -1, -1], [0, -1, 0, -1]], value[[0, 0, -1, -1], [0, -1, 0, -1]])
    assert np.allclose(one[0, 1], (value[0, 1] + 2 * value[0, 2] + value[0, 3]) / 4)


def test_a_ramp_stays_the_same_ramp_up_to_the_border():
    v, u = np.meshgrid(np.arange(9), np.arange(17), indexing="ij")
    value = grey(3 + 2 * u - v)
    assert np.array_equal(budget.low_pass(value, visible(value))[0], value[::2, ::2])
    hidden = np.random.default_rng(5).random((9, 17)) < 0.3
    kept, kept_hidden = budget.low_pass(np.where(hidden[..., None], np.float32(1e9), value), hidden)
    assert not kept_hidden.any()
    assert np.array_equal(kept[~hidden[::2, ::2]], value[::2, ::2][~hidden[::2, ::2]])


def test_a_closed_direction_goes_round():
    u = np.arange(17) / 16
    value = grey(np.repeat(np.cos(2 * np.pi * u)[None], 9, axis=0))
    kept = budget.low_pass(value, visible(value), (True, False))[0]
    # the filter scales a wave of 16 samples by (1 + cos(2 pi / 16)) / 2, at the seam as anywhere
    assert np.allclose(kept[..., 0], (1 + np.cos(np.pi / 8)) / 2 * np.cos(2 * np.pi * u[::2]), atol=ROUND)
    noisy = np.random.default_rng(2).random((9, 17, 3)).astype(np.float32)
    noisy[:, -1] = noisy[:, 0]
    kept = budget.low_pass(noisy, visible(noisy), (True, False))[0]
    assert np.array_equal(kept[:, 0], kept[:, -1])
    turned = budget.low_pass(noisy.transpose(1, 0, 2), visible(noisy).T, (False, True))[0]
    assert np.allclose(turned.transpose(1, 0, 2), kept, atol=ROUND)


def test_low_pass_commutes_with_mirroring_and_transposing_with_gaps_too():
    rng = np.random.default_rng(4)
    value, hidden = rng.random((17, 9, 3)).astype(np.float32), rng.random((17, 9)) < 0.3
    kept = budget.low_pass(value, hidden)[0]
    assert np.allclose(budget.low_pass(value[::-1], hidden[::-1])[0], kept[::-1], atol=ROUND)
    turned = budget.low_pass(value.transpose(1, 0, 2), hidden.T)[0]
    assert np.allclose(turned.transpose(1, 0, 2), kept, atol=ROUND)


def test_the_coarsest_map_keeps_its_corners():
    value = np.random.default_rng(0).random((3, 3, 3)).astype(np.float32)
    assert np.array_equal(budget.low_pass(value, visible(value))[0], value[::2, ::2])


# ---- removal


def oracle(maps, closed, T, order="loss"):
    """Recompute every D_i before every step; take the smallest, the first by name on a tie."""
    value, hidden = [maps.map(k) for k in range(len(maps))], [maps.hidden_map(k) for k in range(len(maps))]
    level, sequence = maps.level.tolist(), []

    def S():
        return sum(budget.gpu_bytes(*side_lengths(r, n)) for r, n in zip(maps.roots, level, strict=True))

    while S() > T:
        D = [budget.detail(value[k], hidden[k]) if level[k] else np.inf for k in range(len(maps))]
        saved = [
            budget.map_bytes(r, n) - budget.map_bytes(r, n - 1) if n else 1
            for r, n in zip(maps.roots, level, strict=True)
        ]
        weight = {"loss": 1, "loss_per_byte": 4.0 ** (maps.level - level) / saved}[order]
        k = int(np.argmin(np.array(D) * weight))
        sequence.append((int(maps.surface[k]), level[k], D[k]))
        value[k], hidden[k] = budget.low_pass(value[k], hidden[k], closed[k])
        level[k] -= 1
    return sequence, value


@pytest.mark.parametrize("order", ["loss", "loss_per_byte"])
@pytest.mark.parametrize("seed, share", [(0, 0), (1, 0.2), (2, 0), (3, 0.6)])
def test_the_order_of_removal_is_the_oracles(seed, share, order):
    maps = random_maps(seed, share)
    closed = np.array([[0, 0], [1, 0], [0, 1], [0, 0], [1, 1]], bool)
    for T in (budget.total(maps) * 2 // 3, budget.total(maps) // 5, budget.smallest_total(maps.roots)):
        reduced, steps, D = budget.reduce(maps, closed, T, order=order)
        sequence, value = oracle(maps, closed, T, order)
        assert [(s.surface, s.level, s.D) for s in steps] == sequence and steps
        assert all(np.array_equal(reduced.map(k), value[k]) for k in range(len(maps)))
        S = [budget.total(maps)] + [s.S for s in steps]
        assert np.all(np.diff(S) < 0) and S[-1] == budget.total(reduced) <= T < S[-2]
        assert (reduced.level >= 0).all() and np.array_equal(reduced.roots, maps.roots)
        assert [D[k] for k in range(5)] == [
            budget.detail(maps.map(k), maps.hidden_map(k)) if maps.level[k] else 0 for k in range(5)
        ]


def test_equal_losses_go_by_name():
    steps = budget.reduce(random_maps(0), np.zeros((5, 2), bool), budget.smallest_total([[1, 1]] * 9))[1]
    order = [(s.surface, s.level) for s in steps]
    assert all(order.index((0, level)) < order.index((6, level)) for level in (1, 2, 3, 4))  # two equal maps


def test_per_byte_no_picture_is_sacrificed_for_its_equal():
    rng = np.random.default_rng(0)
    maps = pack([0, 1], [[1, 1]] * 2, [6, 6], [rng.random((65, 65, 3)), rng.random((65, 65, 3)) * 1.01])
    T = budget.total(maps) // 3
    assert abs(np.diff(budget.reduce(maps, np.zeros((2, 2), bool), T, order="loss_per_byte")[0].level)[0]) <= 1
    assert budget.reduce(maps, np.zeros((2, 2), bool), T, order="loss")[0].level.min() == 0


def test_bilinear_light_goes_first_and_the_result_is_still_it():
    v, u = np.meshgrid(np.arange(17) / 16, np.arange(17) / 16, indexing="ij")
    smooth, rough = grey(1 + u + v), np.random.default_rng(0).random((17, 17, 3)).astype(np.float32) * 1e-3
    maps = pack([0, 1], [[1, 1]] * 2, [4, 4], [rough, smooth])
    T = budget.map_bytes([1, 1], 4) + budget.map_bytes([1, 1], 0)
    reduced, steps, D = budget.reduce(maps, np.zeros((2, 2), bool), T)
    assert [s.surface for s in steps] == [1] * 4 and D[1] == 0 == sum(s.D for s in steps)
    assert reduced.level.tolist() == [4, 0] and reduced.map(1)[..., 0].tolist() == [[1, 2], [2, 3]]
    assert np.array_equal(reduced.map(0), rough)


def test_within_the_budget_nothing_changes():
    maps = random_maps(0)
    reduced, steps, _ = budget.reduce(maps, np.zeros((5, 2), bool), budget.total(maps))
    assert reduced is maps and steps == []
    _, steps, _ = budget.reduce(maps, np.zeros((5, 2), bool), budget.total(maps) - 1)
    assert len(steps) == 1


def test_rubbish_in_hidden_samples_changes_nothing():
    maps = random_maps(7, 0.4)
    spoilt = pack(
        maps.surface,
        maps.roots,
        maps.level,
        [np.where(maps.hidden_map(k)[..., None], 1e20, maps.map(k)) for k in range(5)],
        [maps.hidden_map(k) for k in range(5)],
    )
    T = budget.total(maps) // 4
    one, two = (budget.reduce(x, np.zeros((5, 2), bool), T) for x in (maps, spoilt))
    assert one[1] == two[1]
    assert all(
        np.array_equal(one[0].map(k)[~one[0].hidden_map(k)], two[0].map(k)[~two[0].hidden_map(k)]) for k in range(5)
    )


def test_the_smallest_total_can_be_met_and_one_byte_less_is_refused_with_both_numbers():
    maps, closed = random_maps(0), np.zeros((5, 2), bool)
    smallest = budget.smallest_total(maps.roots)
    assert smallest == 3 * 20 + budget.gpu_bytes(3, 2) + budget.gpu_bytes(2, 4)
    assert budget.reduce(maps, closed, smallest)[0].level.tolist() == [0] * 5
    with pytest.raises(Refusal, match=f"{smallest - 1} .*{smallest} "):
        budget.reduce(maps, closed, smallest - 1)
    with pytest.raises(Refusal, match=f"{smallest} .*{smallest + 1000} "):
        budget.reduce(maps, closed, smallest, fixed=1000)


@pytest.mark.parametrize("T", [0, -5, float("nan"), float("inf"), "64 MiB", True, None, [1]])
def test_a_budget_that_is_no_number_of_bytes_is_refused_with_the_smallest_total(T):
    maps = random_maps(0)
    with pytest.raises(Refusal, match=f"budget: .*{budget.smallest_total(maps.roots)} bytes"):
        budget.reduce(maps, np.zeros((5, 2), bool), T)


def test_no_maps_at_all():
    empty = pack([], [], [], [])
    assert budget.reduce(empty, np.zeros((0, 2), bool), 100)[1] == []


def test_what_is_lost_is_the_mean_error_over_the_area():
    """A spike of 4 on a map of 1, hidden in a corner, gone at the roots, beside a map of 2 that stays."""
    spike, even = np.ones((3, 3, 3)), np.full((3, 3, 3), 2.0)
    spike[1, 1], spike[0, 0] = 5, 100
    hidden = np.zeros((3, 3), bool)
    hidden[0, 0] = True
    before = pack([0, 3], [[1, 1]] * 2, [1, 1], [spike, even], [hidden, np.zeros_like(hidden)])
    corner = hidden[::2, ::2]
    after = pack([0, 3], [[1, 1]] * 2, [0, 1], [np.ones((2, 2, 3)), even], [corner, np.zeros_like(hidden)])
    assert budget.lost(before, before, [3.0, 5.0]) == 0
    assert budget.lost(before, after, [3.0, 5.0]) == pytest.approx(3 * 4 / 8 / (3 * 12 / 8 + 5 * 2))
    black = pack([0], [[1, 1]], [1], [np.zeros((3, 3, 3))])
    assert budget.lost(black, pack([0], [[1, 1]], [0], [np.zeros((2, 2, 3))]), [1.0]) == 0
