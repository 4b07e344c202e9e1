"""Rays against triangles whose hits are known."""

import numpy as np
import pytest

from lib.elements.grids import ElementGrids
from lib.surfaces import tessellate
from lib.visibility.mesh_lookup import MeshLookup
from lib.visibility.tracer import MISSED, Tracer
from tests.shapes import box, sphere
from tests.tolerances import COINCIDENT, FLOAT32

V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype=float)
F = np.array([[0, 1, 2], [3, 2, 1]], dtype=np.int32)  # the unit square at z = 0, its front upwards
DOWN, UP = np.array([0, 0, -1.0]), np.array([0, 0, 1.0])


def rays(*of):
    return tuple(np.array(x, dtype=np.float32) for x in of)


def mesh_of(surfaces, tolerance=0.01):
    known = tessellate.shapes(surfaces, np.ones(len(surfaces), bool))
    n = len(surfaces)
    patches = tessellate.Pieces(surfaces, known).cut_within(np.full(n, tolerance), np.ones(n))
    mesh = tessellate.assemble(patches, surfaces, known)
    return mesh.V, mesh.F


def test_hits_misses_and_back_faces():
    hits = Tracer(V, F).closest(
        *rays([[0.25, 0.25, 2], [0.75, 0.75, 2], [2, 2, 1], [0.25, 0.25, -1]], [DOWN, DOWN, DOWN, UP])
    )
    assert hits.face.tolist() == [0, 1, -1, 0]
    assert hits.is_back.tolist() == [False, False, False, True]
    assert hits.t[[0, 1, 3]].tolist() == [2, 2, 1]
    assert hits.t[2] >= MISSED


def test_barycentric_weights_are_of_the_second_and_third_vertex():
    p = np.random.default_rng(1).dirichlet([1, 1, 1], 200)
    x = p @ V[F[0]]
    hits = Tracer(V, F).closest(*rays(x + [0, 0, 1], np.tile(DOWN, (200, 1))))
    inside = p.min(axis=1) > 1e-4
    assert (hits.face[inside] == 0).all()
    assert np.abs(hits.a - p[:, 1])[inside].max() < FLOAT32 and np.abs(hits.b - p[:, 2])[inside].max() < FLOAT32


def test_some_of_the_hits():
    hits = Tracer(V, F).closest(*rays([[0.25, 0.25, 2], [2, 2, 1], [0.75, 0.75, 3]], [DOWN] * 3))
    some = hits[np.array([2, 0])]
    assert some.face.tolist() == [1, 0] and some.t.tolist() == [3, 2]


def test_reach():
    tracer = Tracer(V, F)
    origin, D = rays([[0.25, 0.25, 2]], [DOWN])
    assert tracer.closest(origin, D, reach=2.01).face.tolist() == [0]
    assert tracer.closest(origin, D, reach=1.99).face.tolist() == [-1]


@pytest.mark.parametrize("height, blocked", [(0.5, False), (0.9994, False), (1.0, False), (1.001, True), (2.0, True)])
def test_shadow_rays_stop_short_of_their_target(height, blocked):
    """From z = 1 down by `height`: the square at z = 0 blocks only what lies behind it."""
    origin, D = rays([[0.3, 0.3, 1]], [[0, 0, -height]])
    assert Tracer(V, F).is_blocked(origin, D).tolist() == [blocked]


def test_blockers_block_from_both_sides():
    tracer = Tracer(V, F)
    assert tracer.is_blocked(*rays([[0.3, 0.3, 1], [0.3, 0.3, -1]], [2 * DOWN, 2 * UP])).tolist() == [True, True]


