"""Element grids: numbers, points, lookups between centres."""

import numpy as np
import pytest

from lib.elements.chunks import members
from lib.elements.grids import CURVED_LEAST, FLAT_LEAST, MOST, at_centres, by_element, element_grids, point_parameters
from tests.tolerances import EXACT


def grids(area, extent, planar=True, n=1600, has=None):
    area = np.asarray(area, dtype=float)
    has = np.ones(len(area), bool) if has is None else np.asarray(has)
    return element_grids(area, np.asarray(extent, float), np.full(len(area), planar), has, n)


def test_sized_by_area_and_shape():
    g = grids([4, 1], [[4, 1], [1, 1]], n=500)
    assert (g.n_u.tolist(), g.n_v.tolist()) == ([40, 10], [10, 10])
    assert g.first.tolist() == [0, 400, 500] and g.total == 500


def test_surfaces_without_elements_have_none():
    g = grids([1, 9, 1], [[1, 1]] * 3, n=200, has=[True, False, True])
    assert g.n_u.tolist() == [10, 0, 10] and g.n_v.tolist() == [10, 0, 10]
    assert g.first.tolist() == [0, 100, 100, 200]
    assert grids([1.0], [[1, 1]], has=[False]).total == 0


def test_bounds_of_a_side():
    curved = grids([1e-9, 1], [[1e-5, 1e-5], [1, 1]], planar=False)
    assert curved.n_u[0] == curved.n_v[0] == CURVED_LEAST
    flat = grids([1e-9, 1], [[1e-5, 1e-5], [1, 1]])
    assert FLAT_LEAST <= flat.n_u[0] <= 3
    assert grids([1.0], [[1, 1]], n=10**6).n_u.tolist() == [MOST]
    assert grids([1e-6], [[1, 1e-6]]).n_v.tolist() == [FLAT_LEAST]


def test_does_not_depend_on_the_unit():
    one, other = grids([3, 1], [[3, 1], [1, 1]]), grids([3e-12, 1e-12], [[3e-6, 1e-6], [1e-6, 1e-6]])
    assert one.n_u.tolist() == other.n_u.tolist() and one.n_v.tolist() == other.n_v.tolist()


def test_points_of_an_element_come_together():
    """Element j n_u + i holds the 16 points of its own cell."""
    n_u, n_v = 3, 2
    u, v = point_parameters(n_u, n_v)
    uv = by_element(np.stack(np.meshgrid(u, v), axis=-1))
    assert uv.shape == (6, 16, 2)
    for number, points in enumerate(uv):
        assert (np.floor(points[:, 0] * n_u) == number % n_u).all()
        assert (np.floor(points[:, 1] * n_v) == number // n_u).all()
        assert np.abs(points.mean(axis=0) - [(number % n_u + 0.5) / n_u, (number // n_u + 0.5) / n_v]).max() < EXACT
        assert len(np.unique(points, axis=0)) == 16


def linear(n_u, n_v):
    """1 + 2 u - 3 v and its double at the centres of a grid, (n_v n_u, 2)."""
    v, u = (np.indices((n_v, n_u)) + 0.5) / np.array([n_v, n_u])[:, None, None]
    f = (1 + 2 * u - 3 * v).ravel()
    return np.stack([f, 2 * f], axis=1)


def test_lookup_of_a_linear_function():
    n_u, n_v = 5, 4
    u, v = np.linspace(0.5 / n_u, 1 - 0.5 / n_u, 13), np.linspace(0.5 / n_v, 1 - 0.5 / n_v, 7)
    found = at_centres(linear(n_u, n_v), np.ones(20), n_u, n_v, u, v, (False, False))
    expected = 1 + 2 * u[None] - 3 * v[:, None]
    assert found.shape == (7, 13, 2)
    assert np.abs(found - np.stack([expected, 2 * expected], axis=-1)).max() < EXACT


def test_lookup_at_the_border_is_that_of_the_nearest_centres():
    found = at_centres(
        linear(5, 4), np.ones(20), 5, 4, np.array([0, 0.1, 1.0]), np.array([0, 0.125, 1.0]), (False, False)
    )
    assert np.abs(found[0, 0] - found[1, 1]).max() < EXACT
    assert np.abs(found[2, 2, 0] - (1 + 2 * 0.9 - 3 * 0.875)) < EXACT


def test_lookup_goes_round_a_seam():
    """Values 0, 1, 2, 3 round u: half way between the last and the first lies the seam."""
    values = np.arange(4.0)[:, None]
    u = np.array([0.0, 1.0, 0.9375])
    assert at_centres(values, np.ones(4), 4, 1, u, np.array([0.5]), (True, False))[0, :, 0].tolist() == [1.5, 1.5, 2.25]
    assert at_centres(values, np.ones(4), 1, 4, np.array([0.5]), u, (False, True))[:, 0, 0].tolist() == [1.5, 1.5, 2.25]
    assert at_centres(values, np.ones(4), 4, 1, u, np.array([0.5]), (False, False))[0, :, 0].tolist() == [0, 3, 3]


def test_lookup_leaves_hidden_elements_out():
    values, share = np.array([[2.0], [1e9], [4.0]]), np.array([1.0, 0.0, 0.5])
    u = np.array([1 / 6, 1 / 3, 0.5, 2 / 3, 5 / 6])
    found = at_centres(values, share, 3, 1, u, np.array([0.5]), (False, False))[0, :, 0]
    assert found == pytest.approx([2, 2, 0, 4, 4])
    assert at_centres(values, np.zeros(3), 3, 1, u, np.array([0.5]), (False, False)).max() == 0


def test_chunks_share_out_every_surface_with_a_map_once():
    has_map = np.random.default_rng(1).random(23) < 0.7
    for n in (1, 2, 5, 40):
        chunks = [members(has_map, n, c) for c in range(n)]
        assert sorted(np.concatenate(chunks)) == np.flatnonzero(has_map).tolist()
        assert all((np.diff(c) > 0).all() for c in chunks)
        assert max(len(c) for c in chunks) - min(len(c) for c in chunks) <= 1
