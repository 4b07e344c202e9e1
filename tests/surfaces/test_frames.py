"""Points, normals and densities of surfaces of every kind."""

import numpy as np
import pytest

from lib.nurbs.evaluate import evaluate, normal
from lib.surfaces.frames import density, frame
from lib.surfaces.mesh import Mesh
from tests.shapes import sphere


def test_density_of_a_sphere():
    """|S_u x S_v| is the product of its lengths: u and v lines are orthogonal."""
    u, v = np.random.default_rng(1).uniform(size=(2, 20))
    _, S_u, S_v = evaluate(sphere(), u, v)
    expected = np.linalg.norm(S_u, axis=1) * np.linalg.norm(S_v, axis=1)
    assert density(sphere(), np.stack([u, v], axis=1)) == pytest.approx(expected, rel=1e-9)
    assert np.abs((normal(sphere(), u, v) * S_u).sum(axis=1)).max() < 1e-8


def roof(turn):
    """A triangle of area 2 on the lower left half of its map, its corner normals turned outwards by `turn`."""
    V = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]])
    N = np.array([[[-turn, -turn, 1], [turn, -turn, 1], [-turn, turn, 1]]])
    N = N / np.linalg.norm(N, axis=2, keepdims=True)
    uv = np.array([[[0.0, 0], [1, 0], [0, 1]]])
    return Mesh(V, np.array([[0, 1, 2]], dtype=np.int32), N, None, uv, np.zeros(1, dtype=np.int32), 3)


def test_a_flat_mesh_is_its_triangles():
    uv, face = np.array([[0.25, 0.5], [0.5, 0.5], [0.0, 0.0]]), np.zeros(3, dtype=int)
    S, N = frame(roof(0.0), uv, face)
    assert S == pytest.approx(np.column_stack([2 * uv, np.zeros(3)]))
    assert (N == [0, 0, 1]).all()
    assert density(roof(0.0), uv, face) == pytest.approx(4.0)


def test_rays_leave_a_smooth_mesh_from_above_its_facets():
    uv, face = np.array([[1 / 3, 1 / 3], [1.0, 0.0]]), np.zeros(2, dtype=int)
    (middle, corner), N = frame(roof(0.2), uv, face)
    assert middle[2] > 0.1 and corner == pytest.approx([2, 0, 0])
    assert N[1] == pytest.approx(roof(0.2).N[0, 1])
    assert np.linalg.norm(N, axis=1) == pytest.approx(1.0)
    hollow, _ = frame(roof(-0.2), uv[:1], face[:1])
    assert hollow[0, 2] == pytest.approx(0.0)  # where the smooth surface would be below, the facet counts
