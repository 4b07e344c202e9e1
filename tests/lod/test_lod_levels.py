"""Levels of detail: what was asked for, measured from outside, clean at poles and seams."""

import numpy as np
import pytest

from lib.lod.coverage import screen_coverage
from lib.lod.levels import MOST, Scene, TooFine
from lib.nurbs import evaluate
from lib.nurbs.surface import from_points
from lib.surfaces import tessellate
from lib.surfaces.gaps import gap
from lib.visibility import closest
from tests import shapes
from tests.rooms import cube_mesh
from tests.shapes import box, rectangle, sphere, triangle


def scene(surfaces):
    return Scene(surfaces, tessellate.shapes(surfaces, np.ones(len(surfaces), bool)))


def edge_uses(V, F):
    _, place = np.unique(V, axis=0, return_inverse=True)
    F = place[F]
    edges = np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1)
    return np.unique(edges, axis=0, return_counts=True)[1]


def clean(level):
    """No flat triangle, unit normals on the side of the facets, parameters in [0, 1]."""
    mesh = level.mesh
    A, B, C = (mesh.V[mesh.F[:, k]] for k in range(3))
    normal = np.cross(B - A, C - A)
    assert (np.linalg.norm(normal, axis=1) > 0).all()
    assert np.allclose(np.linalg.norm(level.N, axis=1), 1, atol=1e-12)
    assert mesh.UV.min() >= 0 and mesh.UV.max() <= 1
    assert mesh.F.max() < len(mesh.V) and np.isfinite(mesh.V).all()


@pytest.fixture(scope="module")
def teapot():
    return scene(shapes.teapot())


@pytest.mark.parametrize("tolerance", [0.3, 0.03, 0.003])
def test_deviation_holds_by_closest_points(teapot, tolerance):
    """Independent of our measure: exact points on a dense grid, closest points on the mesh by open3d."""
    level = teapot.by_deviation(tolerance)
    clean(level)
    t = np.linspace(0, 1, 41)
    points = np.concatenate([evaluate.evaluate_grid(s, t, t)[0].reshape(-1, 3) for s in teapot.surfaces])
    true = closest.closest(closest.prepare(level.mesh.V, level.mesh.F), points)[0]
    assert true.max() <= tolerance * 1.001 + 1e-6
    assert level.mesh.distance.max() <= tolerance
    assert true.max() == pytest.approx(level.mesh.distance.max(), rel=0.35)


@pytest.mark.parametrize("asked", [20_000, 3000, 500, 150])
def test_counts_are_met_from_below(teapot, asked):
    level = teapot.by_count(asked)
    clean(level)
    assert 0.8 * asked <= len(level.mesh.F) <= asked and not level.is_smallest


def test_fewer_than_the_surfaces_need_is_said(teapot):
    level = teapot.by_count(10)
    clean(level)
    assert level.is_smallest and level.asked == 10
    assert len(level.mesh.F) == teapot.predicted(10.0) <= 3 * 64


def test_finer_levels_are_closer(teapot):
    levels = [teapot.by_count(n) for n in (300, 1000, 3000, 10000)]
    distance = [level.mesh.distance.max() for level in levels]
    assert all(a > 1.5 * b for a, b in zip(distance[:-1], distance[1:], strict=True))
    # chords: the distance falls as the number of triangles grows
    assert distance[0] / distance[3] == pytest.approx(10000 / 300, rel=0.5)


@pytest.mark.parametrize("asked", [12, 100, 5000])
def test_spheres_stay_closed_at_every_level(asked):
    level = scene([sphere()]).by_count(asked)
    clean(level)
    assert (edge_uses(level.mesh.V, level.mesh.F) == 2).all()
    # exact normals of the unit sphere, at the poles too; the bare Euler formula for a closed surface
    assert np.allclose(level.N, level.mesh.V, atol=1e-6)
    assert len(np.unique(level.mesh.V, axis=0)) - len(level.mesh.F) // 2 == 2


def test_boxes_and_walls_stay_at_two_triangles_a_side():
    level = scene([*box(), rectangle([3, 0, 0], [4, 0, 0], [0, 4, 0])]).by_deviation(1e-6)
    assert len(level.mesh.F) == 14 and level.mesh.distance.max() == 0


def test_neighbours_meet_without_a_gap(teapot):
    for asked in (300, 2000):
        level = teapot.by_count(asked)
        assert level.gap == 0 == gap(level.mesh, teapot.surfaces, teapot.known)


def test_neighbours_of_another_speed_have_a_measured_gap():
    """Two sheets over one quarter circle, one with another parameter: their chords differ, and the level says so."""
    P = np.zeros((3, 2, 3))
    P[:, 0], P[:, 1] = [[1, 0, 0], [1, 1, 0], [0, 1, 0]], [[1, 0, 1], [1, 1, 1], [0, 1, 1]]
    knots = [0, 0, 0, 1, 1, 1]
    one = from_points(2, 1, knots, [0, 0, 1, 1], P, [[1, 1], [np.sqrt(0.5)] * 2, [1, 1]])
    # the same arc by the weights 1, sqrt(1/2) r, r^2: a projective change of the parameter
    other = from_points(2, 1, knots, [0, 0, 1, 1], P + [0, 0, 1], [[1, 1], [np.sqrt(0.5) * 1.5] * 2, [2.25, 2.25]])
    both = scene([one, other])
    assert len(both.known.borders) == 0
    level = both.by_deviation(0.01)
    assert 1e-4 < level.gap < 0.02


def test_a_flat_triangle_may_be_one():
    level = scene([triangle([0, 0, 0], [1, 0, 0], [0, 1, 0])]).by_count(1)
    clean(level)
    assert len(level.mesh.F) == 1


def test_same_bytes_twice(teapot):
    a, b = teapot.by_count(777), scene(teapot.surfaces).by_count(777)
    assert a.mesh.V.tobytes() == b.mesh.V.tobytes() and a.mesh.F.tobytes() == b.mesh.F.tobytes()


def test_too_fine_is_refused_before_cutting():
    with pytest.raises(TooFine, match=f"at most {MOST}"):
        scene([sphere()]).by_deviation(1e-9)


def test_coverage_falls_with_the_level_and_ends_near_zero():
    c = screen_coverage([1e-4, 1e-3, 1e-2], 1.0)
    assert c == pytest.approx([(1 / 1.08) ** 2, (1 / 10.8) ** 2, 1e-6])
    assert screen_coverage([0.1], 1.0).tolist() == [0.0]


def test_a_mesh_keeps_its_corners_however_few_triangles_are_asked_for():
    """A cube of twelve triangles, as one mesh of six charts: there is no smaller level of it."""
    mesh = cube_mesh()
    known = tessellate.shapes([mesh], np.ones(1, bool))
    level = Scene([mesh], known).by_count(3)
    assert level.is_smallest and len(level.mesh.F) == 12
    assert level.mesh.distance.max() < 1e-6
