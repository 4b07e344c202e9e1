"""A unit square of two triangles in the plane z = 0: hits, misses and distances by hand."""

import numpy as np
import pytest

from lib.visibility import closest

V = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
F = np.array([[0, 1, 2], [0, 2, 3]])


def test_first_hits_give_distance_face_and_weights():
    mesh = closest.prepare(V, F)
    t, face, weight = closest.first_hits(mesh, [[0.75, 0.25, 2], [0.25, 0.75, 2], [3, 0, 2]], [[0, 0, -4.0]] * 3)
    assert t[:2] == pytest.approx([0.5, 0.5], abs=1e-6) and np.isinf(t[2])
    assert face.tolist() == [0, 1, -1]
    at = np.einsum("nk,nkx->nx", weight[:2], V[F[face[:2]]])
    assert at == pytest.approx(np.array([[0.75, 0.25, 0], [0.25, 0.75, 0]]), abs=1e-6)
    assert weight[2].tolist() == [0, 0, 0]


@pytest.mark.parametrize("scale, move", [(1e-6, 0.0), (1.0, 0.0), (1e6, 0.0), (1.0, 1e5)])
def test_distances_above_inside_beside_and_at_a_corner(scale, move):
    mesh = closest.prepare(V * scale + move, F)
    points = np.array([[0.5, 0.5, 3], [0.2, 0.1, -0.25], [2, 0.5, 0], [-3, -4, 0]]) * scale + move
    distance, face, weight = closest.closest(mesh, points)
    assert distance / scale == pytest.approx([3, 0.25, 1, 5], rel=1e-6)
    assert weight.sum(1) == pytest.approx(1)
    assert face[1] == 0


def test_a_mesh_without_triangles_is_never_hit():
    mesh = closest.prepare(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert closest.first_hits(mesh, [[0, 0, 0]], [[1, 0, 0]])[1].tolist() == [-1]
    with pytest.raises(ValueError, match="no triangle"):
        closest.closest(mesh, [[0, 0, 0]])


@pytest.mark.parametrize("V_bad, F_bad, message", [(V * np.nan, F, "not finite"), (V, F + 2, "indices 2 to 5")])
def test_bad_meshes_are_refused(V_bad, F_bad, message):
    with pytest.raises(ValueError, match=message):
        closest.prepare(V_bad, F_bad)
