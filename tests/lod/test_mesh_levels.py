"""Levels of meshes: counts and distances as asked, charts and borders in place, nothing torn or turned."""

from dataclasses import replace

import fast_simplification
import numpy as np
import pytest

from lib.lod import carry, collapse, mesh_distance
from lib.lod.levels import Scene
from lib.lod.mesh_distance import Original
from lib.lod.mesh_levels import ALIKE, COARSE, ROUGH, Ladder, MeshLevels, touching
from lib.lod.thinned import Thinned
from lib.nurbs.facets import normals
from lib.report import picture
from lib.report.camera import Camera
from lib.surfaces import mesh_build, tessellate
from lib.surfaces.closed import in_closed_shell
from lib.surfaces.measure import corners, transformed
from lib.visibility import closest
from tests import shapes
from tests.lod.charted_meshes import TURN, sheet, sphere, split
from tests.tolerances import EXACT

LINEAR = 1e-9  # uv after a hundred averages of numbers near 1, divided by the side of a cell
FLOAT32 = 1e-6  # open3d finds the closest triangle in float32


def clean(patch):
    """No flat triangle, unit normals on the side of the facets, uv in the map, every vertex used."""
    N, area = normals(*(patch.S[patch.F[:, k]] for k in range(3)))
    assert area.min() > 0
    assert np.allclose(np.linalg.norm(patch.N, axis=1), 1, atol=EXACT)
    assert np.einsum("nkc,nc->nk", patch.N[patch.F], N).min() >= 0.5 - EXACT
    assert patch.UV.min() >= 0 and patch.UV.max() <= 1
    assert np.array_equal(np.unique(patch.F), np.arange(len(patch.S)))


def plane_of(patch):
    """(x, y) of a sheet's vertices."""
    return (patch.S @ TURN)[:, :2]


@pytest.fixture(scope="module")
def ball():
    return Ladder([sphere(24)])


def test_a_plane_of_two_charts_needs_two_triangles_each():
    (patch,) = Ladder([sheet(16)]).by_count(4)
    clean(patch)
    assert len(patch.F) == 4 and patch.area == pytest.approx(2, rel=EXACT)
    x, y = plane_of(patch).T
    is_right = patch.UV[:, 0] > 0.5
    assert np.allclose(patch.UV[:, 0], 0.4 * x + 0.05 + 0.1 * is_right, atol=LINEAR)
    assert np.allclose(patch.UV[:, 1], 0.8 * y + 0.1, atol=LINEAR)
    assert patch.distance < LINEAR and patch.slide < LINEAR


@pytest.mark.parametrize("count", [900, 300, 60, 12])
def test_borders_and_seams_of_a_plane_stay_where_they_are(count):
    (patch,) = Ladder([sheet(16)]).by_count(count)
    clean(patch)
    assert 0.8 * count <= len(patch.F) <= count
    assert patch.area == pytest.approx(2, rel=EXACT)
    x, y = plane_of(patch).T
    assert np.isclose(x, 1, atol=EXACT).sum() >= 4  # two ends of the seam, in both charts
    is_right = patch.UV[:, 0] > 0.5
    assert np.allclose(patch.UV[:, 0], 0.4 * x + 0.05 + 0.1 * is_right, atol=LINEAR)
    assert patch.slide < LINEAR
    # Each triangle lies in one chart.
    assert (is_right[patch.F] == is_right[patch.F[:, :1]]).all()


@pytest.mark.parametrize("count", [6000, 3456, 700, 140, 60])
def test_a_sphere_stays_closed(ball, count):
    (patch,) = ball.by_count(count)
    clean(patch)
    assert len(patch.F) <= count
    assert in_closed_shell(patch.S, patch.F).all()
    # Six charts meet in eight corners, which stay while there are enough triangles.
    corner = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) / np.sqrt(3)
    near = np.abs(patch.S[:, None] - corner).max(axis=2).min(axis=0)
    assert near.max() < EXACT or count < 100


