"""Triangles inside loops: squares in squares, an edge there and back, a sliver of rounding."""

import numpy as np
import pytest
import pythoncdt

from lib.surfaces.loops import inside_loops
from lib.surfaces.trim_mesh import NOT_ALLOWED, _in_loops


def triangulated(points, edges):
    made = pythoncdt.Triangulation(pythoncdt.VertexInsertionOrder.AUTO, NOT_ALLOWED, 0.0)
    made.insert_vertices(points)
    made.insert_edges(edges.astype(np.uint32))
    made.erase_super_triangle()
    return made.triangles_array()["vertices"].astype(np.int64)


def ring(first, n=4):
    return first + np.stack([np.arange(n), (np.arange(n) + 1) % n], axis=1)


def square(half):
    return np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]) * half


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_squares_in_squares_are_inside_by_turns(n):
    points = np.concatenate([square(k) for k in range(n, 0, -1)]) + [0.3, 0.2]
    loops = np.concatenate([ring(4 * k) for k in range(n)])
    F = triangulated(points, loops)
    within = _in_loops(points, F, loops)
    middle = np.abs(points[F].mean(axis=1) - [0.3, 0.2]).max(axis=1)
    assert within.tolist() == ((n - np.ceil(middle)) % 2 == 0).tolist()
    a, b = (points[F[:, k]] - points[F[:, 0]] for k in (1, 2))
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[within].sum() / 2
    assert area == pytest.approx(sum((-1) ** (n - k) * 4 * k**2 for k in range(1, n + 1)), rel=1e-12)


def test_random_stars_as_each_triangle_asked_by_itself():
    rng = np.random.default_rng(5)
    for _ in range(20):
        angle, radius = np.linspace(0, 2 * np.pi, 30, endpoint=False), rng.uniform(0.3, 1, (2, 30))
        outer = np.stack([np.cos(angle), np.sin(angle)], axis=1) * radius[0][:, None]
        hole = outer[::-1] * 0.5
        points, loops = np.concatenate([outer, hole]), np.concatenate([ring(0, 30), ring(30, 30)])
        F = triangulated(points, loops)
        A, B = points[loops[:, 0]], points[loops[:, 1]]
        assert _in_loops(points, F, loops).tolist() == inside_loops(A, B, points[F].mean(axis=1)).tolist()


def test_an_edge_there_and_back_is_no_border():
    """A square with a cut from its corner to its middle."""
    points = np.concatenate([square(1), [[0.1, 0.0]]])
    loops = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [4, 0]])
    F = triangulated(points, loops)
    assert len(F) == 4 and _in_loops(points, F, loops).all()


def test_a_sliver_that_is_nothing_beside_the_rest_is_not_inside():
    points = np.concatenate([square(1), [[5.0, 5], [6, 5], [6, 5 + 1e-15]]])
    loops = np.concatenate([ring(0), [[4, 5], [5, 6], [6, 4]]])
    F = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6]])
    assert _in_loops(points, F, loops).tolist() == [True, True, False]


def test_a_triangle_without_area_belongs_to_its_neighbour_across_an_edge_there_and_back():
    """A square, one side of which runs through a point in its middle, and straight as well, there and back."""
    points = np.concatenate([square(1), [[1.0, 0]]])
    loops = np.array([[0, 1], [1, 4], [4, 2], [2, 3], [3, 0], [1, 2], [2, 1]])
    F = np.array([[1, 4, 2], [0, 1, 2], [0, 2, 3]])
    assert _in_loops(points, F, loops).tolist() == [True, True, True]
