"""Trimmed surfaces cut into triangles: nothing in holes, edges shared bit for bit, close at every tolerance."""

from dataclasses import replace

import numpy as np
import pytest

from lib.lod.levels import Scene
from lib.nurbs import evaluate
from lib.nurbs.surface import bezier
from lib.surfaces import measure, tessellate
from lib.surfaces.closed import in_closed_shell
from lib.surfaces.gaps import gap
from lib.surfaces.loops import inside
from lib.surfaces.mesh import Mesh
from lib.surfaces.trim_cut import TrimmedPieces
from lib.surfaces.trim_flat import without_flat
from lib.surfaces.trim_flip import flipped
from lib.surfaces.trim_mesh import domain_triangles
from tests.shapes import box, extruded, rectangle, sphere
from tests.surfaces.trimmed_shapes import (
    SQUARE,
    back,
    can,
    circle,
    cut_out,
    edge,
    face,
    octant,
    seen,
)

TOLERANCES = [0.3, 0.1, 0.01, 1e-3]


def scene(surfaces):
    return Scene(surfaces, tessellate.shapes(surfaces, np.ones(len(surfaces), bool)))


def level(surfaces, tolerance):
    return scene(surfaces).by_deviation(tolerance)


def cross(V, F):
    A, B, C = (V[F[:, k]] for k in range(3))
    return np.cross(B - A, C - A)


def sound(found):
    """No flat triangle, unit normals on the side of the facets, parameters in [0, 1], every distance kept."""
    mesh = found.mesh
    normal = cross(mesh.V, mesh.F)
    assert (np.linalg.norm(normal, axis=1) > 0).all()
    assert np.allclose(np.linalg.norm(found.N, axis=1), 1, atol=1e-12)
    assert (np.einsum("kc,kc->k", normal, found.N[mesh.F].sum(axis=1)) > 0).all()
    assert mesh.UV.min() >= 0 and mesh.UV.max() <= 1
    assert mesh.distance.max() <= found.tolerance * (1 + 1e-9)


def plate(n=400):
    return cut_out(rectangle([0, 0, 0], [2, 0, 0], [0, 2, 0]), [SQUARE, circle((0.5, 0.5), 0.25, n, True)])


def test_domain_triangles_cover_the_plate_and_not_its_hole():
    trim = plate()
    uv, F = domain_triangles(trim)
    A, B, C = (uv[F[:, k]] for k in range(3))
    area = ((B - A)[:, 0] * (C - A)[:, 1] - (B - A)[:, 1] * (C - A)[:, 0]) / 2
    assert area.min() > 0 and area.sum() == pytest.approx(measure.area(trim) / 4, rel=1e-12)
    assert len(F) == 404 + 2 * 1 - 2 and inside(trim, uv[F].mean(axis=1)).all()


def test_domain_triangles_of_loops_that_cross_do_not_fail():
    eight = np.array([[0, 0], [1, 1], [1, 0], [0, 1.0]])
    uv, F = domain_triangles(cut_out(rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), [eight]))
    assert len(uv) == 5 and uv[4] == pytest.approx([0.5, 0.5]) and len(F) == 2


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_plate_with_a_hole(tolerance):
    """The hole's polygon: inscribed, so the metal is too large by at most the ring of the tolerance."""
    found = level([plate()], tolerance)
    sound(found)
    mesh = found.mesh
    rim = np.linalg.norm(mesh.V[:, :2] - 1, axis=1)
    kept = np.isclose(rim, 0.5, atol=1e-12).sum()
    assert kept >= 4 and len(mesh.V) == kept + 4 and len(mesh.F) == kept + 4
    middle = np.linalg.norm(mesh.V[mesh.F].mean(axis=1)[:, :2] - 1, axis=1)
    assert middle.min() > 0.5 * np.cos(np.pi / kept)
    area = np.linalg.norm(cross(mesh.V, mesh.F), axis=1).sum() / 2
    assert 0 <= area - (4 - np.pi / 4) <= np.pi * tolerance + 1e-4
    rim = mesh.V[np.isclose(rim, 0.5, atol=1e-12), :2] - 1
    angle = np.sort(np.arctan2(rim[:, 1], rim[:, 0]))
    chord = 0.5 * (1 - np.cos(np.diff(np.append(angle, angle[0] + 2 * np.pi)).max() / 2))
    assert chord <= min(tolerance, 0.15) + 1e-4


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_a_can_is_closed_at_every_tolerance(tolerance):
    found = level(can(), tolerance)
    sound(found)
    mesh = found.mesh
    assert in_closed_shell(mesh.V, mesh.F).all() and found.gap == 0
    volume = np.einsum("kc,kc->", mesh.V[mesh.F[:, 0]], np.cross(mesh.V[mesh.F[:, 1]], mesh.V[mesh.F[:, 2]])) / 6
    assert np.pi * (1 - 3 * min(tolerance, 0.3)) < volume < np.pi
    # the rim of the lid and that of the wall: the same points bit for bit
    wall, lid = (mesh.V[mesh.vertex_start[s] : mesh.vertex_start[s + 1]] for s in (0, 1))
    assert {tuple(x) for x in wall[wall[:, 2] == 1]} == {tuple(x) for x in lid}


