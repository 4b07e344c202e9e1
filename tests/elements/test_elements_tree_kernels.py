"""The loops over a level's cells against plain numpy, on lattices drawn at random."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lib.elements import tree_kernels

ERRORS = 0.5


@pytest.fixture(params=[1, 3, 6])
def lattice(request):
    """value (17, 9, C), hidden, noise (17, 9); light, the sum over groups of three channels."""
    rng = np.random.default_rng(request.param)
    value = rng.random((17, 9, request.param)).astype(np.float32)
    hidden, noise = rng.random((17, 9)) < 0.1, (0.2 * rng.random((17, 9))).astype(np.float32)
    light = value if request.param <= 3 else value[..., :3] + value[..., 3:]
    return value, hidden, noise, light


def departure(light, hidden, at, ends):
    """|light at a crossing - mean at its ends|, the largest channel; 0 if one of them is hidden."""
    if any(hidden[place] for place in (at, *ends)):
        return 0.0
    return np.abs(light[at] - np.mean([light[end] for end in ends], axis=0)).max()


@pytest.mark.parametrize("step", [2, 4, 8])
def test_residuals_are_the_largest_of_five(lattice, step):
    value, hidden, noise, light = lattice
    divided = np.random.default_rng(step).random((16 // step, 8 // step)) < 0.7
    divided[0, 0] = True
    out = np.full(divided.shape, np.nan, dtype=np.float32)
    tree_kernels.residuals(value, hidden, noise, divided, step, ERRORS, out)
    h = step // 2
    for (row, column), is_divided in np.ndenumerate(divided):
        j, i = row * step, column * step
        corners = [(j, i), (j, i + step), (j + step, i), (j + step, i + step)]
        midpoints = [(j, i + h), (j + step, i + h), (j + h, i), (j + h, i + step), (j + h, i + h)]
        ends = [corners[:2], corners[2:], corners[::2], corners[1::2], corners]
        worst = max(departure(light, hidden, at, e) for at, e in zip(midpoints, ends, strict=True))
        expected = max(worst - ERRORS * max(noise[at] for at in midpoints), 0) if is_divided else 0
        assert out[row, column] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("step", [1, 4])
def test_contrasts_are_between_visible_corners(lattice, step):
    value, hidden, _, light = lattice
    hidden[:5, :5] = True  # of a cell with no visible corner there is none
    out = np.full((16 // step, 8 // step), np.nan, dtype=np.float32)
    tree_kernels.contrasts(value, hidden, step, out)
    for row, column in np.ndindex(out.shape):
        corners = [((row + a) * step, (column + b) * step) for a, b in np.ndindex(2, 2)]
        seen = [light[at] for at in corners if not hidden[at]]
        assert out[row, column] == pytest.approx(np.ptp(seen, axis=0).max() if seen else 0, abs=1e-6)


def test_nine_crossings_of_a_cell():
    crossings = np.zeros((9, 17), dtype=bool)
    tree_kernels.mark_crossings(np.array([[False, True]]), 4, crossings)
    assert sorted(zip(*np.nonzero(crossings), strict=True)) == [(j, i) for j in (0, 4, 8) for i in (8, 12, 16)]


def test_parts_are_connected_components():
    rng = np.random.default_rng(9)
    side, rows, columns = 4, 8, 12
    usable = rng.random((rows, columns)) < 0.8
    blocked_u, blocked_v = rng.random((rows, columns - 1)) < 0.4, rng.random((rows - 1, columns)) < 0.4
    label = np.empty((rows, columns), dtype=np.int64)
    tree_kernels.number_parts(blocked_u, blocked_v, usable, side, label)
    assert np.array_equal(label >= 0, usable)
    number = np.arange(rows * columns).reshape(rows, columns)
    links = [
        (
            number[:, :-1],
            number[:, 1:],
            ~blocked_u & usable[:, 1:] & usable[:, :-1] & (np.arange(1, columns) % side > 0),
        ),
        (number[:-1], number[1:], ~blocked_v & usable[1:] & usable[:-1] & (np.arange(1, rows) % side > 0)[:, None]),
    ]
    first, last = (np.concatenate([pair[k][pair[2]] for pair in links]) for k in (0, 1))
    graph = coo_array((np.ones(len(first)), (first, last)), shape=(number.size, number.size))
    part = connected_components(graph, directed=False)[1].reshape(rows, columns)
    j, i = np.indices((rows, columns))
    own = j % side * side + i % side
    for p in np.unique(part[usable]):
        mine = (part == p) & usable
        assert (label[mine] == own[mine].min()).all()