def test_nothing_blocks_in_an_empty_scene():
    tracer = Tracer(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    origin, D = rays([[0, 0, 0]], [DOWN])
    assert not tracer.is_blocked(origin, D).any()
    hits = tracer.closest(origin, D)
    assert hits.face.tolist() == [-1] and hits.t[0] >= MISSED and not hits.is_back.any()


def test_no_rays():
    none = np.zeros((0, 3), dtype=np.float32)
    tracer = Tracer(V, F)
    assert len(tracer.closest(none, none).face) == len(tracer.is_blocked(none, none)) == tracer.rays == 0


def test_rays_are_counted():
    tracer = Tracer(V, F)
    origin, D = rays([[0, 0, 1]] * 5, [DOWN] * 5)
    tracer.closest(origin, D)
    tracer.is_blocked(origin[:3], D[:3])
    assert tracer.rays == 8


@pytest.mark.parametrize("shape", ["box", "sphere"])
def test_no_leak_at_vertices_and_edges(shape):
    """From inside a closed mesh, 40000 rays aimed at its vertices and at points of its edges: none may get out."""
    corners, faces = mesh_of(box() if shape == "box" else [sphere()])
    rng = np.random.default_rng(2)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    chosen, t = edges[rng.integers(0, len(edges), 20000)], rng.random((20000, 1))
    on_edges = corners[chosen[:, 0]] * t + corners[chosen[:, 1]] * (1 - t)
    target = np.concatenate([corners[rng.integers(0, len(corners), 20000)], on_edges])
    middle, size = corners.mean(axis=0), np.ptp(corners, axis=0)
    origin = middle + rng.uniform(-0.2, 0.2, (40000, 3)) * size
    tracer = Tracer(corners, faces)
    passed = tracer.closest(*rays(origin, target - origin)).face < 0
    assert passed.mean() <= COINCIDENT
    assert (~tracer.is_blocked(*rays(origin, 1.1 * (target - origin)))).mean() <= COINCIDENT


def test_hits_on_the_inside_are_back_faces():
    corners, faces = mesh_of(box())
    D = np.random.default_rng(3).normal(size=(1000, 3))
    assert Tracer(corners, faces).closest(*rays(np.full((1000, 3), 0.5), D)).is_back.all()


def lookup(shell=(-1, -1)):
    """Surface 0: the triangle below the diagonal with 2 x 1 elements; surface 1: the other one, without elements."""
    grids = ElementGrids(np.array([2, 0]), np.array([1, 0]), np.array([0, 2, 2]))
    return MeshLookup(V, F, V[:, :2], [0, 1], np.array(shell) >= 0), grids


def test_hits_become_elements():
    mesh, grids = lookup()
    origins = [[0.2, 0.2, 1], [0.7, 0.2, 1], [0.9, 0.9, 1], [5, 5, 1], [0.2, 0.2, -1]]
    hits = Tracer(V, F).closest(*rays(origins, [DOWN] * 4 + [UP]))
    element, point = mesh.element_of(hits, grids)
    assert element.tolist() == [0, 1, -2, -1, -2]
    assert point[:2].tolist() == [1, 1]  # row 0, column 1 of the 4 x 4 of each


def test_elements_of_a_finer_grid():
    """Element j n_u + i of (u, v) on a whole square."""
    mesh = MeshLookup(V, F, V[:, :2], [0, 0], np.zeros(2, dtype=bool))
    grids = ElementGrids(np.array([4]), np.array([3]), np.array([0, 12]))
    uv = np.random.default_rng(4).random((500, 2))
    hits = Tracer(V, F).closest(*rays(np.append(uv, np.ones((500, 1)), axis=1), np.tile(DOWN, (500, 1))))
    expected = np.floor(uv[:, 1] * 3) * 4 + np.floor(uv[:, 0] * 4)
    element, point = mesh.element_of(hits, grids)
    assert (element == expected).mean() > 0.999  # float32 decides on the lines between
    nearest = np.floor(uv[:, 1] * 12) % 4 * 4 + np.floor(uv[:, 0] * 16) % 4
    assert (point == nearest).mean() > 0.999


def test_shells_and_normals():
    mesh, _ = lookup(shell=(-1, 3))
    assert mesh.in_shell.tolist() == [False, True]
    assert mesh.normal.tolist() == [[0, 0, 1], [0, 0, 1]]


def test_a_back_may_be_the_front_of_another_surface():
    """Surface 2 is the back of surface 1, the triangle above the diagonal; the other has no back."""
    mesh = MeshLookup(V, F, V[:, :2], [0, 1], np.zeros(2, dtype=bool), np.array([-1, 2, -1]))
    tracer = Tracer(V, F, mesh.two_sided)
    hits = tracer.closest(*rays([[0.2, 0.2, -1], [0.9, 0.9, -1], [0.9, 0.9, 1], [5, 5, -1]], [UP, UP, DOWN, UP]))
    assert hits.face.tolist() == [0, 3, 1, -1]
    assert hits.is_back.tolist() == [True, False, False, False]
    assert mesh.face_surface[hits.face[:3]].tolist() == [0, 2, 1]
    assert mesh.normal[hits.face[:3]].tolist() == [[0, 0, 1], [0, 0, -1], [0, 0, 1]]


def test_texel_coordinates_span_the_map():
    mesh, _ = lookup()
    table = mesh.texel_coordinates(np.array([5, 9]), np.array([3, 17]))
    assert table.shape == (2, 6)
    assert table[0].tolist() == [0, 0, 4, 0, 0, 2]  # corner (0, 0); u to its second vertex, v to its third
    assert table[1].tolist() == [8, 16, -8, 0, 0, -16]
