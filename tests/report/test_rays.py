"""A unit square of two triangles in the plane z = 0: hits and misses by hand."""

import numpy as np
import pytest

from lib.report import rays

V = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
F = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("scale, move", [(1e-6, 0.0), (1.0, 0.0), (1e6, 0.0), (1.0, 1e5)])
def test_first_hits_give_distance_face_and_weights(scale, move):
    mesh = rays.prepare(V * scale + move, F)
    t, face, weight = rays.first_hits(
        mesh,
        np.array([[0.75, 0.25, 2], [0.25, 0.75, 2], [3, 0, 2]]) * scale + move,
        np.full((3, 3), [0, 0, -4.0]) * scale,
    )
    assert t[:2] == pytest.approx([0.5, 0.5], abs=1e-6) and np.isinf(t[2])
    assert face.tolist() == [0, 1, -1]
    at = np.einsum("nk,nkx->nx", weight[:2], V[F[face[:2]]])
    assert at == pytest.approx(np.array([[0.75, 0.25, 0], [0.25, 0.75, 0]]), abs=1e-6)
    assert weight[2].tolist() == [0, 0, 0]


def test_a_mesh_without_triangles_is_never_hit():
    mesh = rays.prepare(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert rays.first_hits(mesh, np.zeros((1, 3)), np.ones((1, 3)))[1].tolist() == [-1]


@pytest.mark.parametrize("V_bad, F_bad, message", [(V * np.nan, F, "not finite"), (V, F + 2, "indices 2 to 5")])
def test_bad_meshes_are_refused(V_bad, F_bad, message):
    with pytest.raises(ValueError, match=message):
        rays.prepare(V_bad, F_bad)
