"""The mesh of a scene: closed where the surfaces are, close to them, right at poles, seams and creases."""

import numpy as np
import pytest

from lib.nurbs import evaluate, facets, lines
from lib.nurbs.surface import NurbsSurface, bezier, from_points
from lib.surfaces import tessellate
from tests.shapes import box, cylinder, disc, extruded, rectangle, revolved, sphere, triangle


def mesh_of(surfaces, tolerance, slide=1.0):
    known = tessellate.shapes(surfaces, np.ones(len(surfaces), bool))
    pieces = tessellate.Pieces(surfaces, known)
    n = len(surfaces)
    patches = pieces.cut_within(np.full(n, tolerance), np.full(n, slide))
    return tessellate.assemble(patches, surfaces, known), known


def edge_uses(mesh):
    """How often every edge is used, after welding vertices of equal position."""
    _, place = np.unique(mesh.V, axis=0, return_inverse=True)
    F = place[mesh.F]
    edges = np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1)
    return np.unique(edges, axis=0, return_counts=True)[1]


def face_normals(mesh):
    A, B, C = (mesh.V[mesh.F[:, k]] for k in range(3))
    return np.cross(B - A, C - A)


def volume(mesh):
    A, B, C = (mesh.V[mesh.F[:, k]] for k in range(3))
    return np.einsum("kc,kc->", A, np.cross(B, C)) / 6


@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.001])
def test_sphere_keeps_the_tolerance_and_its_volume(tolerance):
    mesh, _ = mesh_of([sphere()], tolerance)
    assert mesh.distance[0] <= tolerance
    # the farthest point of a facet from the sphere, in closed form: facet points lie at their distance from the centre
    a, b = np.random.default_rng(1).random((2, 64, 1, 1))
    a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
    A, B, C = (mesh.V[mesh.F[:, k]] for k in range(3))
    inside = 1 - np.linalg.norm(A + a * (B - A) + b * (C - A), axis=2)
    assert -1e-12 < inside.min() and inside.max() <= mesh.distance[0] * (1 + 1e-9)
    assert 4 / 3 * np.pi * (1 - 4 * tolerance) < volume(mesh) < 4 / 3 * np.pi


def test_sphere_is_watertight_and_faces_outwards():
    mesh, known = mesh_of([sphere()], 0.01)
    assert (edge_uses(mesh) == 2).all()
    assert known.is_closed.tolist() == [[True, False]] and known.is_collapsed.tolist() == [[False, False, True, True]]
    assert known.shell.tolist() == [0]
    centroid = mesh.V[mesh.F].mean(axis=1)
    assert (np.einsum("kc,kc->k", face_normals(mesh), centroid) > 0).all()


def test_seam_columns_are_equal_bit_by_bit_with_their_own_parameters():
    mesh, _ = mesh_of([sphere()], 0.01)
    first, last = mesh.side[0][0], mesh.side[0][1]
    assert np.array_equal(mesh.V[first], mesh.V[last])
    assert (mesh.UV[first[1:-1], 0] == 0).all() and (mesh.UV[last[1:-1], 0] == 1).all()


def test_pole_triangles_have_their_own_vertex_in_the_middle():
    mesh, _ = mesh_of([sphere()], 0.01)
    for v in (0.0, 1.0):
        at_pole = mesh.UV[:, 1] == v
        fan = mesh.F[at_pole[mesh.F].any(axis=1)]
        assert (at_pole[fan].sum(axis=1) == 1).all()
        u = mesh.UV[fan, 0]
        pole = at_pole[fan]
        rest = u[~pole].reshape(-1, 2)
        assert np.allclose(u[pole], rest.mean(axis=1), atol=1e-15)
        assert len(np.unique(mesh.V[fan[pole]], axis=0)) == 1


def test_cube_is_a_shell_of_twelve_triangles():
    mesh, known = mesh_of(box(), 0.001)
    assert len(mesh.F) == 12 and (edge_uses(mesh) == 2).all()
    assert (known.shell == 0).all() and len(known.borders) == 12
    assert volume(mesh) == pytest.approx(1, abs=1e-15)


def test_a_cube_without_its_lid_is_no_shell():
    _, known = mesh_of(box()[:5], 0.001)
    assert (known.shell == -1).all()


