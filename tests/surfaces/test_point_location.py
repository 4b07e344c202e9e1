"""Which triangle holds a place: against all of them asked one by one, on slivers too."""

import numpy as np
import pytest

from lib.surfaces.point_location import PointLocation

FAN = 400  # slivers from one corner: none is wider than the cells are


def asked_one_by_one(corner, places):
    """(n, m) least barycentric weight of each place in each triangle, by the definition."""
    ones = np.ones((*corner.shape[:2], 1))
    M = np.linalg.inv(np.concatenate([corner, ones], axis=2).swapaxes(1, 2))  # weights of (u, v, 1)
    weights = np.einsum("mkc,nc->nmk", M, np.concatenate([places, np.ones((len(places), 1))], axis=1))
    return weights.min(axis=2)


def fan():
    """The square below its diagonal as slivers that meet at the origin."""
    t = np.linspace(0, 1, FAN + 1)
    rim = np.stack([1 - t, t], axis=1)
    return np.stack([np.zeros((FAN, 2)), rim[:-1], rim[1:]], axis=1)


def grid(n):
    """Squares of 1/n, cut in two, but for those of every third row."""
    j, i = np.mgrid[0:n, 0:n].reshape(2, -1) / n
    a = np.stack([i, j], axis=1)[(j * n).round() % 3 != 2]
    b, c, d = a + [1 / n, 0], a + [1 / n, 1 / n], a + [0, 1 / n]
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


@pytest.mark.parametrize("corner", [fan(), fan()[:, ::-1], grid(1), grid(7), grid(30)], ids=lambda c: str(len(c)))
def test_as_all_triangles_asked_one_by_one(corner):
    places = np.random.default_rng(3).random((4000, 2)) * 1.2 - 0.1
    least = asked_one_by_one(corner, places)
    clear = np.abs(least).min(axis=1) > 1e-7  # not on an edge
    expected = np.where(least.max(axis=1) > 0, least.argmax(axis=1), -1)
    found = PointLocation(corner).at(places)
    assert clear.mean() > 0.99 and (found == expected)[clear].all()
    assert (found >= 0).sum() > 100 and (found < 0).sum() > 100


def test_nothing_falls_between_triangles_that_share_an_edge_or_a_corner():
    corner = grid(30)
    on_edges = np.concatenate([(corner + np.roll(corner, 1, axis=1)).reshape(-1, 2) / 2, corner.reshape(-1, 2)])
    found = PointLocation(corner).at(on_edges)
    assert (found >= 0).all()
    assert (asked_one_by_one(corner, on_edges)[np.arange(len(found)), found] > -1e-8).all()


def test_no_triangle_and_one_without_area_hold_nothing():
    assert PointLocation(np.empty((0, 3, 2))).at(np.array([[0.5, 0.5]])).tolist() == [-1]
    line = np.array([[[0.1, 0.1], [0.9, 0.9], [0.5, 0.5]]])
    assert PointLocation(line).at(np.array([[0.5, 0.5], [0.3, 0.3]])).tolist() == [-1, -1]


def test_labels_of_cells():
    """Two squares, labelled 5 and 3; a place of the first in a cell of the second, and one in an empty cell."""
    square = np.array([[[0.0, 0], [0.25, 0], [0.25, 0.25]], [[0, 0], [0.25, 0.25], [0, 0.25]]])
    located = PointLocation(np.concatenate([square, square + 0.5]))
    places = np.array([[0.6, 0.7], [0.9, 0.1], [0.1, 0.1]])
    low, is_mixed = located.labels(np.array([5, 5, 3, 3]), 4, 4, places, np.array([0, 0, 1]))
    expected, mixed = np.full((4, 4), -1), np.zeros((4, 4), dtype=bool)
    expected[0, 0], expected[2, 2], expected[0, 3], mixed[2, 2] = 5, 3, 5, True
    assert low.tolist() == expected.tolist() and is_mixed.tolist() == mixed.tolist()