@pytest.mark.parametrize("fine", [0, 1])
def test_a_can_keeps_the_same_points_when_only_one_face_asks_for_them(fine):
    surfaces = can()
    known = tessellate.shapes(surfaces, np.ones(3, bool))
    tolerance = np.full(3, 0.1)
    tolerance[fine] = 1e-3
    patches = tessellate.Pieces(surfaces, known).cut_within(tolerance, np.ones(3))
    mesh = tessellate.assemble(patches, surfaces, known)
    assert in_closed_shell(mesh.V, mesh.F).all()
    assert len(patches[1].F) > 60 and (len(patches[2].F) > 60) == (fine == 0)


def test_an_arc_stays_an_arc_at_any_tolerance():
    """Square with one corner rounded off: of the quarter circle at least one point is kept, a half circle keeps two."""
    base = rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0])
    t = np.linspace(0, np.pi / 2, 99)
    arc = edge(base, np.stack([np.cos(t), np.sin(t)], axis=1))
    found = level([face(base, [edge(base, [[0, 0], [1, 0]]), arc, edge(base, [[0, 1], [0, 0]])])], 5.0)
    assert len(found.mesh.V) == 4


def test_a_loop_keeps_most_of_its_area():
    """A leaf of two flat arcs and a stalk of 0.01: the corners alone are a triangle of next to nothing."""
    base = rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0])
    t = np.linspace(0, 1, 200)
    low = edge(base, np.stack([0.1 + 0.8 * t, 0.5 - 0.4 * t * (1 - t)], axis=1))
    high = edge(base, np.stack([0.9 - 0.8 * t, 0.51 - 0.01 * t + 0.4 * t * (1 - t)], axis=1))
    leaf = face(base, [low, edge(base, [[0.9, 0.5], [0.9, 0.51]]), high])
    found = level([leaf], 5.0)
    assert np.linalg.norm(cross(found.mesh.V, found.mesh.F), axis=1).sum() / 2 > 0.3 * measure.area(leaf)


@pytest.mark.parametrize("tolerance", [0.05, 0.01, 1e-3])
def test_round_piece_of_a_sphere(tolerance):
    """Its border runs across the lines, so that triangles there are larger than the cells: points go between."""
    found = level([cut_out(sphere(), [circle((0.4, 0.45), 0.3, 900)])], tolerance)
    sound(found)
    mesh = found.mesh
    a, b = np.random.default_rng(1).random((2, 64, 1, 1))
    a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
    A, B, C = (mesh.V[mesh.F[:, k]] for k in range(3))
    assert 1 - np.linalg.norm(A + a * (B - A) + b * (C - A), axis=2).min() <= tolerance * 1.01  # found at samples


def test_an_edge_that_says_too_little_gets_more_points():
    """Significances ten times too small: the wall is measured all the same, and its edges kept closer."""
    surfaces = [replace(s, significance=s.significance / 10) for s in can()]
    found = level(surfaces, 0.01)
    assert found.mesh.distance[0] <= 0.01 and in_closed_shell(found.mesh.V, found.mesh.F).all()