def test_seams_of_a_sphere_stay_on_the_sides_of_their_charts(ball):
    """The seams are the twelve edges of the cube, x = +-y or the like, and the sides of the charts' rectangles."""
    (patch,) = ball.by_count(700)
    _, place, uses = np.unique(patch.S, axis=0, return_inverse=True, return_counts=True)
    on_seam = uses[place.ravel()] > 1
    low = np.array([[k % 3 / 3 + 0.02, k // 3 / 2 + 0.03] for k in range(6)])
    inside = (patch.UV[:, None] - low) / [0.28, 0.4]
    chart = ((inside > -1e-6) & (inside < 1 + 1e-6)).all(axis=2).argmax(axis=1)
    side = inside[np.arange(len(chart)), chart]
    to_side = np.minimum(side, 1 - side).min(axis=1)
    assert to_side.min() > -EXACT
    assert np.allclose(to_side[on_seam], 0, atol=EXACT) and to_side[~on_seam].min() > 1e-3
    bent = np.abs(np.diff(np.sort(np.abs(patch.S[on_seam]), axis=1)[:, 1:])).max()
    assert bent < 2 * patch.distance


@pytest.mark.parametrize("tolerance", [0.1, 0.03, 0.01, 0.003])
def test_distance_holds_by_closest_points(ball, tolerance):
    """Independent of our samples: many more of them, both ways."""
    (patch,) = ball.by_tolerance(np.array([tolerance]), np.array([8 * tolerance]))
    clean(patch)
    assert patch.distance <= tolerance and patch.slide <= 8 * tolerance
    mesh, rng = ball.meshes[0], np.random.default_rng(5)
    for V, F, W, G in ((mesh.V, mesh.F, patch.S, patch.F), (patch.S, patch.F, mesh.V, mesh.F)):
        weight = rng.dirichlet([0.5] * 3, (100_000 // len(F), len(F)))
        points = np.einsum("rnk,nkc->rnc", weight, V[F]).reshape(-1, 3)
        far = closest.closest(closest.prepare(W, G), points)[0]
        assert far.max() <= 1.1 * tolerance + FLOAT32
    assert patch.square <= patch.distance**2


def two_squares(lifts, sides=(3.0, 1.0)):
    """V, UV, F of squares side by side in z = 0, lifted; their areas are the squares of their sides."""
    V = [[[x, 0, z], [x + a, 0, z], [x + a, a, z], [x, a, z]] for x, a, z in zip((0, 5), sides, lifts, strict=True)]
    F = np.array([[0, 1, 2], [0, 2, 3]])
    return np.array(V, dtype=float).reshape(-1, 3), np.zeros((8, 2)), np.concatenate([F, F + 4])


def test_the_mean_square_is_by_area_and_the_distance_both_ways():
    V, _, F = two_squares((0.0, 0.0))
    original = Original(mesh_build.mesh(V, F)[0])
    found = original.measure(*two_squares((0.0, 0.1)))
    assert found.square == pytest.approx(0.1**2 * 1 / 10) and found.distance == pytest.approx(0.1)
    V, UV, F = two_squares((0.0, 0.0))
    V, UV = np.concatenate([V, V[:3] + [0, 0, 0.2]]), np.zeros((11, 2))  # and a triangle that the original has not
    found = original.measure(V, UV, np.concatenate([F, [[8, 9, 10]]]))
    assert found.square == 0 and found.distance == pytest.approx(0.2)


def test_fewer_triangles_are_farther(ball):
    levels = [ball.by_count(count)[0] for count in (6912, 3000, 1000, 300, 100)]
    assert levels[0].distance == 0 and len(levels[0].F) == 6912
    assert (np.diff([level.square for level in levels]) > 0).all()
    # As good as it can be, about: an even mesh of n triangles is 1 / n times 1.6 off in the mean.
    for level in levels[1:]:
        assert np.sqrt(level.square) < 3 * 1.6 / len(level.F) + 1e-3


def test_no_level_has_more_than_asked_or_less_than_the_smallest(ball):
    (patch,) = ball.by_count(1)
    assert len(patch.F) == ball.smallest
    clean(patch)


def test_meshes_that_touch_do_not_part():
    parts = split(sphere(16), [[0, 1], [2, 3, 4], [5]])
    apart = [transformed(mesh, np.diag([1.0, 1, 1, 1]) + 5 * np.eye(4, k=3)) for mesh in parts[:1]]
    assert [group.tolist() for group in touching(parts + apart)] == [[0, 1, 2], [3]]
    ladder = Ladder(parts)
    for count in (1500, 300, 100):
        patches = ladder.by_count(count)
        V = np.concatenate([patch.S for patch in patches])
        start = np.cumsum([0] + [len(patch.S) for patch in patches])
        F = np.concatenate([patch.F + first for patch, first in zip(patches, start, strict=False)])
        assert len(F) <= count and in_closed_shell(V, F).all()


def test_corners_keep_the_side_of_a_crease():
    """Two planes that meet at a right angle in one chart: normals stay those of the planes."""
    flat = sheet(8, np.eye(3))
    V = flat.V.copy()
    V[:, 2], V[:, 0] = np.maximum(V[:, 0] - 1, 0), np.minimum(V[:, 0], 1)
    folded = type(flat)(V, flat.F, None, None, flat.uv, flat.chart * 0, 6)
    N = normals(*corners(folded))[0]
    folded = type(flat)(V, flat.F, np.repeat(N[:, None], 3, axis=1), None, flat.uv, flat.chart * 0, 6)
    (patch,) = Ladder([folded]).by_count(8)
    clean(patch)
    N = normals(*(patch.S[patch.F[:, k]] for k in range(3)))[0]
    assert np.allclose(patch.N[patch.F], N[:, None], atol=1e-9)
    assert np.allclose(np.abs(N).max(axis=1), 1)


def test_places_are_those_of_the_library():
    """Replayed by hand, against the library's own replay of the same collapses."""
    mesh = sphere(8)
    F = mesh.F.astype(np.int64)
    w = carry.wedges(mesh.V, F, np.zeros(len(F), int), mesh.uv)
    added = collapse.with_added(mesh.V / 2, F, F.ravel()[w.seam], w.seam[:, 0] // 3, np.array([3]))
    pairs = fast_simplification.simplify(added.P, added.T, target_count=1, agg=8.0, return_collapses=True)[2]
    history = collapse.history(mesh.V, F, added, pairs)
    assert len(history.pair) == len(mesh.V) - len({pair[0] for pair in pairs} - {pair[1] for pair in pairs})
    for done in (len(pairs) // 2, len(pairs) * 9 // 10):
        theirs, _, number = fast_simplification.replay_simplification(added.P, added.T, pairs[:done])
        k = len(mesh.V) - len(np.unique(number[: len(mesh.V)]))  # of the mesh's own vertices
        root = history.roots(k)
        ours = history.places(mesh.V, k)[root]
        assert np.allclose(theirs[number[: len(mesh.V)]] / collapse.SCALE * 2, ours, atol=FLOAT32)
        left = root[F]
        left = left[(left != np.roll(left, 1, axis=1)).all(axis=1)]
        assert history.counts()[k] == len(left)


def mixed():
    """A scene of a NURBS sphere of radius 1 and a mesh of one of radius 2, in their frame."""
    surfaces = [shapes.sphere(), transformed(sphere(24), np.diag([2.0, 2, 2, 1]))]
    surfaces = tessellate.into_frame(surfaces, *tessellate.frame(surfaces))
    return Scene(surfaces, tessellate.shapes(surfaces, np.ones(len(surfaces), bool)))


def test_a_tolerance_holds_for_surfaces_of_all_kinds():
    scene = mixed()
    level = scene.by_deviation(0.004)
    assert (level.mesh.distance <= 0.004).all() and np.allclose(np.linalg.norm(level.N, axis=1), 1)
    assert (np.diff(level.mesh.face_start) < 3000).all()


@pytest.mark.parametrize("asked", [2000, 1000, 300])
def test_a_count_is_shared_by_surfaces_of_all_kinds(asked):
    """Triangles go where the distances are: the larger sphere gets more, and both are about as far off."""
    level = mixed().by_count(asked)
    count = np.diff(level.mesh.face_start)
    assert 0.7 * asked <= count.sum() <= asked and not level.is_smallest
    assert count[-1] > count[0]
    assert 1 / 4 < level.mesh.distance[-1] / level.mesh.distance[0] < 4


def test_a_curved_mesh_is_itself_where_nothing_may_move():
    mesh = sphere(8)
    pieces, tiny = MeshLevels([mesh], None), np.array([1e-9])
    assert pieces.n_triangles(tiny, tiny) == 768
    for (patch,) in (pieces.cut_within(tiny, tiny), pieces.cut(tiny, tiny)):
        assert len(patch.F) == 768 and patch.distance == patch.slide == 0
        assert np.array_equal(np.unique(patch.S, axis=0), np.unique(mesh.V, axis=0))


@pytest.mark.parametrize("mesh", [sheet(1), sheet(3)], ids=["one cell", "three cells"])
def test_a_mesh_never_vanishes(mesh):
    (patch,) = Ladder([mesh]).by_count(1)
    clean(patch)
    assert 1 <= len(patch.F) <= 4


def test_a_small_mesh_does_not_hold_up_the_one_it_touches():
    """One triangle of a sphere is a mesh of its own: it stays, and the rest is thinned all the same."""
    whole = sphere(16)
    own = np.arange(len(whole.F)) == 5
    chart = np.where(own, 6, whole.chart)
    small, rest = split(replace(whole, chart=chart), [[6], range(6)])
    ladder = Ladder([small, rest])
    patches = ladder.by_count(100)
    assert sum(len(patch.F) for patch in patches) <= 100 and len(patches[0].F) == 1
    assert ladder.predicted(np.full(2, 0.5), np.full(2, 4.0))[0] == 1


@pytest.mark.parametrize("count", [6912, 3456, 700, 140])
def test_a_picture_shows_the_texture_where_it_was(ball, count):
    """The map holds the place of each of its texels; every ray must see its own place, to the slide."""
    (patch,) = ball.by_count(count)
    side = 256
    uv = np.stack(np.meshgrid(*2 * [(np.arange(side) + 0.5) / side]), axis=2).reshape(-1, 2)
    rgb = Original(ball.meshes[0]).at(uv).reshape(side, side, 3).astype(np.float32)
    model = picture.join([picture.Part(patch.S, patch.F, ST=patch.UV, texture=0)])
    origin, direction = Camera((3.0, 2.0, 1.0), (0.0, 0.0, 0.0), 45.0).rays(120, 120)
    t, face, weight = picture.first_visible(model, origin, direction)
    hit = face >= 0
    seen = picture.shade(model, [picture.Texture(rgb, ("clamp", "clamp"))], face, weight)[hit]
    off = np.linalg.norm(seen - (origin + t[:, None] * direction)[hit], axis=1)
    cell = np.pi / 2 / (0.28 * side)  # of the map, on the sphere
    assert 0.2 < hit.mean() < 0.8
    assert off.max() <= 1.1 * patch.slide + cell and np.sqrt((off**2).mean()) <= patch.slide / 2 + cell / 2


def test_the_same_mesh_gives_the_same_levels():
    first, second = (Ladder([sphere(12)]).by_count(200)[0] for _ in range(2))
    assert all(np.array_equal(getattr(first, name), getattr(second, name)) for name in ("S", "UV", "F", "N"))


def test_measured_levels_lie_close_together_where_tolerances_do():
    """Down to levels too coarse to ask for, none has many more triangles than the next, if that is farther off."""
    ball = Ladder([sphere(24)])
    known = ball.known([0])
    distance, _, slide, _ = known.measured[:, 0].T
    counts = ball.counts[known.steps]
    wanted = (distance[:-1] < COARSE) & ((distance[1:] > ALIKE * distance[:-1]) | (slide[1:] > ALIKE * slide[:-1]))
    assert wanted.sum() >= 4 and (counts[:-1] <= ROUGH * counts[1:] + 2)[wanted].all()
    assert counts[0] == 6912 and counts[-1] == ball.smallest


@pytest.mark.parametrize("tolerance", [0.3, 0.02, 0.004])
def test_what_is_known_spares_measuring(ball, tolerance, monkeypatch):
    limits = np.array([tolerance]), np.array([8 * tolerance])
    (made,) = ball.by_tolerance(*limits)
    again = Ladder(ball.meshes, ball.known([0]))
    assert again.counts_within(*limits) == len(made.F) == ball.counts_within(*limits)
    monkeypatch.setattr(mesh_distance.Original, "measure", None)  # nothing is measured
    (read,) = again.by_tolerance(*limits)
    assert all(np.array_equal(getattr(made, name), getattr(read, name)) for name in vars(made) if name != "side")


@pytest.mark.parametrize("count", [6000, 1500])
def test_what_both_meshes_have_is_off_by_nothing(ball, count, monkeypatch):
    """Distances are those of a search for every place."""
    (patch,) = ball.by_count(count)
    original = Original(ball.meshes[0])
    quick = original.measure(patch.S, patch.UV, patch.F)
    searched = []
    far = mesh_distance._far
    monkeypatch.setattr(mesh_distance, "_far", lambda *args: searched.append(len((found := far(*args))[0])) or found)
    original.measure(patch.S, patch.UV, patch.F)
    few = sum(searched)
    monkeypatch.setattr(mesh_distance.Rows, "holds", lambda self, rows: np.zeros(len(rows), bool))
    full = original.measure(patch.S, patch.UV, patch.F)
    assert sum(searched) - few > few
    for name in ("distance", "square", "slide"):
        assert getattr(quick, name) == pytest.approx(getattr(full, name), abs=1e-12)


def test_counts_within_are_those_of_the_level():
    """Of surfaces of all kinds: a share of the first level is a share of what it has."""
    for tolerance in (0.02, 0.004):
        level = mixed().by_deviation(tolerance)
        assert mixed().n_within(tolerance) == len(level.mesh.F)


def test_triangles_that_a_collapse_leaves_without_an_area_go(monkeypatch):
    """The library may put two corners of a triangle in one place: it goes, and no normal is without a direction."""
    thin = Thinned([sheet(8)])
    k = thin.step(40)
    root = thin.history.roots(k)
    F = root[thin.F[thin.history.death >= k]]

    def placed(*_):
        X = thin.history.places(thin.V, k)
        a, c = F[0, [0, 2]]
        X[c] = X[a]
        return X

    monkeypatch.setattr(thin, "_placed", placed)
    (patch,) = thin.patches(k)
    assert 0 < len(patch.F) < len(F)
    assert normals(*(patch.S[patch.F[:, k]] for k in range(3)))[1].min() > 0
    assert np.linalg.norm(patch.N, axis=1) == pytest.approx(1)
