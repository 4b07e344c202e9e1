"""Triangles made meshes: welding, what is dropped, normals; and polygons cut into triangles."""

import numpy as np
import pytest

from lib.surfaces.mesh_build import Dropped, mesh, normals_areas
from lib.surfaces.polygons import triangles

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


def cube():
    """A unit cube from six squares that share no positions: (24, 3), (12, 3), outside is lit."""
    V, F = [], []
    for axis in range(3):
        for side in (0.0, 1.0):
            face = np.zeros((4, 3))
            face[:, (axis + 1) % 3], face[:, (axis + 2) % 3] = SQUARE[:, 0], SQUARE[:, 1]
            face[:, axis] = side
            order = [[0, 1, 2], [0, 2, 3]] if side else [[0, 2, 1], [0, 3, 2]]
            F += [[4 * len(V) + k for k in corner] for corner in order]
            V.append(face)
    return np.concatenate(V), np.array(F)


def volume(m):
    return np.einsum("ij,ij->", m.V[m.F[:, 0]], np.cross(m.V[m.F[:, 1]], m.V[m.F[:, 2]])) / 6


def ring(n, top=0.0):
    """A cylinder (or with a `top` of 1 a double cone's half) of n sides, height 1, around z, lit outside."""
    angle = 2 * np.pi * np.arange(n) / n
    low = np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=1)
    k, after = np.arange(n), (np.arange(n) + 1) % n
    F = np.concatenate([np.stack([k, after, n + after], axis=1), np.stack([k, n + after, n + k], axis=1)])
    return np.concatenate([low, low * [1, 1, 0] + [0, 0, 1]]), F


def test_equal_positions_are_welded():
    V, F = cube()
    m, dropped = mesh(V, F)
    assert (m.V.shape, m.F.shape, m.F.dtype, dropped) == ((8, 3), (12, 3), np.int32, Dropped())
    assert volume(m) == pytest.approx(1.0)


def test_positions_come_in_the_order_of_use_and_minus_zero_is_zero():
    V = np.array([[9, 9, 9], [0, 1, 0], [1, 0, 0], [0, 0, 0], [-0.0, 0, -0.0], [1, 1, 0]])
    m, _ = mesh(V, [[3, 2, 1], [4, 5, 1]])
    assert m.V.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    assert m.F.tolist() == [[0, 1, 2], [0, 3, 2]]


def test_useless_triangles_are_dropped():
    V = np.array([*SQUARE, [0.5, 0, 0], [1, 0, 0]])
    F = [[0, 1, 2], [0, 4, 1], [1, 5, 2], [1, 2, 0], [0, 2, 1], [0, 2, 3], [3, 3, 3]]
    m, dropped = mesh(V, F)
    assert dropped == Dropped(flat=3, repeated=1)  # the one turned over is another side
    assert m.F.tolist() == [[0, 1, 2], [0, 2, 1], [0, 2, 3]]
    assert len(m.V) == 4


def test_a_cube_keeps_its_edges_and_a_cylinder_is_round():
    V, F = cube()
    m, _ = mesh(V, F)
    face, _ = normals_areas(m.V, m.F)
    assert np.abs(m.N - face[:, None]).max() < 1e-15
    m, _ = mesh(*ring(12))  # folded by 30 degrees
    radial = m.V[m.F] * [1, 1, 0]
    assert np.abs(m.N - radial).max() < 1e-12
    m, _ = mesh(*ring(8))  # by 45
    assert np.abs(m.N - normals_areas(m.V, m.F)[0][:, None]).max() < 1e-12