def test_a_crack_is_measured():
    """The lid's rim moved away by a hundredth of the tolerance is no longer the wall's: an open can, a gap."""
    surfaces = can()
    lid = surfaces[1]
    lid.S[:, 2] += 1e-6
    found = level(surfaces, 0.01)
    assert found.gap == pytest.approx(1e-6, rel=1e-6)
    assert not in_closed_shell(found.mesh.V, found.mesh.F).any()


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_sphere_octant_in_closed_form(tolerance):
    trim = octant()
    assert measure.area(trim) == pytest.approx(np.pi / 2, rel=1e-6)
    found = level([trim], tolerance)
    sound(found)
    mesh = found.mesh
    assert np.linalg.norm(mesh.V, axis=1) == pytest.approx(1, abs=1e-12)
    assert found.N == pytest.approx(mesh.V, abs=1e-5)  # at the pole the limit from inside
    a, b = np.random.default_rng(1).random((2, 64, 1, 1))
    a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
    A, B, C = (mesh.V[mesh.F[:, k]] for k in range(3))
    assert 1 - np.linalg.norm(A + a * (B - A) + b * (C - A), axis=2).min() <= tolerance
    # the pole is one place, with a vertex for each triangle that ends there
    at_pole = (mesh.UV[:, 1] == 1)[mesh.F]
    assert set(at_pole.sum(axis=1)) <= {0, 1}
    fan = at_pole.any(axis=1)
    u = mesh.UV[mesh.F[fan], 0]
    pole, rest = u[at_pole[fan]], u[~at_pole[fan]].reshape(-1, 2)
    assert (pole > rest.min(axis=1)).all() and (pole < rest.max(axis=1)).all()


def wavy(n=400):
    """Two sheets on either side of a wave, the upper one with a slot whose lower rim follows the wave closely."""
    high, low = rectangle([0, 0, 0], [2, 0, 0], [0, 1, 0]), rectangle([0, -1, 0], [2, 0, 0], [0, 2, 0])
    t = np.linspace(0, 1, n)
    wave = 0.3 + 0.2 * np.sin(4 * np.pi * t)
    common = edge(high, np.stack([t, wave], axis=1))
    sides = [edge(high, x) for x in ([[1, wave[-1]], [1, 1]], [[1, 1], [0, 1]], [[0, 1], [0, 0.3]])]
    x, y = 0.1 + 0.8 * t, 0.32 + 0.2 * np.sin(4 * np.pi * (0.1 + 0.8 * t))
    slot = [np.stack([x, y], axis=1), [[0.9, y[-1]], [0.9, 0.9]], [[0.9, 0.9], [0.1, 0.9]], [[0.1, 0.9], [0.1, y[0]]]]
    upper = face(high, [common, *sides], [back(edge(high, uv)) for uv in slot[::-1]])
    rim = seen(common, np.stack([t, (1 + wave) / 2], axis=1))
    assert np.allclose(evaluate.point(low, *rim[0].T), rim[1], atol=1e-12)
    sides = [edge(low, x) for x in ([[0, 0.65], [0, 0]], [[0, 0], [1, 0]], [[1, 0], [1, 0.65]])]
    sides[0][1][0] = rim[1][0]
    return upper, face(low, [back(rim), *sides])


@pytest.mark.parametrize("tolerance", [1.0, 0.3, 0.1, 0.03, 0.01])
def test_loops_that_would_cross_get_more_points_on_both_sides(tolerance):
    """The slot stays 0.02 v from the wave: chords of either would cut through the other's at coarse tolerances."""
    upper, lower = wavy()
    found = level([upper, lower], tolerance)
    sound(found)
    mesh = found.mesh
    own = [mesh.V[mesh.vertex_start[s] : mesh.vertex_start[s + 1]] for s in (0, 1)]
    common = {tuple(x) for x in upper.S[:399]}
    assert {tuple(x) for x in own[0]} & common == {tuple(x) for x in own[1]} & common
    area = np.linalg.norm(cross(mesh.V, mesh.F), axis=1) / 2
    assert area[: mesh.face_start[1]].sum() == pytest.approx(measure.area(upper), rel=0.1)
    assert found.gap == 0 and (cross(mesh.V, mesh.F)[:, 2] > 0).all()


