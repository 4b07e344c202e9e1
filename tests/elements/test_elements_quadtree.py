"""The adaptive quadtree on fields whose right subdivision can be drawn."""

import numpy as np
import pytest

from lib.elements.balance import is_balanced
from lib.elements.lattice import Lattice
from lib.elements.quadtree import CONTACT_CELL, SMALLEST_CELL, WIDE, WIDE_LEVELS, Quadtree

SQUARE = Lattice((1, 1))


def grown(
    field, tau, top, lattice=SQUARE, base=1, side=1.0, hidden=None, channels=1, reach=None, smallest=SMALLEST_CELL
):
    """Measure and divide to the end; every sample is asked for once.  field, hidden, reach: functions of u, v."""
    tree = Quadtree(lattice, base, channels, side, smallest=smallest)
    asked = 0
    while len(tree.wanted()[0]):
        j, i = tree.wanted()
        h, w = lattice.shape(tree.level)
        assert not tree.known[j, i].any() and lattice.is_own(tree.level)[j, i].all()
        u, v = i / (w - 1), j / (h - 1)
        value = np.broadcast_to(
            np.asarray(field(u, v)).reshape(-1, 1) if channels == 1 else field(u, v), (len(u), channels)
        )
        shade = hidden(u, v) if hidden else np.zeros(len(u), dtype=bool)
        tree.put((j, i), value, shade, 0.0, reach(u, v) if reach else np.inf)
        asked += len(u)
        if not tree.split(tau, top):
            break
    assert asked == (tree.known & lattice.is_own(tree.level)).sum()
    return tree


def drawing(tree):
    """Level of the leaf at every cell of the deepest level, one row of digits per row of cells, v = 0 first."""
    rows, columns = tree.lattice.cells(tree.level)
    picture = np.full((rows, columns), -1)
    for level, j, i in tree.leaves():
        n = 2 ** (tree.level - level)
        part = picture[j * n : (j + 1) * n, i * n : (i + 1) * n]
        assert (part == -1).all(), "leaves overlap"
        part[:] = level
    return ["".join(str(c) if c >= 0 else "." for c in row) for row in picture]


def step(u, v):
    return (u > 0.3).astype(float)


def test_an_even_field_keeps_its_base():
    tree = grown(lambda u, v: 0 * u + 5, tau=1e-6, top=6, base=2)
    assert tree.level == 2 and drawing(tree) == ["2222"] * 4
    assert tree.known.all() and tree.known.shape == (5, 5)


def test_a_gentle_slope_keeps_its_base_and_a_steep_one_is_divided_once():
    """Corner contrast decides at the base; then the midpoints lie on the bilinear prediction."""

    def bilinear(u, v):
        return 1 + 2 * u - 3 * v + 4 * u * v

    assert grown(bilinear, tau=10, top=6, side=0.125).level == 1
    assert drawing(grown(bilinear, tau=0.01, top=6, side=0.125)) == ["2222"] * 4


def test_one_corner_drawn():
    """Field 1 at the corner u = v = 0 alone: its base cell is divided by contrast, then all four of its children.

    For the midpoints of their parent depart by 1/2.  Balance divides the rest once.
    """
    tree = grown(lambda u, v: ((u == 0) & (v == 0)).astype(float), tau=0.3, top=3, side=0.5)
    assert drawing(tree) == ["33332222"] * 4 + ["22222222"] * 4


def test_a_step_edge_is_followed_to_the_top():
    """Cells over u = 0.3 reach the top level along all of v, cells far away stay coarse."""
    tree = grown(step, tau=0.1, top=5)
    picture = np.array([[int(c) for c in row] for row in drawing(tree)])
    assert picture.shape == (32, 32)
    column = int(0.3 * 32)
    assert (picture[:, column] == 5).all()
    assert (picture[:, 24:] == 2).all()
    assert (picture == picture[:1]).all()  # the field does not depend on v
    assert (np.abs(np.diff(picture[0])) <= 1).all()
    assert is_balanced(tree.divided)


def test_a_weak_step_is_not_followed():
    assert grown(lambda u, v: 0.05 * step(u, v), tau=0.1, top=5).level == 1


def test_the_top_is_the_end():
    for top in (1, 2, 3):
        assert grown(step, tau=0.1, top=top).level == top


