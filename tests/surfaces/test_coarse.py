"""Rough triangles of surfaces of every kind: their areas and sides are right."""

import numpy as np
import pytest

from lib.nurbs.evaluate import evaluate
from lib.surfaces.coarse import coarse
from lib.surfaces.trimmed import TrimmedSurface
from tests.rooms import cube_mesh
from tests.shapes import rectangle, sphere
from tests.surfaces.trimmed_shapes import octant


def areas(surface):
    """Vectors of the triangles: half the cross products."""
    V, F, _ = coarse(surface)
    return np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]) / 2


def test_a_rectangle_and_a_sphere():
    assert areas(rectangle([0, 0, 0], [2, 0, 0], [0, 3, 0])).sum(axis=0) == pytest.approx([0, 0, 6])
    assert np.linalg.norm(areas(sphere()), axis=1).sum() == pytest.approx(4 * np.pi, rel=0.1)


def test_a_disc_cut_out_of_a_square():
    """The square of side 2 with a round hole of radius 1/2."""
    t = -np.arange(200) / 200 * 2 * np.pi  # a hole runs clockwise
    hole = 0.5 + 0.25 * np.stack([np.cos(t), np.sin(t)], axis=1)
    uv = np.concatenate([[[0, 0], [1, 0], [1, 1], [0, 1.0]], hole])
    base = rectangle([0, 0, 0], [2, 0, 0], [0, 2, 0])
    S = np.column_stack([2 * uv, np.zeros(len(uv))])
    sizes = np.concatenate([np.full(4, np.inf), np.full(200, 1e-4)])
    sizes[4::20] = 0.1  # ten of them matter
    trim = TrimmedSurface(base, np.array([0.0, 1, 0, 1]), uv, np.array([0, 4, 204]), S, sizes)
    decagon = 10 / 2 * 0.5**2 * np.sin(2 * np.pi / 10)
    assert areas(trim).sum(axis=0) == pytest.approx([0, 0, 4 - decagon])


def test_the_inside_of_a_curved_trimmed_surface_bulges():
    """An octant of the unit sphere: its area is pi / 2, that of the flat triangle between its corners 0.87."""
    assert np.linalg.norm(areas(octant()), axis=1).sum() == pytest.approx(np.pi / 2, rel=0.05)


def test_parameters_of_the_corners():
    """Those of the map, a trimmed surface's being its box; meshes keep their own triangles and have none."""
    trim = octant()
    for surface, base in ((sphere(), sphere()), (rectangle([0, 0, 0], [2, 0, 0], [1, 3, 0]),) * 2, (trim, trim.base)):
        V, F, UV = coarse(surface)
        assert V == pytest.approx(evaluate(base, *UV.T)[0]) and F.max() == len(V) - 1
    mesh = cube_mesh()
    V, F, UV = coarse(mesh)
    assert np.array_equal(V, mesh.V) and np.array_equal(F, mesh.F) and UV is None
