"""The recursive bilinear transform: what it reproduces, keeps and commutes with; dropping levels; adding two halves."""

import numpy as np
import pytest

from lib.elements.balance import balance, children
from lib.maps.combine import combine
from lib.maps.resample import drop_levels, resample, upsample
from tests.tolerances import EXACT

ROOTS = [(1, 1), (3, 1), (1, 2)]  # n_u, n_v


def corners(roots=(2, 1), depth=3, seed=1, share=0.4, balanced=True):
    """Crossings (h, w) at corners of the leaves of a random tree, and its divided cells."""
    rng = np.random.default_rng(seed)
    divided = [rng.random((roots[1], roots[0])) < 0.8]
    for _ in range(depth - 1):
        below = children(divided[-1])
        divided.append(below & (rng.random(below.shape) < share))
    if balanced:
        divided = balance(divided)
    known = np.zeros((roots[1] * 2**depth + 1, roots[0] * 2**depth + 1), dtype=bool)
    known[:: 2**depth, :: 2**depth] = True
    for level, cells in enumerate(divided):
        half = 2 ** (depth - level - 1)
        for j, i in zip(*np.nonzero(cells), strict=True):
            known[2 * j * half : (2 * j + 2) * half + 1 : half, 2 * i * half : (2 * i + 2) * half + 1 : half] = True
    return known, divided


def field(shape, f):
    """Values (h, w, 1, 3) of f(u, v), its double and its negative."""
    v, u = np.meshgrid(np.linspace(0, 1, shape[0]), np.linspace(0, 1, shape[1]), indexing="ij")
    return np.stack([f(u, v), 2 * f(u, v), -f(u, v)], axis=-1)[:, :, None]


def measured(full, known):
    """What a tree holds of a field: nonsense where nothing is known."""
    return np.where(known[..., None, None], full, 1e30)


def seen(known):
    return np.zeros_like(known)


def noise(shape, seed, groups=1):
    return np.random.default_rng(seed).uniform(0, 1, (*shape, groups, 3))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("roots", ROOTS)
@pytest.mark.parametrize(
    "f", [lambda u, v: 0 * u + 7, lambda u, v: 1 + 2 * u - 3 * v + 4 * u * v], ids=["even", "bilinear"]
)
def test_bilinear_fields_are_exact(f, roots, seed):
    known, _ = corners(roots, seed=seed)
    full = field(known.shape, f)
    value, hidden = resample(measured(full, known), known, seen(known))
    assert np.abs(value - full).max() < 10 * EXACT
    assert not hidden.any()


@pytest.mark.parametrize("quadratic", [lambda u, v: u * u, lambda u, v: 3 * u * u - 2 * u * v - v * v + u])
def test_centres_of_quadratics_are_exact(quadratic):
    """Edge midpoints known, centres not: Coons' weights.  A mean of the midpoints is off by second differences."""
    shape = (9, 9)
    known = np.ones(shape, dtype=bool)
    known[1::2, 1::2] = False
    full = field(shape, quadratic)
    assert np.abs(resample(measured(full, known), known, seen(known))[0] - full).max() < 10 * EXACT


def test_weights_drawn():
    """One cell, corners 0 4 / 8 12, measured midpoints below 5 and left 1: the rest by the paper's order, by hand.

    right = (4 + 12) / 2 = 8, above = (8 + 12) / 2 = 10, centre = (5 + 10 + 1 + 8) / 2 - (0 + 4 + 8 + 12) / 4 = 6
    """
    value = np.array([[0, 5, 4], [1, -1, -1], [8, -1, 12]], dtype=float)[..., None, None] * np.ones(3)
    known = np.array([[1, 1, 1], [1, 0, 0], [1, 0, 1]], dtype=bool)
    found = resample(value, known, seen(known))[0][..., 0, 0]
    assert found.tolist() == [[0, 5, 4], [1, 6, 8], [8, 10, 12]]


def test_centres_are_clamped():
    """All midpoints 1, corners 0: Coons says 2, outside of the eight; 1 it is.  And 0 the other way round."""
    value = np.zeros((3, 3, 1, 3))
    value[1, [0, 2]] = value[[0, 2], 1] = 1
    known = np.ones((3, 3), dtype=bool)
    known[1, 1] = False
    assert resample(value, known, seen(known))[0][1, 1].tolist() == [[1, 1, 1]]
    assert resample(1 - value, known, seen(known))[0][1, 1].tolist() == [[0, 0, 0]]


