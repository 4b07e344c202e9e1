"""Area, extent, seams, planes and maps of every kind of surface, against closed forms."""

import numpy as np
import pytest

from lib.nurbs import shape
from lib.nurbs.evaluate import point
from lib.surfaces import measure
from lib.surfaces.loops import inside
from lib.surfaces.mesh import Mesh
from tests.shapes import cylinder, rectangle, sphere
from tests.surfaces.trimmed_shapes import SQUARE, circle, cut_out

QUADRATURE = 2e-8  # 3-point Gauss steps of 1/16 along the border of a rational quadric


def triangles(V, F, **more):
    V, F = np.array(V, dtype=float), np.array(F, dtype=np.int32)
    A, B, C = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    N = np.cross(B - A, C - A)
    N /= np.linalg.norm(N, axis=1, keepdims=True)
    return Mesh(V, F, N[:, None].repeat(3, axis=1), **more)


def band(low, high, n=64):
    """All the way round in u, from v = low to high: the seam twice, once in each direction."""
    u = np.linspace(0, 1, n + 1)
    return np.concatenate([np.stack([u, 0 * u + low], axis=1), np.stack([u[::-1], 0 * u + high], axis=1)])


def plate(n=400, is_hole=True):
    loops = [SQUARE, circle((0.5, 0.5), 0.25, n, True)] if is_hole else [circle((0.5, 0.5), 0.25, n)]
    return cut_out(rectangle([0, 0, 0], [2, 0, 0], [0, 2, 0]), loops)


def test_plate_with_a_hole_is_exact_to_the_polygon():
    polygon = 400 / 2 * np.sin(2 * np.pi / 400) * 0.5**2
    assert measure.area(plate()) == pytest.approx(4 - polygon, rel=1e-13)
    assert measure.area(plate(is_hole=False)) == pytest.approx(polygon, rel=1e-13)
    assert measure.extent(plate()) == pytest.approx((2, 2), rel=1e-13)


@pytest.mark.parametrize("v", [0.3, 0.5, 0.77])
def test_cap_of_a_sphere(v):
    """2 pi r h, the cap's rim half way between two steps, its pole a collapsed side."""
    z = point(sphere(2.0), [0.0], [v])[0, 2]
    cap = cut_out(sphere(2.0), [band(v, 1.0)])
    assert measure.area(cap) == pytest.approx(2 * np.pi * 2 * (2 - z), rel=QUADRATURE)
    assert measure.is_closed(cap) == (True, False)
    assert measure.collapsed_sides(cap).tolist() == [False, False, True, True]


def test_cylinder_with_a_round_hole():
    """A hole that is a disc of radius r when the wall is unrolled: its border by arc length."""
    r, n = 0.3, 2000
    angle = -np.linspace(0, 2 * np.pi, n, endpoint=False)
    theta, z = np.pi + r * np.cos(angle), 0.5 + r * np.sin(angle)
    quarter, part = np.divmod(theta, np.pi / 2)
    # t : 1 - t on the rational quarter is as the roots of the distances from the tangents at its ends
    before, after = np.sin(part / 2), np.sin((np.pi / 2 - part) / 2)
    t = before / (before + after)
    u = (quarter + t) / 4
    S = point(cylinder(), u, z)
    assert np.abs(np.arctan2(S[:, 1], S[:, 0]) % (2 * np.pi) - theta).max() < 1e-12
    wall = cut_out(cylinder(), [SQUARE, np.stack([u, z], axis=1)])
    assert measure.area(wall) == pytest.approx(2 * np.pi - np.pi * r**2, rel=1e-6)
    assert measure.extent(wall)[1] == pytest.approx(1, rel=1e-12)


def test_the_whole_box_measures_like_the_base():
    whole = cut_out(sphere(), [band(0.0, 1.0)])
    assert measure.area(whole) == pytest.approx(4 * np.pi, rel=QUADRATURE)
    assert measure.extent(whole) == pytest.approx(shape.extent(sphere()), rel=QUADRATURE)


def test_seams_are_borders_used_on_both_sides_alike():
    half = np.array([[0, 0], [0.5, 0], [0.5, 1], [0, 1]])
    wavy = np.array([[0, 0], [1, 0], [1, 0.4], [0.5, 1], [0, 0.4]])
    lame = np.array([[0, 0], [1, 0], [1, 0.4], [0.5, 1], [0, 0.7]])
    found = [measure.is_closed(cut_out(cylinder(), [loop]))[0] for loop in (SQUARE, half, wavy, lame)]
    assert found == [True, False, True, False]
    assert measure.is_closed(cylinder()) == (True, False)