def test_corners_along_a_straight_edge_leave_no_crack():
    """A cube whose faces all have a corner in the middle of each edge: flat triangles must not be left out."""
    surfaces = []
    for base in box():
        corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
        uv = np.concatenate([[a, a + (b - a) * 0.5] for a, b in zip(corner, np.roll(corner, -1, axis=0), strict=True)])
        surfaces.append(cut_out(base, [uv], significances=[np.full(8, np.inf)]))
    found = level(surfaces, 0.01)
    sound(found)
    assert in_closed_shell(found.mesh.V, found.mesh.F).all() and len(found.mesh.F) == 6 * 6


def test_a_crease_is_an_edge():
    """An L of two walls, a window in each so near to the bend that the shortest edges would run across it."""
    bent = extruded([[0, 0], [1, 0], [1, 1]], 1.0, knots=[0, 0, 0.5, 1, 1])
    outline = np.array([[0, 0], [0.5, 0], [1, 0], [1, 1], [0.5, 1], [0, 1]])
    windows = [circle((0.26, 0.5), 0.235, 200, True), circle((0.74, 0.42), 0.23, 200, True)]
    kept = [np.full(6, np.inf), *2 * [np.where(np.arange(200) % 10 == 0, np.inf, 0.0)]]
    mesh = level([cut_out(bent, [outline, *windows], significances=kept)], 0.02).mesh
    on = [np.isclose(mesh.V[mesh.F][..., 1], 0).all(axis=1), np.isclose(mesh.V[mesh.F][..., 0], 1).all(axis=1)]
    assert (on[0] | on[1]).all() and mesh.distance[0] <= 0.02


@pytest.mark.parametrize("sign", [1, -1])
def test_the_diagonal_follows_the_saddle(sign):
    """(x + y)^2 is straight along x + y = 1, (x - y)^2 along x = y; a diagonal that is fixed stays."""
    x, square = np.array([0, 0.5, 1]), np.array([0.0, 0.0, 1.0])  # control values of t and t^2
    P = np.stack(np.broadcast_arrays(x[:, None], x, square[:, None] + square + 2 * sign * np.outer(x, x)), axis=-1)
    rising, failing = np.array([[0, 1, 2], [0, 2, 3]]), np.array([True, False])
    S = evaluate.point(bezier(P), *SQUARE.T)
    around = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    found = flipped(bezier(P), S, SQUARE, rising, failing, around)
    both = set(found[0]) & set(found[1])
    assert both == ({1, 3} if sign == 1 else {0, 2}) and (cross(S, found)[:, 2] > 0).all()
    fixed = np.concatenate([around, [[0, 2]]])
    assert np.array_equal(flipped(bezier(P), S, SQUARE, rising, failing, fixed), rising)


def test_flat_triangles_are_flipped_not_left_out():
    """Corner 1 lies on the line from 0 to 2, by rounding just below it; 3 is above."""
    S = np.array([[0, 0, 0], [1, -1e-16, 0], [2, 0, 0], [1, 1, 0], [2, 0, 0]])
    around = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    F = without_flat(S, np.array([[0, 1, 2], [0, 2, 3], [2, 4, 3]]), around)
    turned = {tuple(np.roll(t, -np.argmin(t))) for t in F.tolist()}
    assert turned == {(0, 1, 3), (1, 2, 3)}  # and the triangle of a pole, 2 and 4 in one place, is gone
    kept = without_flat(S, np.array([[0, 1, 2], [0, 2, 3]]), np.array([[0, 2]]))
    assert kept.tolist() == [[0, 1, 2], [0, 2, 3]]  # the long edge has to stay