def test_the_sum_over_groups_is_clamped_and_groups_alike():
    value = np.zeros((3, 3, 2, 3))
    value[1, [0, 2]] = value[[0, 2], 1] = np.array([3.0, 1.0])[:, None]
    known = np.ones((3, 3), dtype=bool)
    known[1, 1] = False
    assert resample(value, known, seen(known))[0][1, 1, :, 0].tolist() == [3, 1]


@pytest.mark.parametrize("seed", range(5))
def test_known_samples_are_kept_bit_for_bit(seed):
    known, _ = corners(seed=seed)
    value = noise(known.shape, seed, groups=2).astype(np.float32)
    found, _ = resample(value, known, seen(known))
    assert found.dtype == np.float32
    assert np.array_equal(found[known], value[known])


@pytest.mark.parametrize("seed", range(3))
def test_a_full_map_is_left_as_it_is(seed):
    known, _ = corners(seed=seed)
    once = resample(noise(known.shape, seed), known, seen(known))[0]
    full = np.ones_like(known)
    assert np.array_equal(resample(once, full, seen(known))[0], once)


@pytest.mark.parametrize("roots", ROOTS)
@pytest.mark.parametrize("seed", range(4))
def test_commutes_with_transposition_and_mirrors(seed, roots):
    known, _ = corners(roots, seed=seed)
    value = noise(known.shape, seed, groups=2)
    hidden = known & (np.random.default_rng(seed).random(known.shape) < 0.15)
    for turn in (lambda a: np.swapaxes(a, 0, 1), lambda a: a[::-1], lambda a: a[:, ::-1]):
        expected = resample(value, known, hidden)
        found = resample(turn(value).copy(), turn(known).copy(), turn(hidden).copy())
        assert np.array_equal(found[1], turn(expected[1]))
        assert np.array_equal(found[0][~found[1]], turn(expected[0])[~found[1]])


def test_both_sides_of_a_t_junction_read_the_same_edge():
    """Left cell divided, right one not: their edge's middle was measured for the left one, and the right one uses it.

    +---+---+-------+
    |   |   |       |
    +---+---M   .   |      M measured; the point to its right lies between M and the far side, not between the corners
    |   |   |       |
    +---+---+-------+
    """
    known = np.zeros((3, 5), dtype=bool)
    known[:, :3] = True
    known[[0, 2], 4] = True
    value = np.zeros((3, 5, 1, 3))
    value[1, 2] = 8.0
    found = resample(value, known, seen(known))[0][..., 0, 0]
    assert found[1, 2] == 8
    assert found[1, 3] == 8 / 2  # centre: (0 + 0 + 8 + 0) / 2 - 0
    assert found[1, 4] == found[0, 3] == 0


@pytest.mark.parametrize("seed", range(4))
def test_no_value_outside_the_range_of_what_is_known(seed):
    known, _ = corners(seed=seed, balanced=bool(seed % 2))
    value = np.where(known[..., None, None], noise(known.shape, seed), -1e30)
    found = resample(value, known, seen(known))[0]
    assert found.min() >= value[known].min() and found.max() <= value[known].max()


def test_hidden_samples_pass_nothing_on():
    """The buried corner's 1e9 reaches no visible texel; what only hidden samples reach is hidden itself."""
    known = np.zeros((9, 9), dtype=bool)
    known[::4, ::4] = True
    hidden = seen(known)
    hidden[:5, :5] = known[:5, :5]
    value = np.where(hidden[..., None, None], 1e9, field(known.shape, lambda u, v: 0 * u + 1))
    found, shade = resample(value, known, hidden)
    assert np.abs(found[~shade][..., 0, 0] - 1).max() < EXACT
    assert shade[hidden].all() and not shade[known & ~hidden].any()
    assert shade[1:4, 1:4].all()


def test_hidden_end_of_an_edge():
    value = np.array([[5.0], [0], [9]])[..., None, None] * np.ones((3, 3, 1, 3))
    known = np.ones((3, 3), dtype=bool)
    known[1] = False
    for ends, expected in ((([0], []), 9), (([2], []), 5), (([], []), 7)):
        hidden = np.zeros((3, 3), dtype=bool)
        hidden[ends[0]] = True
        assert (resample(value, known, hidden)[0][1, ::2] == expected).all()