def test_corners_of_every_leaf_are_known_and_t_vertices_too():
    """What stands on the lattice: the nine points of every divided cell, nothing else."""
    tree = grown(lambda u, v: ((u - 0.4) ** 2 + (v - 0.6) ** 2 < 0.09).astype(float), tau=0.1, top=5)
    expected = np.zeros_like(tree.known)
    for level, divided in enumerate(tree.divided):
        half = 2 ** (tree.level - level - 1)
        for j, i in zip(*np.nonzero(divided), strict=True):
            expected[2 * j * half : (2 * j + 2) * half + 1 : half, 2 * i * half : (2 * i + 2) * half + 1 : half] = True
    assert (tree.known == expected).all()
    assert sum(4.0 ** -float(level) for level, _, _ in tree.leaves()) == 1
    assert is_balanced(tree.divided)


def test_hidden_samples_take_no_part():
    """A buried half with values of its own: its values divide nothing, only the contact along its rim does, down to
    CONTACT_CELL.
    """

    def buried(u, v):
        return u > 0.5

    def field(u, v):
        return np.where(buried(u, v), 1e6, 1.0)

    tree = grown(field, tau=0.1, top=5, hidden=buried, base=2, side=4 * CONTACT_CELL, smallest=CONTACT_CELL / 8)
    assert tree.level == 2
    rim = grown(field, tau=0.1, top=5, hidden=buried, base=2, side=16 * CONTACT_CELL)
    picture = np.array([[int(c) for c in row] for row in drawing(rim)])
    assert rim.level == 4 and (picture[:, 8] == 4).all() and (picture[:, 0] == 2).all() and (picture[:, -1] == 2).all()
    assert grown(lambda u, v: np.where(buried(u, v), 1e6, 1.0), tau=0.1, top=5, base=2).level == 5
    assert grown(lambda u, v: u * 0 + 1e6, tau=0.1, top=5, hidden=lambda u, v: u >= 0).level == 1


def test_visible_samples_beside_hidden_ones_still_count():
    tree = grown(step, tau=0.1, top=4, hidden=lambda u, v: u > 0.9)
    assert tree.level == 4


def test_the_largest_channel_decides():
    def coloured(u, v):
        return np.stack([0 * u, step(u, v), 0 * u], axis=1)

    assert grown(coloured, tau=0.1, top=4, channels=3).level == 4


def test_the_sum_over_light_groups_decides():
    """Two lamps whose steps cancel: nothing to follow, whatever they are called."""

    def two_lamps(u, v):
        one = np.stack([step(u, v)] * 3, axis=1)
        return np.concatenate([one, 1 - one], axis=1)

    assert grown(two_lamps, tau=0.1, top=4, channels=6).level == 1
    assert grown(lambda u, v: two_lamps(u, v)[:, [0, 0, 0, 1, 1, 1]], tau=0.1, top=4, channels=6).level == 4


def test_round_a_seam():
    """A bump on the seam: first and last column stay one sample, both sides are divided alike."""
    lattice = Lattice((2, 1), closed=(True, False))
    tree = grown(lambda u, v: np.minimum(u, 1 - u) < 0.02, tau=0.1, top=4, lattice=lattice)
    assert (tree.known[:, 0] == tree.known[:, -1]).all() and (tree.value[:, 0] == tree.value[:, -1]).all()
    picture = drawing(tree)
    assert all(row[0] == row[-1] == "4" for row in picture)
    assert is_balanced(tree.divided, lattice.closed)


def test_samples_beside_noisy_ones_are_doubted_once_round_a_seam_too():
    """Noise in the column before the seam: the columns on both its sides are asked again, the noisy one is not."""
    for closed, expected in ((True, {0, 6}), (False, {6, 8})):
        tree = Quadtree(Lattice((1, 1), (closed, False)), 3, 1)
        j, i = tree.wanted()
        tree.put((j, i), np.zeros((len(j), 1)), False, np.where(i == 7, 0.1, 0), np.inf)
        assert set(tree.doubtful()[1].tolist()) == expected
        assert not len(tree.doubtful()[1])