def test_normals_of_folds_that_overhang_stay_on_the_lit_side():
    """Triangles around the tip of a cone over a winding curve: smooth all round, some turned away from their mean."""
    t = np.arange(240) / 240 * 2 * np.pi
    around, up = t - 0.6 * np.sin(4 * t), 0.5 * np.cos(4 * t)
    rim = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=1)
    m, _ = mesh(np.vstack([rim, np.zeros(3)]), [(k, (k + 1) % 240, 240) for k in range(240)])
    face, _ = normals_areas(m.V, m.F)
    tip = m.N[m.F == np.flatnonzero((m.V == 0).all(axis=1))[0]]
    along = np.einsum("ij,ij->i", tip, face)
    assert along.min() > 0
    turned = np.isclose(along, 1.0, atol=1e-12)  # these have their own normal, the others the mean of all
    assert 0 < turned.sum() < 240 and np.ptp(tip[~turned], axis=0).max() < 1e-12


def test_normals_of_the_file_count_unless_they_oppose_the_winding():
    given = np.array([[[0, 0.6, 1.6], [0, 0, 5], [0, 0, -1]], [[np.nan, 0, 0], [0, 0, 0], [0, 1, 1]]])
    m, dropped = mesh(SQUARE, [[0, 1, 2], [0, 2, 3]], given)
    length = np.hypot(0.6, 1.6)
    up, tilted = [0, 0, 1], [0, np.sqrt(0.5), np.sqrt(0.5)]
    assert np.allclose(m.N, [[[0, 0.6 / length, 1.6 / length], up, up], [up, up, tilted]], atol=1e-15)
    assert dropped == Dropped(against=1)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_unit_changes_nothing(scale):
    V, F = ring(12)
    a, b = mesh(V, F)[0], mesh(V * scale, F)[0]
    assert np.array_equal(a.F, b.F)
    assert np.abs(a.N - b.N).max() < 1e-12


def test_hopeless_meshes_are_refused():
    with pytest.raises(ValueError, match="positions: NaN"):
        mesh(SQUARE * [1, np.nan, 1], [[0, 1, 2]])
    with pytest.raises(ValueError, match="triangles: an index is outside 0 to 3"):
        mesh(SQUARE, [[0, 1, 4]])
    with pytest.raises(ValueError, match="triangles: none has an area"):
        mesh(SQUARE, [[0, 1, 1]])
    with pytest.raises(ValueError, match="triangles: none has an area"):
        mesh(SQUARE, np.zeros((0, 3), dtype=int))


def polygon_area(P, corner):
    T = P[corner]
    return np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0])[:, 2] / 2


@pytest.mark.parametrize("turn", [1, -1])
def test_concave_polygons_are_cut_inside(turn):
    P = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0]], dtype=float)[::turn]  # an M, area 10
    for first in range(5):
        rolled = np.roll(P, first, axis=0)
        corner, polygon = triangles(rolled, np.array([0, 5]))
        assert (turn * polygon_area(rolled, corner) > 0).all()
        assert turn * polygon_area(rolled, corner).sum() == pytest.approx(10.0)
        assert polygon.tolist() == [0, 0, 0]


def test_a_star_and_a_keyhole():
    angle = np.arange(10) * np.pi / 5
    star = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) * np.where(np.arange(10) % 2, 0.3, 1.0)[:, None]
    corner, _ = triangles(star, np.array([0, 10]))
    assert (polygon_area(star, corner) > 0).all()
    assert polygon_area(star, corner).sum() == pytest.approx(10 * 0.5 * 0.3 * np.sin(np.pi / 5))
    outer = np.array([[0, 0, 0], [3, 0, 0], [3, 3, 0], [0, 3, 0], [0, 0, 0]], dtype=float)
    hole = np.array([[1, 1, 0], [1, 2, 0], [2, 2, 0], [2, 1, 0], [1, 1, 0]], dtype=float)
    P = np.concatenate([outer, hole])
    corner, _ = triangles(P, np.array([0, 10]))
    assert polygon_area(P, corner).sum() == pytest.approx(8.0)
    assert polygon_area(P, corner).min() >= 0


def test_polygons_of_several_sizes_keep_their_order():
    P = np.concatenate([SQUARE, SQUARE[:3], SQUARE])
    corner, polygon = triangles(P, np.array([0, 4, 7, 11]))
    assert corner.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6], [7, 8, 9], [7, 9, 10]]
    assert polygon.tolist() == [0, 0, 1, 2, 2]
