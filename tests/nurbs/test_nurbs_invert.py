"""Parameters are found again: sphere, cylinder, teapot, heads with poles and uneven speed."""

from pathlib import Path

import numpy as np
import pytest

from lib.formats import geometry_file
from lib.nurbs.evaluate import point
from lib.nurbs.invert import Inverter, invert
from lib.nurbs.invert_kernels import nearest_of_grid
from lib.nurbs.shape import size
from lib.nurbs.surface import from_points

DATA = Path(__file__).parents[1] / "data"
RNG = np.random.default_rng(3)
HALF = np.sqrt(0.5)
T = np.linspace(0.0, 1.0, 60)


def turned(profile, weights, degree, knots):
    """The surface of a profile (k, 2) of (radius, height) turned around z, closed in u."""
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0.0]])
    P = np.array([[[r * x, r * y, z] for r, z in profile] for x, y in ring])
    w = np.array([1, HALF] * 4 + [1])[:, None] * np.asarray(weights)
    return from_points(2, degree, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], knots, P, w)


SPHERE = turned([(0, -1), (1, -1), (1, 0), (1, 1), (0, 1)], [1, HALF, 1, HALF, 1], 2, [0, 0, 0, 1, 1, 2, 2, 2])
CYLINDER = turned([(1, 0), (1, 2)], [1, 1], 1, [0, 0, 1, 1])


def files():
    for file in ("teapot.bpt", "v3_HumanHead2.3dm", "v3_Speeder.3dm"):
        yield from ((file, patch.surface) for patch in geometry_file.read(DATA / file, file, "x").patches[::7])


def checked(surface, uv, within=1e-9):
    """u, v found for the polyline along uv; its points are on the surface."""
    S = point(surface, *(uv - np.floor(uv * (1 - 1e-15))).T)
    found, distance = invert(surface, S)
    assert distance.max() < within * size(surface)
    return found


@pytest.mark.parametrize("surface", [SPHERE, CYLINDER])
def test_a_line_inside_is_found_again(surface):
    uv = np.column_stack([0.1 + 0.8 * T, 0.2 + 0.5 * T**2])
    assert np.abs(checked(surface, uv) - uv).max() < 1e-9


@pytest.mark.parametrize("surface", [SPHERE, CYLINDER])
def test_a_line_goes_on_over_the_seam(surface):
    uv = np.column_stack([0.8 + 0.5 * T, 0.3 + 0.2 * T])
    found = checked(surface, uv)
    turns = np.round(found[0, 0] - uv[0, 0])
    assert np.abs(found - uv - [turns, 0]).max() < 1e-9


def test_a_whole_round_is_one_period():
    found = checked(CYLINDER, np.column_stack([T, np.full(60, 0.5)]))
    assert found[-1, 0] - found[0, 0] == pytest.approx(1.0, abs=1e-9)


def test_at_a_pole_the_free_parameter_is_that_of_the_neighbour():
    uv = np.column_stack([np.full(60, 0.37), T])
    found = checked(SPHERE, uv)
    assert np.abs(found - uv).max() < 1e-6
    assert found[0, 1] == 0.0 and found[-1, 1] == 1.0


def test_real_surfaces_find_their_parameters():
    for file, surface in files():
        uv = np.column_stack([0.15 + 0.7 * T, 0.8 - 0.6 * T**2])
        found = checked(surface, uv, 1e-8)
        back = point(surface, *(found - np.floor(found)).T)
        assert np.abs(back - point(surface, *uv.T)).max() < 1e-8 * size(surface), file


def test_lone_points_are_found_wherever_they_lie():
    for _, surface in files():
        uv = RNG.uniform(0.02, 0.98, (200, 2))
        S = point(surface, *uv.T)
        far = [invert(surface, S[k : k + 1])[1][0] for k in range(0, 200, 10)]
        assert max(far) < 1e-4 * size(surface)


def test_points_beside_the_surface_give_their_distance():
    inverter = Inverter(CYLINDER)
    angle = 2 * np.pi * T * 0.9
    [(uv, distance)] = inverter.polylines([np.column_stack([1.01 * np.cos(angle), 1.01 * np.sin(angle), 1 + 0 * T])])
    assert distance == pytest.approx(0.01, abs=1e-9)
    assert uv[:, 1] == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("count", [1, 8])
def test_the_nearest_points_of_a_grid(count):
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(7.0), np.arange(1.0)), axis=3).reshape(7, 5, 3)
    boxes = np.stack([grid.min(axis=1), grid.max(axis=1)], axis=1)
    points = RNG.uniform(-2, 8, (100, 3))
    points[0] = 0.5, 0.5, 0.0  # as far from four: those with the lowest numbers come first
    found, square = np.empty((100, count), dtype=np.int64), np.empty((100, count))
    nearest_of_grid(grid, boxes, points, found, square)
    every = ((points[:, None] - grid.reshape(-1, 3)) ** 2).sum(axis=2)
    assert np.array_equal(found, np.argsort(every, axis=1, kind="stable")[:, :count])
    assert square == pytest.approx(np.sort(every, axis=1)[:, :count], rel=1e-12)