def test_balance_goes_round_a_seam():
    """Fine cells on one side of the seam alone: the cells across it follow."""
    lattice = Lattice((4, 1), closed=(True, False))
    tree = grown(lambda u, v: np.abs(u - 0.97) < 0.012, tau=0.1, top=5, lattice=lattice, base=3, side=0.25)
    picture = drawing(tree)
    assert picture[0][-1] == "5" and picture[0][0] == "4"
    assert is_balanced(tree.divided, lattice.closed)


def spike(u, v):
    """A steep plane, and a sample beside it in the middle of the first base cell."""
    return 10 * u + 1.0 * ((u == 0.25) & (v == 0.25))


def test_middles_of_cells_are_compared_as_well():
    tree = grown(spike, tau=0.5, top=3)
    assert drawing(tree) == ["33332222"] * 4 + ["22222222"] * 4


def test_hidden_middles_are_not():
    own = {"side": 2 * CONTACT_CELL, "smallest": CONTACT_CELL / 8}  # so that only the contact could stop
    tree = grown(spike, tau=0.5, top=3, hidden=lambda u, v: (u == 0.25) & (v == 0.25), **own)
    assert drawing(tree) == ["2222"] * 4


def test_poles_are_one_sample():
    lattice = Lattice((2, 1), closed=(True, False), collapsed=(False, False, True, True))
    tree = grown(lambda u, v: np.where(v == 0, 7, step(u, v)), tau=0.1, top=4, lattice=lattice, base=2)
    known = tree.known[0]
    assert (tree.value[0, known] == 7).all() and known[:: 2 ** (tree.level - 2)].all()


def test_cells_finer_than_anybody_sees_are_left():
    tree = grown(step, tau=1e-9, top=8, side=16 * SMALLEST_CELL)
    assert 16 * SMALLEST_CELL * 2.0**-tree.level >= SMALLEST_CELL / 2
    assert tree.level < 8


def test_wide_cells_below_a_contact_are_divided():
    """An even field, free space of 1/100 above the corner u = v = 0: there alone, WIDE_LEVELS below the base."""
    near = 0.01 / WIDE
    tree = grown(lambda u, v: 0 * u + 1, 0.1, 6, base=2, reach=lambda u, v: np.where((u == 0) & (v == 0), near, np.inf))
    assert tree.level == 2 + WIDE_LEVELS
    picture = drawing(tree)
    assert picture[0][0] == str(tree.level) and picture[-1][-1] == "2"


@pytest.mark.parametrize("roots", [(1, 1), (3, 1), (1, 8)])
def test_leaves_tile_the_surface(roots):
    lattice = Lattice(roots)
    tree = grown(step, tau=0.1, top=4, lattice=lattice)
    drawing(tree)
    assert sum(4.0 ** -float(level) for level, _, _ in tree.leaves()) == roots[0] * roots[1]
    assert not any("." in row for row in drawing(tree))


def test_shares_of_the_samples_are_those_of_their_leaves():
    tree = grown(step, tau=0.1, top=4)
    shares = tree.shares()
    assert shares.sum() == pytest.approx(1) and (shares[~tree.known] == 0).all()
    assert shares[0, 0] == 4.0 ** -(int(drawing(tree)[0][0]) + 1)


def test_cells_that_exceed_later_are_measured_too():
    """Samples measured again may exceed at a level that exists already, the deepest one among them: nothing stays
    divided without samples."""
    tree = grown(lambda u, v: 0 * u, tau=0.1, top=3)
    while tree.level < 3:
        tree.divided.append(np.zeros(tree.lattice.cells(tree.level), dtype=bool))
        tree.divided[-1][0, 0] = True
        tree._deepen()
        tree._want([np.zeros_like(d) for d in tree.divided[:-1]] + [tree.divided[-1]])
        tree.put(tree.wanted(), 0.0, False, 0.0, np.inf)
    at = np.array([4]), np.array([4])  # the middle of the map, known from the base level on
    tree.put(at, 5.0, False, 0.0, np.inf)
    for _ in range(8):
        if not tree.split(0.1, 3):
            break
        tree.put(tree.wanted(), 0.0, False, 0.0, np.inf)
    for level, cells in enumerate(tree.divided):
        known = tree.known[:: 2 ** (3 - level - 1), :: 2 ** (3 - level - 1)]
        for dj in range(3):
            for di in range(3):
                assert known[dj::2, di::2][: cells.shape[0], : cells.shape[1]][cells].all()
