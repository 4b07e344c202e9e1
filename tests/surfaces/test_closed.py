"""Closed shells of triangles, by their edges."""

import numpy as np
import pytest

from lib.surfaces.closed import in_closed_shell

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
CUBE = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]])


def apart(V, F):
    """The same triangles with vertices of their own."""
    return V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)


def test_a_cube_is_closed():
    assert in_closed_shell(CORNERS, CUBE).tolist() == [True] * 12


def test_equal_positions_are_one_vertex_and_so_are_both_zeros():
    V, F = apart(CORNERS, CUBE)
    V[::2] *= np.where(V[::2] == 0, -1.0, 1.0)  # -0.0
    assert in_closed_shell(V, F).all()
    V[0, 0] += 1e-15
    assert not in_closed_shell(V, F).any()


@pytest.mark.parametrize("missing", [0, 7])
def test_a_cube_without_a_face_is_open_everywhere(missing):
    assert not in_closed_shell(CORNERS, np.delete(CUBE, missing, axis=0)).any()


def test_two_cubes_are_told_apart():
    V = np.concatenate([CORNERS, CORNERS + 3])
    F = np.concatenate([CUBE, CUBE[1:] + 8])
    assert in_closed_shell(V, F).tolist() == [True] * 12 + [False] * 11


def test_cubes_that_share_a_corner_alone_stay_two():
    V = np.concatenate([CORNERS, CORNERS + 1])
    assert in_closed_shell(V, np.concatenate([CUBE, CUBE[1:] + 8])).tolist() == [True] * 12 + [False] * 11


def test_cubes_that_share_an_edge_stay_closed():
    """It is used four times, twice in each direction."""
    V = np.concatenate([CORNERS, CORNERS + [1, 1, 0]])
    assert in_closed_shell(V, np.concatenate([CUBE, CUBE + 8])).all()
    assert not in_closed_shell(V, np.concatenate([CUBE, CUBE[1:] + 8])).any()


def test_a_t_junction_is_no_joint():
    """One triangle cut in two, its neighbour over the cut edge is not."""
    V = np.concatenate([CORNERS, (CORNERS[:1] + CORNERS[1:2]) / 2])
    assert CUBE[0].tolist() == [0, 1, 3]
    F = np.concatenate([[[0, 8, 3], [8, 1, 3]], CUBE[1:]])
    assert not in_closed_shell(V, F).any()


def test_a_face_wound_the_other_way_breaks_the_shell():
    F = CUBE.copy()
    F[3] = F[3, ::-1]
    assert not in_closed_shell(CORNERS, F).any()


def test_a_shell_turned_inside_out_is_closed():
    assert in_closed_shell(CORNERS, CUBE[:, ::-1]).all()


def test_no_faces():
    assert in_closed_shell(np.zeros((0, 3)), np.zeros((0, 3), int)).shape == (0,)