@pytest.mark.parametrize("asked", [2000, 300, 90])
def test_counts_are_not_exceeded(asked):
    moved = [np.diag([0.5, 0.5, 0.5, 1]) for _ in range(2)]
    moved[0][0, 3], moved[1][1, 3] = 3, 3
    ball, part = (measure.transformed(s, M) for s, M in zip((sphere(), octant()), moved, strict=True))
    found = scene([*can(), ball, part, *box(), plate()]).by_count(asked)
    assert 0.7 * asked <= len(found.mesh.F) <= asked and not found.is_smallest
    assert in_closed_shell(found.mesh.V, found.mesh.F[: found.mesh.face_start[4]]).all()


def test_counts_are_not_exceeded_where_less_was_predicted(monkeypatch):
    truth = TrimmedPieces.n_triangles
    monkeypatch.setattr(TrimmedPieces, "n_triangles", lambda self, *of: (0.6 * truth(self, *of)).astype(np.int64))
    found = scene([*can(), plate()]).by_count(300)
    assert 150 <= len(found.mesh.F) <= 300


def test_fewer_than_there_can_be_is_said():
    found = scene(can()).by_count(3)
    assert found.is_smallest and in_closed_shell(found.mesh.V, found.mesh.F).all() and len(found.mesh.F) < 40


def test_a_plain_neighbour_has_a_measured_gap():
    """A quarter of a disc standing on a rectangle's curved neighbour: one edge cut by each in its own way."""
    t = np.linspace(0, 1, 200)
    arc = np.stack([np.cos(t * np.pi / 2), np.sin(t * np.pi / 2)], axis=1)
    sheet = extruded(arc, 1.0, degree=3)
    flat = rectangle([0, 0, 0], [1.5, 0, 0], [0, 1.5, 0])
    rim = evaluate.point(sheet, t, 0 * t)
    uses = [(np.clip(rim[:, :2] / 1.5, 0, 1), rim, edge(flat, rim[:, :2] / 1.5)[2])]
    uses += [edge(flat, [[0, rim[-1, 1] / 1.5], [0, 0]]), edge(flat, [[0, 0], [rim[0, 0] / 1.5, 0]])]
    surfaces = [sheet, face(flat, uses)]
    whole = scene(surfaces)
    found = whole.by_deviation(0.01)
    assert found.mesh.side[1][0].size != found.mesh.side[0][2].size
    assert 1e-4 < found.gap < 0.02 and found.gap == gap(found.mesh, surfaces, whole.known)


def test_a_mesh_is_one_of_the_kinds():
    V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    F = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    up = np.tile([0, 0, 1.0], (2, 3, 1))
    surfaces = [*box(), Mesh(V, F, up, uv=V[F][..., :2] / 2), plate()]
    known = tessellate.shapes(surfaces, np.ones(8, bool))
    assert known.borders[:, [0, 2]].max() < 6 and known.shell.tolist() == [0] * 6 + [-1, -1]
    pieces = tessellate.Pieces(surfaces, known)
    patches = pieces.cut_within(np.full(8, 0.1), np.ones(8))
    mesh = tessellate.assemble(patches, surfaces, known)
    own = mesh.F[mesh.face_start[6] : mesh.face_start[7]]
    assert np.array_equal(mesh.V[own], V[F]) and np.array_equal(mesh.UV[own], V[F][..., :2] / 2)
    assert mesh.distance[6] == 0 and pieces.normals(6, patches[6]).tolist() == [[0, 0, 1]] * 4


def test_same_bytes_twice_and_in_any_order():
    a, b = level(can(), 0.01), level(can()[::-1], 0.01)
    again = level(can(), 0.01)
    assert a.mesh.V.tobytes() == again.mesh.V.tobytes() and a.mesh.F.tobytes() == again.mesh.F.tobytes()
    assert {tuple(x) for x in a.mesh.V} == {tuple(x) for x in b.mesh.V}


def test_seams_of_a_closed_surface_are_welded():
    found = level(can()[:1], 0.01)
    mesh = found.mesh
    left, right = (mesh.V[mesh.UV[:, 0] == u] for u in (0, 1))
    assert np.array_equal(left[np.argsort(left[:, 2])], right[np.argsort(right[:, 2])]) and len(left) >= 2