def test_level_0_is_what_it_is():
    value = noise((2, 4), 1)
    known = np.ones((2, 4), dtype=bool)
    assert np.array_equal(resample(value, known, seen(known))[0], value)


def test_the_arguments_are_left_alone():
    known, _ = corners(seed=2)
    value, hidden = noise(known.shape, 2), seen(known)
    before = value.copy(), known.copy(), hidden.copy()
    resample(value, known, hidden)
    assert all(np.array_equal(a, b) for a, b in zip(before, (value, known, hidden), strict=True))


def bilinear(u, v):
    return 1 + 2 * u - 3 * v + 4 * u * v


def test_upsampled_bilinear_fields_are_exact():
    value, hidden = upsample(field((3, 5), bilinear), np.zeros((3, 5), bool), 3)
    assert value.shape == (17, 33, 1, 3) and not hidden.any()
    assert np.abs(value - field((17, 33), bilinear)).max() < 10 * EXACT
    same = field((3, 5), bilinear)
    assert upsample(same, np.zeros((3, 5), bool), 0)[0] is same


def test_upsampling_passes_hidden_samples_over():
    shade = np.zeros((3, 3), dtype=bool)
    shade[0] = True
    value = np.where(shade[..., None, None], 1e9, np.ones((3, 3, 1, 3)))
    found, hidden = upsample(value, shade, 2)
    assert hidden[0].all() and not hidden[1:].any()
    assert (found[~hidden] == 1).all()


def test_levels_that_say_nothing_are_dropped():
    """A bilinear field falls to its roots; a detail of level 2 keeps it there; tolerance 0 keeps noise."""
    value, hidden = field((17, 33), bilinear), np.zeros((17, 33), bool)
    small, _, level = drop_levels(value, hidden, 4, 1e-9)
    assert level == 0 and small.shape == (2, 3, 1, 3)
    assert np.array_equal(small, value[::16, ::16])
    detail = value.copy()
    detail += field((17, 33), lambda u, v: np.interp(u, np.linspace(0, 1, 9), [0, 0, 0, 1, 0, 0, 0, 0, 0]))
    assert drop_levels(detail, hidden, 4, 1e-9)[2] == 2
    assert drop_levels(detail, hidden, 4, 2.0)[2] == 0
    assert drop_levels(noise((17, 33), 3), hidden, 4, 0.0)[2] == 4


def test_the_worst_visible_sample_decides():
    value, hidden = np.zeros((5, 5, 2, 3)), np.zeros((5, 5), bool)
    value[1, 1, :, 2] = 0.6  # the sum over groups is 1.2
    assert drop_levels(value, hidden, 2, 1.1)[2] == 2
    assert drop_levels(value, hidden, 2, 1.3)[2] == 0
    hidden[1, 1] = True
    assert drop_levels(value, hidden, 2, 0.1)[2] == 0


def half(f, level, roots=(2, 1), share=0.5, seed=1):
    known, _ = corners(roots, level, seed, share) if level else (np.ones((roots[1] + 1, roots[0] + 1), bool), None)
    return measured(field(known.shape, f), known), known, seen(known), level


def test_two_halves_of_different_depth_are_added():
    H, hidden, level = combine(half(bilinear, 3), half(lambda u, v: 5 - u, 1), -1.0)
    assert level == 3 and H.dtype == np.float32 and not hidden.any()
    expected = field(H.shape[:2], lambda u, v: bilinear(u, v) + 5 - u)
    assert np.abs(H - expected).max() < 1e-5
    other, _, other_level = combine(half(lambda u, v: 5 - u, 1), half(bilinear, 3), -1.0)
    assert other_level == 3 and np.abs(other - H).max() < 1e-5


def test_direct_light_alone():
    H, _, level = combine(half(bilinear, 2), None, -1.0)
    assert level == 2 and np.abs(H - field(H.shape[:2], bilinear)).max() < 1e-5
    assert combine(half(bilinear, 2), None, 1e-6)[2] == 0


def test_what_is_hidden_in_one_half_is_hidden_and_dark():
    value, known, hidden, level = half(bilinear, 2)
    known[:], hidden[0, 0] = True, True
    value = field(known.shape, bilinear)
    halves = (value, known, hidden, level), half(bilinear, 2)
    for first, second in (halves, halves[::-1]):
        H, shade, _ = combine(first, second, -1.0)
        assert shade[0, 0] and shade.sum() == 1 and (H[0, 0] == 0).all()
