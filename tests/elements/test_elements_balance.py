"""2:1 balance against drawn trees and a slow oracle that compares leaves pair by pair."""

import numpy as np
import pytest

from lib.elements.balance import balance, children, grow, is_balanced, parents


def drawn(*levels):
    """Trees from text: one string a level, rows by spaces, row v = 0 first; 1 is divided."""
    return [np.array([[c == "1" for c in row] for row in level.split()]) for level in levels]


def random_tree(seed, roots=(2, 1), depth=4):
    """Divided cells, rarer with depth, each with its parent divided."""
    rng = np.random.default_rng(seed)
    divided = [rng.random((roots[1], roots[0])) < 0.7]
    for _ in range(depth - 1):
        below = children(divided[-1])
        divided.append(below & (rng.random(below.shape) < 0.4))
    return divided


def leaves(divided):
    """{(level, j, i)} of the leaves."""
    exists = [np.ones_like(divided[0]), *(children(d) for d in divided)]
    split = [*divided, np.zeros_like(exists[-1])]
    return {
        (level, int(j), int(i))
        for level, (here, cut) in enumerate(zip(exists, split, strict=True))
        for j, i in zip(*np.nonzero(here & ~cut), strict=True)
    }


def touch(a, b, shape, closed):
    """Two leaves share an edge or a corner; shape (rows, columns) of the roots."""
    for axis in (0, 1):
        lo, hi = (c[1 + axis] / 2 ** c[0] for c in (a, b)), ((c[1 + axis] + 1) / 2 ** c[0] for c in (a, b))
        (a0, b0), (a1, b1) = lo, hi
        turns = (-shape[axis], 0, shape[axis]) if closed[1 - axis] else (0,)
        if not any(a0 <= b1 + t and b0 + t <= a1 for t in turns):
            return False
    return True


def oracle(divided, closed):
    """Split the larger of any two touching leaves more than a level apart, until none is left."""
    cells = leaves(divided)
    while True:
        large = next(
            (a for a in cells for b in cells if b[0] > a[0] + 1 and touch(a, b, divided[0].shape, closed)), None
        )
        if large is None:
            return cells
        level, j, i = large
        cells = cells - {large} | {(level + 1, 2 * j + dj, 2 * i + di) for dj in (0, 1) for di in (0, 1)}


def test_over_an_edge():
    """Divided twice beside the middle: the other half must divide once.

    +-------+-------+       +---+---+-------+
    |       |       |       |   |   |       |
    |   +-+-+       |  ->   +---+-+-+---+---+
    ...
    """
    tree = drawn("11", "0100 0000", "00000000 00010000 00000000 00000000")
    assert is_balanced(tree[:2])
    assert [d.astype(int).tolist() for d in balance(tree)[:2]] == [[[1, 1]], [[0, 1, 1, 0], [0, 1, 1, 0]]]


def test_over_a_corner():
    """The lower left root is cut twice at the corner it shares with the upper right one, which has to follow."""
    tree = drawn("10 00", "0000 0100 0000 0000")
    assert not is_balanced(tree)
    assert balance(tree)[0].all()
    # with edges alone the root across the corner would stay whole
    over_edges = tree[0] | parents(np.array([[0, 1, 0, 0], [1, 1, 1, 0], [0, 1, 0, 0], [0, 0, 0, 0]], dtype=bool))
    assert not over_edges[1, 1]


@pytest.mark.parametrize("closed", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize("seed", range(8))
def test_random_trees_against_the_oracle(seed, closed):
    tree = random_tree(seed, roots=[(2, 1), (1, 1), (1, 3)][seed % 3], depth=4 if seed % 2 else 3)
    balanced = balance(tree, closed)
    assert leaves(balanced) == oracle(tree, closed)
    assert is_balanced(balanced, closed)
    assert all((a == b).all() for a, b in zip(balance(balanced, closed), balanced, strict=True))
    assert all((a <= b).all() for a, b in zip(tree, balanced, strict=True))


@pytest.mark.parametrize("seed", range(4))
def test_total_area_is_kept(seed):
    tree = random_tree(seed)
    assert sum(4.0**-level for level, _, _ in leaves(balance(tree))) == 2


@pytest.mark.parametrize("seed", range(4))
def test_commutes_with_mirrors_and_transposition(seed):
    tree = random_tree(seed)
    for turn in (np.transpose, np.fliplr, np.flipud):
        turned = balance([turn(d) for d in tree])
        assert all((a == turn(b)).all() for a, b in zip(turned, balance(tree), strict=True))


def test_the_given_tree_is_left_alone():
    tree = drawn("10 00", "0000 0100 0000 0000")
    balance(tree)
    assert tree[0].sum() == 1


def test_across_a_seam():
    tree = drawn("1000", "10000000 00000000", "1" + "0" * 15 + " " + " ".join(["0" * 16] * 3))
    open_, closed = balance(tree), balance(tree, (True, False))
    assert open_[0].tolist() == [[True, False, False, False]]
    assert closed[0].tolist() == [[True, False, False, True]]


def test_grow_over_edges_corners_and_seams():
    cells = drawn("1000 0000 0000")[0]
    assert grow(cells).astype(int).tolist() == [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 0, 0]]
    assert grow(cells, (True, True)).astype(int).tolist() == [[1, 1, 0, 1], [1, 1, 0, 1], [1, 1, 0, 1]]


def test_single_cell():
    tree = drawn("0")
    assert is_balanced(tree) and balance([]) == [] and leaves(balance(tree)) == {(0, 0, 0)}