def test_neighbours_share_lines_whichever_way_they_run():
    """Two quarter-circle sheets joined along a curved side, one turned round: every inner edge is used twice."""
    P = np.zeros((3, 2, 3))
    P[:, 0], P[:, 1] = [[1, 0, 0], [1, 1, 0], [0, 1, 0]], [[1, 0, 1], [1, 1, 1], [0, 1, 1]]
    w = np.array([[1, 1], [np.sqrt(0.5)] * 2, [1, 1]])
    above = P + [0, 0, 1]
    above[:, 1] += [[0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]]
    knots = [0, 0, 0, 1, 1, 1]
    plain = from_points(2, 1, knots, [0, 0, 1, 1], P, w)
    turned = from_points(1, 2, [0, 0, 1, 1], knots, above[::-1].transpose(1, 0, 2), w[::-1].T)
    mesh, known = mesh_of([plain, turned], 1e-3)
    assert known.borders.tolist() == [[0, 3, 1, 0, 1]]
    own, other = mesh.side[0][3], mesh.side[1][0]
    assert len(own) > 10 and np.array_equal(mesh.V[own], mesh.V[other[::-1]])


@pytest.mark.parametrize(
    "surface", [rectangle([0, 0, 0], [3, 0, 1], [0, 2, 0]), rectangle([0, 0, 0], [1e-6, 0, 0], [0, 1, 0])]
)
def test_parallelograms_take_two_triangles(surface):
    mesh, known = mesh_of([surface], 1e-3, slide=1e-9)
    assert len(mesh.F) == 2 and known.is_planar.all() and mesh.distance[0] < 1e-15


def test_flat_triangle_slides_as_little_as_asked():
    one = triangle([0, 0, 0], [1, 0, 0], [0.3, 0.8, 0])
    coarse, _ = mesh_of([one], 1e-3, slide=1.0)
    fine, _ = mesh_of([one], 1e-3, slide=0.01)
    assert len(coarse.F) == 1
    assert fine.slide[0] <= 0.0101 and len(fine.F) < 100 and fine.distance[0] < 1e-15
    assert face_normals(fine)[:, 2].min() > 0
    assert np.linalg.norm(face_normals(fine), axis=1).sum() / 2 == pytest.approx(0.4, abs=1e-12)


def test_flat_disc_keeps_its_outline():
    mesh, known = mesh_of([disc()], 1e-3)
    assert known.is_planar.all() and mesh.distance[0] <= 1e-3
    rim = mesh.V[mesh.side[0][3]]
    middle = np.linalg.norm((rim[1:] + rim[:-1]) / 2, axis=1)
    assert 1 - middle.min() <= 1e-3 and 1 - middle.min() == pytest.approx(mesh.distance[0], rel=0.05)


def test_a_kink_gets_a_line():
    """An L of two walls in one surface of degree 1, its corner at u = 0.3: exact with two cells."""
    surface = extruded([[0, 0], [1, 0], [1, 2]], 1.0, knots=[0, 0, 0.3, 1, 1])
    mesh, _ = mesh_of([surface], 1e-4)
    assert sorted(set(mesh.UV[:, 0])) == [0, 0.3, 1]
    assert len(mesh.F) == 4 and mesh.distance[0] < 1e-15


def test_uneven_speed_moves_the_lines():
    """A quarter circle with a cubed parameter: lines crowd where the curve is, and the tolerance holds."""
    angle = np.linspace(0, 1, 33) ** 3 * np.pi / 2
    surface = extruded(np.stack([np.cos(angle), np.sin(angle)], axis=1), 1.0, degree=3)
    mesh, _ = mesh_of([surface], 1e-3)
    u = np.unique(mesh.UV[:, 0])
    assert mesh.distance[0] <= 1e-3 and np.diff(u)[0] > 2 * np.diff(u)[-1]


def test_waves_between_the_ends_are_seen():
    x = np.linspace(0, 1, 41)
    surface = extruded(np.stack([x, 0.05 * np.sin(8 * np.pi * x)], axis=1), 1.0, degree=3)
    mesh, _ = mesh_of([surface], 1e-3)
    S = evaluate.point(surface, np.linspace(0, 1, 999), np.zeros(999))
    u, first = np.unique(mesh.UV[:, 0], return_index=True)
    chord = np.stack([np.interp(S[:, 0], mesh.V[first, 0], mesh.V[first, k]) for k in range(2)], axis=1)
    assert np.abs(chord - S[:, :2]).max() < 4e-3 and len(u) > 30