def test_planes():
    assert measure.is_planar(plate()) and not measure.is_planar(cut_out(cylinder(), [SQUARE]))
    bent = plate()
    bent.S[3, 2] += 1e-3
    assert not measure.is_planar(bent)
    flat = triangles([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], [[0, 1, 2], [0, 2, 3]])
    assert measure.is_planar(flat)
    assert not measure.is_planar(triangles([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.1]], [[0, 1, 2], [0, 2, 3]]))


def test_a_mesh_without_and_with_uv():
    V, F = [[0, 0, 0], [2, 0, 0], [2, 8, 0], [0, 8, 0]], [[0, 1, 2], [0, 2, 3]]
    bare = triangles(V, F)
    assert measure.area(bare) == 16 and measure.extent(bare) == (4, 4)
    uv = np.array([[0, 0], [0.5, 0], [0.5, 0.8], [0, 0.8]])[np.array(F)]
    assert measure.extent(triangles(V, F, uv=uv)) == pytest.approx((4, 10))
    assert measure.is_closed(bare) == (False, False) and not measure.collapsed_sides(bare).any()


M = np.array([[0, -2, 0.3, 5], [2, 0, 0, 1], [0.1, 0, 2, -3], [0, 0, 0, 1.0]])


def test_maps_keep_equal_positions_equal():
    """The same points at other places in longer lists: a product of matrices would round some of them differently."""
    S = np.random.default_rng(1).random((1003, 3))
    whole = measure.transformed(cut_out(cylinder(), [np.zeros((1003, 2))], [S], [np.ones(1003)]), M)
    part = measure.transformed(cut_out(cylinder(), [np.zeros((7, 2))], [S[500:507]], [np.ones(7)]), M)
    assert np.array_equal(whole.S[500:507], part.S)
    mesh = triangles(S[500:503], [[0, 1, 2]])
    assert np.array_equal(measure.transformed(mesh, M).V, whole.S[500:503])


def test_maps_scale_the_significances_by_the_largest_stretch():
    base = plate()
    longer = measure.transformed(base, np.diag([1.0, 7.0, 0.5, 1.0]))
    assert longer.significance[4:] == pytest.approx(7 * base.significance[4:], rel=1e-12)
    assert measure.area(longer) == pytest.approx(7 * measure.area(base), rel=1e-12)
    assert np.allclose(longer.S, point(longer.base, *longer.uv.T), atol=1e-14)


@pytest.mark.parametrize("mirror", [1, -1])
def test_corner_normals_stay_on_the_side_the_triangles_are_wound_for(mirror):
    mesh = triangles([[0, 0, 0], [1, 0.2, 0], [0.1, 1, 0.4]], [[0, 1, 2]])
    moved = measure.transformed(mesh, M @ np.diag([mirror, 1, 3.0, 1]))
    expected = np.cross(moved.V[1] - moved.V[0], moved.V[2] - moved.V[0])
    assert moved.N[0] == pytest.approx(np.tile(expected / np.linalg.norm(expected), (3, 1)), abs=1e-14)
    assert moved.F is mesh.F


def test_inside_by_crossings():
    uv = np.array([[0.5, 0.5], [0.1, 0.1], [0.5, 0.76], [0.5, 0.74], [1.1, 0.5], [-0.1, 0.5]])
    assert inside(plate(), uv).tolist() == [False, True, True, False, False, False]


def test_points_and_hull_reach_as_far_as_the_surface():
    cap = cut_out(sphere(), [band(0.5, 1.0)])
    assert measure.points(cap)[:, 2].max() == pytest.approx(1) and measure.points(cap)[:, 2].min() > -1e-12
    for surface in (cap, sphere(), triangles(np.eye(3), [[0, 1, 2]])):
        assert (measure.hull(surface).max(axis=0) >= measure.points(surface).max(axis=0) - 1e-12).all()


def test_a_map_covers_the_box_of_a_trim_and_all_of_other_surfaces():
    trim = plate(is_hole=False)
    cropped = type(trim)(trim.base, np.array([0.25, 0.75, 0.5, 1.0]), *list(vars(trim).values())[2:])
    assert measure.map_domain(cropped) == (0.25, 0.75, 0.5, 1.0)
    assert measure.map_domain(sphere()) == (0.0, 1.0, 0.0, 1.0)
