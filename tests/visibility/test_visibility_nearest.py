"""Closest points of triangles: by hand, against every triangle, and no more than it takes for the largest distance."""

import numpy as np
import pytest

from lib.visibility import closest
from lib.visibility.nearest import Tree
from tests.tolerances import EXACT

FLOAT32 = 1e-6  # open3d finds the triangle in float32
ONE = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]), np.array([[0, 1, 2]])


@pytest.mark.parametrize(
    ("point", "weight"),
    [
        ([0.5, 0.5, 3.0], [0.5, 0.25, 0.25]),
        ([-1.0, -1.0, 1.0], [1, 0, 0]),
        ([1.0, -1.0, 0.0], [0.5, 0.5, 0]),
        ([-1.0, 1.0, 0.0], [0.5, 0, 0.5]),
        ([3.0, 3.0, 0.0], [0, 0.5, 0.5]),
        ([5.0, -1.0, 0.0], [0, 1, 0]),
    ],
)
def test_of_one_triangle(point, weight):
    tree = Tree(*ONE)
    face, found = tree.places([point])
    assert face.tolist() == [0] and np.allclose(found[0], weight, atol=EXACT)
    assert tree.distances([point])[0] == pytest.approx(np.linalg.norm(weight @ ONE[0] - point))


def soup(m, seed=3):
    """Triangles of many sizes, and points in and around them."""
    rng = np.random.default_rng(seed)
    V = (rng.normal(size=(m, 1, 3)) + rng.normal(size=(m, 3, 3)) * rng.uniform(0.01, 0.5, (m, 1, 1))).reshape(-1, 3)
    return V, np.arange(3 * m).reshape(-1, 3), rng.normal(size=(500, 3)) * 2


@pytest.mark.parametrize("m", [1, 2, 4, 5, 16, 17, 1000])
def test_is_the_closest_of_all_triangles(m):
    V, F, points = soup(m)
    tree, each = Tree(V, F), [Tree(V, F[[k]]) for k in range(m)]
    least = np.min([one.distances(points) for one in each], axis=0)
    assert np.allclose(tree.distances(points), least, rtol=0, atol=EXACT)
    face, weight = tree.places(points)
    at = np.einsum("nk,nkc->nc", weight, V[F[face]])
    assert np.allclose(np.linalg.norm(at - points, axis=1), least, rtol=0, atol=EXACT)
    assert weight.min() >= 0 and np.allclose(weight.sum(axis=1), 1)
    assert np.abs(closest.closest(closest.prepare(V, F), points)[0] - least).max() < 10 * FLOAT32


@pytest.mark.parametrize("least", [0.0, 0.7, 100.0])
def test_the_largest_distance_is_right_whatever_is_left_out(least):
    V, F, points = soup(300)
    tree, is_exact = Tree(V, F), np.arange(len(points)) % 3 == 0
    true, found = tree.distances(points), tree.distances_beyond(least, points, is_exact)
    assert np.array_equal(found[is_exact], true[is_exact]) and (found >= true).all()
    assert max(least, found.max()) == max(least, true.max())
    assert (found[~is_exact] > true[~is_exact]).any()


def test_equal_and_flat_triangles():
    """All in one place: halves can not be told apart."""
    V, F = np.concatenate([ONE[0], np.ones((3, 3))]), np.repeat([[0, 1, 2], [3, 4, 5], [0, 0, 1]], 40, axis=0)
    assert Tree(V, F).distances([[0.5, 0.5, -2.0], [1.0, 1.0, 1.5]]).tolist() == pytest.approx([2.0, 0.5])
    assert Tree(V, F[:40]).distances(np.zeros((0, 3))).tolist() == []


def test_of_nothing():
    with pytest.raises(ValueError, match="no triangle"):
        Tree(np.zeros((0, 3)), np.zeros((0, 3), int))