def inserted(surface):
    """The same shape with the knots u = 0.5 inserted and degree v left: by Boehm's algorithm on the homogeneous net."""
    p, U, P = surface.degree_u, surface.knots_u, surface.Pw
    k = int(np.searchsorted(U, 0.4, side="right")) - 1
    Q = np.empty((len(P) + 1, *P.shape[1:]))
    for i in range(len(Q)):
        if i <= k - p:
            Q[i] = P[i]
        elif i > k:
            Q[i] = P[i - 1]
        else:
            a = (0.4 - U[i]) / (U[i + p] - U[i])
            Q[i] = a * P[i] + (1 - a) * P[i - 1]
    return NurbsSurface(p, surface.degree_v, np.insert(U, k + 1, 0.4) * 7 + 3, surface.knots_v, Q * 5)


def test_lines_follow_the_shape_not_the_knots():
    one = sphere()
    known = tessellate.shapes([one], [True])
    demands = [lines.demand(s, known.is_closed[0], known.is_collapsed[0]) for s in (one, inserted(inserted(one)))]
    placed = []
    for d in demands:
        p = lines.plan([d], lines.links(1, np.empty((0, 5), int)))
        both = np.array([[1e-3, 1.0]])
        placed.append(lines.place(p, both, lines.steps(p, both))[0])
    for a, b in zip(*placed, strict=True):
        assert np.allclose(a, b, rtol=0, atol=1e-7)


def test_scale_and_place_of_the_world_do_not_matter():
    def scene(scale, move):
        return [revolved(scale * np.array([[0.2, 0], [1, 0.3], [0.5, 1]]), [1, 1, 1], 2, [0, 0, 0, 1, 1, 1])], move

    counts = []
    for scale, move in ((1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e5)):
        [surface], move = scene(scale, move)
        P = surface.Pw.copy()
        P[..., :3] += move * P[..., 3:]
        surface = NurbsSurface(2, 2, surface.knots_u, surface.knots_v, P)
        centre, size = tessellate.frame([surface])
        mesh, _ = mesh_of(tessellate.into_frame([surface], centre, size), 1e-3)
        counts.append(len(mesh.F))
        assert np.abs(mesh.V).max() == pytest.approx(0.5, abs=1e-3)
    assert len(set(counts)) == 1


def test_cylinder_seam_is_closed_and_its_rims_open():
    mesh, known = mesh_of([cylinder()], 0.01)
    uses = edge_uses(mesh)
    n = len(mesh.side[0][2]) - 1
    assert (uses == 1).sum() == 2 * n and (uses <= 2).all() and known.shell.tolist() == [-1]


def test_a_surface_closed_both_ways_is_watertight():
    ring = revolved([[2, 0], [2.8, 0.4], [2, 0.8], [1.2, 0.4], [2, 0]], np.ones(5), 1, [0, 0, 0.25, 0.5, 0.75, 1, 1])
    mesh, known = mesh_of([ring], 0.01)
    assert known.is_closed.all() and known.shell.tolist() == [0] and (edge_uses(mesh) == 2).all()


def test_opposite_corner_poles_leave_no_flat_triangle():
    """A leaf: side u=0 and side v=0 are the same point."""
    P = np.zeros((4, 4, 3))
    for i in range(4):
        for j in range(4):
            P[i, j] = [i * j / 9, j * i * (3 - i) / 20, i * j * (j - i) / 30]
    mesh, known = mesh_of([bezier(P)], 1e-3)
    assert known.is_collapsed.tolist() == [[True, False, True, False]]
    assert (np.linalg.norm(face_normals(mesh), axis=1) > 0).all()


def test_the_diagonal_follows_the_saddle():
    """One cell of (x + y)^2 is cut along x + y = 1, where it is constant, and one of (x - y)^2 along x = y."""
    x, square = np.array([0, 0.5, 1]), np.array([0.0, 0.0, 1.0])  # control values of t and t^2
    for sign, ends in ((1, [1.0, 1.0]), (-1, [0.0, 2.0])):
        z = square[:, None] + square[None] + 2 * sign * np.outer(x, x)
        P = np.stack(np.broadcast_arrays(x[:, None], x[None], z), axis=-1)
        corners = np.array([0.0, 1.0])
        patch = facets.triangulate(bezier(P), corners, corners, (False, False), (False,) * 4)
        shared = [i for i in range(4) if (patch.F == i).sum() == 2]
        assert patch.UV[shared].sum(axis=1).tolist() == ends


