"""A unit square of two triangles in the plane z = 0: distances by hand."""

import numpy as np
import pytest

from lib.visibility import closest

V = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
F = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("scale, move", [(1e-6, 0.0), (1.0, 0.0), (1e6, 0.0), (1.0, 1e5)])
def test_distances_above_inside_beside_and_at_a_corner(scale, move):
    mesh = closest.prepare(V * scale + move, F)
    points = np.array([[0.5, 0.5, 3], [0.2, 0.1, -0.25], [2, 0.5, 0], [-3, -4, 0]]) * scale + move
    distance, face, weight = closest.closest(mesh, points)
    assert distance / scale == pytest.approx([3, 0.25, 1, 5], rel=1e-6)
    assert weight.sum(1) == pytest.approx(1)
    assert face[1] == 0


def test_nothing_is_close_to_a_mesh_without_triangles():
    mesh = closest.prepare(np.zeros((0, 3)), np.zeros((0, 3), int))
    with pytest.raises(ValueError, match="no triangle"):
        closest.closest(mesh, [[0, 0, 0]])


@pytest.mark.parametrize("V_bad, F_bad, message", [(V * np.nan, F, "not finite"), (V, F + 2, "indices 2 to 5")])
def test_bad_meshes_are_refused(V_bad, F_bad, message):
    with pytest.raises(ValueError, match=message):
        closest.prepare(V_bad, F_bad)
