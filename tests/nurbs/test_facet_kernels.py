"""Triangles of points: which have an area, and how far the surface z = u v is from those cut out of it."""

import numpy as np
import pytest

from lib.nurbs.facet_kernels import NO_AREA, ONE_PLACE, WHOLE
from lib.nurbs.facets import has_area, kinds
from lib.nurbs.surface import bilinear
from lib.surfaces.trim_distance import FEW_SAMPLES, MANY, MANY_SAMPLES, distances


def test_kinds_of_triangles():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [1, 0, 0], [0.5, 1e-14, 0], [0.5, 1e-6, 0]])
    F = np.array([[0, 1, 2], [0, 1, 3], [1, 4, 2], [0, 0, 2], [0, 1, 5], [0, 1, 6]])
    expected = [WHOLE, NO_AREA, ONE_PLACE, ONE_PLACE, NO_AREA, WHOLE]
    assert kinds(points, F).tolist() == expected
    assert has_area(points, F).tolist() == [kind == WHOLE for kind in expected]
    assert kinds(1e-9 * points, F).tolist() == kinds(1e9 * points, F).tolist() == expected
    assert kinds(points, F[:0]).tolist() == []


def test_distances_from_a_saddle():
    """The triangle (0, 0), (1, 0), (1, 1) of z = u v lies in z = v: the surface is v (1 - u) below."""
    saddle = bilinear(*np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]]))
    uv = np.array([[0.0, 0], [1, 0], [1, 1]])
    S = np.concatenate([uv, uv.prod(axis=1)[:, None]], axis=1)
    found, first = distances(saddle, S, uv, np.array([[1, 2, 0]]))
    assert first.tolist() == [[0, 1, 2]]
    u, v = (MANY_SAMPLES @ uv).T
    off = v * (1 - u)
    tilt = np.sqrt(2)  # of z = v, so that heights are so much less
    assert found.height[0] == pytest.approx(off.max() / tilt, rel=1e-12)
    assert found.square[0] == pytest.approx((off**2).mean() / 2, rel=1e-12)
    assert found.slide[0] == pytest.approx(off.max(), rel=1e-12)
    assert found.area[0] == pytest.approx(tilt / 2, rel=1e-12)
    # Along (0, 0)-(1, 0) and (1, 0)-(1, 1) the surface is straight, along the diagonal u^2 lies below u.
    assert found.on_edge[0] == pytest.approx([0, 0, 0.25 / tilt], abs=1e-15)


def test_many_triangles_are_asked_at_fewer_places():
    """The same triangle in a crowd: the largest distance among the places of FEW_SAMPLES."""
    saddle = bilinear(*np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]]))
    uv = np.array([[0.0, 0], [1, 0], [1, 1]])
    S = np.concatenate([uv, uv.prod(axis=1)[:, None]], axis=1)
    found, _ = distances(saddle, S, uv, np.tile([[0, 1, 2]], (MANY + 1, 1)))
    u, v = (FEW_SAMPLES @ uv).T
    assert found.height == pytest.approx(np.full(MANY + 1, (v * (1 - u)).max() / np.sqrt(2)), rel=1e-12)