def test_a_sharp_bend_between_near_kinks_is_seen():
    """A tube's lip: 2 % of the parameter turn by half a circle between two kinks, far below the steps of measuring."""
    w = np.sqrt(0.5)
    P = [[0, 0], [0.5, 0], [1, 0], [1.05, 0], [1.05, 0.05], [1.05, 0.1], [1, 0.1], [0.5, 0.1], [0, 0.1]]
    knots = [0, 0, 0, 0.49, 0.49, 0.5, 0.5, 0.51, 0.51, 1, 1, 1]
    net = np.zeros((9, 2, 3))
    net[:, :, :2] = np.array(P)[:, None]
    net[:, 1, 2] = 1
    weights = np.array([1, 1, 1, w, 1, w, 1, 1, 1])[:, None].repeat(2, axis=1)
    surface = from_points(2, 1, knots, [0, 0, 1, 1], net, weights)
    mesh, _ = mesh_of([surface], 1e-4)
    u = np.unique(mesh.UV[:, 0])
    assert mesh.distance[0] <= 1e-4
    bend = np.pi / (2 * np.arccos(1 - 1e-4 / 0.05))
    assert bend <= len(u[(u >= 0.49) & (u <= 0.51)]) - 1 <= 2 * bend
    assert len(u) < 2 * bend + 6  # and the straight parts take next to nothing


def test_a_bump_far_finer_than_the_measuring_is_found_by_the_chords():
    """A fold over 1 % of the parameter, smooth: the plan's second differences hardly see it, the measured chords do."""
    x = np.linspace(0, 1, 301)
    surface = extruded(np.stack([x, 0.03 * np.exp(-(((x - 0.503) / 0.004) ** 2))], axis=1), 1.0, degree=2)
    mesh, _ = mesh_of([surface], 1e-3)
    assert mesh.distance[0] <= 1e-3
    S = evaluate.point(surface, np.linspace(0, 1, 4001), np.zeros(4001))
    _, first = np.unique(mesh.UV[:, 0], return_index=True)
    height = np.interp(S[:, 0], mesh.V[first, 0], mesh.V[first, 1])
    assert np.abs(height - S[:, 1]).max() < 0.03 * 0.4  # along y; across the steep flanks it is a tenth of that
    assert len(first) < 60


def test_an_outline_that_turns_back_on_itself_is_measured_lengthways():
    """A tongue: the sheet runs out by 0.9 and comes back along itself, its chord is a hundredth of that."""
    P = np.zeros((4, 2, 3))
    P[:, 0, 0] = P[:, 1, 0] = [0, 2, 2 / 3, 0.01]
    P[:, 1, 2] = 0.5
    patch = facets.triangulate(bezier(P), np.array([0.0, 1.0]), np.array([0.0, 1.0]), (False, False), (False,) * 4)
    assert patch.distance > 0.7


@pytest.mark.parametrize("is_kinked", [False, True])
def test_a_reversed_neighbour_gets_the_mirrored_lines(is_kinked):
    """An uneven curve (or a bent one) with a sheet on either side, the second running backwards along it."""
    angle = np.linspace(0, 1, 17) ** 2 * np.pi / 2
    curve = [[0, 0], [1, 0], [1, 2]] if is_kinked else np.stack([np.cos(angle), np.sin(angle)], axis=1)
    knots, degree = ([0, 0, 0.3, 1, 1], 1) if is_kinked else (None, 3)
    below = extruded(curve, -1.0, knots, degree)
    back = knots if knots is None else 1 - np.array(knots[::-1])
    above = extruded(np.array(curve)[::-1], 1.0, back, degree)
    alone, _ = mesh_of([below], 1e-3)
    both, known = mesh_of([above, below], 1e-3)
    assert known.borders.tolist() == [[0, 2, 1, 2, 1]]
    own = both.UV[both.vertex_start[1] :]
    assert np.unique(own[:, 0]) == pytest.approx(np.unique(alone.UV[:, 0]), abs=1e-3)
    assert both.distance.max() <= 1e-3
