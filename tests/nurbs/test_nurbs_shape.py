"""Areas, lengths and kinds of surfaces whose shape is known."""

import numpy as np
import pytest

from lib.nurbs import model, shape
from lib.nurbs.evaluate import normal, point
from lib.nurbs.surface import bilinear, from_points
from tests.shapes import (
    CIRCLE,
    CIRCLE_KNOTS,
    CIRCLE_WEIGHTS,
    box,
    cylinder,
    disc,
    extruded,
    rectangle,
    revolved,
    sphere,
    triangle,
)
from tests.tolerances import EXACT, QUADRATURE

TILT = np.array(
    [[0.36, 0.48, -0.8, 5], [-0.8, 0.6, 0, -7], [0.48, 0.64, 0.6, 11], [0, 0, 0, 1]]
)  # rows are orthonormal


def torus(R=2.0, r=0.5):
    return revolved(np.array([R, 0]) + r * CIRCLE, CIRCLE_WEIGHTS, 2, CIRCLE_KNOTS)


def cone():
    return revolved([[1, 0], [0, 2]], [1, 1], 1, [0, 0, 1, 1])


def comb(n=65):
    """A flat strip of n - 1 linear spans, one of its inner points lifted: narrower than any fixed row of samples."""
    P = np.zeros((n, 2, 3))
    P[..., 0], P[:, 1, 1] = np.linspace(0, 1, n)[:, None], 1
    P[3, :, 2] = 0.2
    return from_points(1, 1, np.concatenate([[0], np.linspace(0, 1, n), [1]]), [0, 0, 1, 1], P)


AREAS = {
    "sphere": (sphere(3.0), 4 * np.pi * 9),
    "torus": (torus(), 4 * np.pi**2 * 2 * 0.5),
    "cone": (cone(), np.pi * np.sqrt(5)),
    "cylinder": (cylinder(2.0, 3.0), 12 * np.pi),
    "disc": (disc(2.0), 4 * np.pi),
    "rectangle": (rectangle([1, 2, 3], [2, 0, 0], [0, 0, 3]), 6),
    "triangle": (triangle([0, 0, 0], [2, 0, 0], [0, 3, 0]), 3),
    "corner with a crease": (extruded([[0, 0], [2, 0], [2, 1]], 3.0), 9),
}


@pytest.mark.parametrize("surface, expected", AREAS.values(), ids=AREAS)
def test_area(surface, expected):
    assert shape.area(surface) == pytest.approx(expected, rel=QUADRATURE)
    assert shape.area(shape.transformed(surface, TILT)) == pytest.approx(expected, rel=QUADRATURE)


def test_area_does_not_depend_on_knots_and_degrees():
    patch = model.elevated(bilinear([0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]))
    area = shape.area(patch)
    assert shape.area(model.with_knots(patch, u=[0.3, 0.31], v=[0.9])) == pytest.approx(area, rel=1e-6)
    uneven = rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0])
    uneven = from_points(1, 1, uneven.knots_u, uneven.knots_v, uneven.P, [[1, 1], [10, 10]])  # runs through u unevenly
    assert shape.area(uneven) == pytest.approx(1, rel=1e-6)


def test_extent():
    assert shape.extent(cylinder(2.0, 3.0)) == pytest.approx((4 * np.pi, 3), rel=QUADRATURE)
    assert shape.extent(rectangle([0, 0, 0], [2, 0, 0], [0, 0, 5])) == pytest.approx((2, 5), rel=EXACT)
    # a triangle's lines along u shrink to the corner: half the base on the mean
    assert shape.extent(triangle([0, 0, 0], [4, 0, 0], [0, 3, 0]))[0] == pytest.approx(2, rel=EXACT)


def test_size():
    assert shape.size(sphere(3.0)) == pytest.approx(6, rel=EXACT)


def petal():
    """A loop of curves that leave a point and come back to it: its two poles are one point, and no seam."""
    P = [[[0, 0, 0], [0, 0, 0]], [[1, 0, 1], [1, 1, 1]], [[1, 0, -1], [1, 1, -1]], [[0, 0, 0], [0, 0, 0]]]
    return from_points(3, 1, [0] * 4 + [1] * 4, [0, 0, 1, 1], np.array(P, dtype=float))


CLOSED = {
    "sphere": (sphere(), (True, False), [False, False, True, True]),
    "torus": (torus(), (True, True), [False] * 4),
    "cylinder": (cylinder(), (True, False), [False] * 4),
    "cone": (cone(), (True, False), [False, False, False, True]),
    "disc": (disc(), (True, False), [False, False, True, False]),
    "triangle": (triangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), (False, False), [False, False, False, True]),
    "rectangle": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), (False, False), [False] * 4),
    "petal": (petal(), (False, False), [True, True, False, False]),
}


@pytest.mark.parametrize("surface, closed, collapsed", CLOSED.values(), ids=CLOSED)
@pytest.mark.parametrize("scale", [1e-6, 1, 1e6])
def test_closed_and_collapsed(surface, closed, collapsed, scale):
    surface = shape.transformed(surface, np.diag([scale, scale, scale, 1]) @ TILT)
    assert shape.is_closed(surface) == closed
    assert shape.collapsed_sides(surface).tolist() == collapsed


def test_an_almost_closed_sheet_is_open():
    curve = np.array([[1, 0], [1, 1], [-1, 1], [-1, -1], [1, -1], [1, -1e-6]], dtype=float)
    assert shape.is_closed(extruded(curve, 1.0)) == (False, False)


def test_sides_that_differ_in_one_narrow_place_are_open():
    """A tube of 64 spans along v whose seam gapes at one control point."""
    ring = np.array([[1, 0], [0, 1], [-1, 0], [0, -1], [1, 0]], dtype=float)
    n = 65
    P = np.zeros((5, n, 3))
    P[..., :2], P[..., 2] = ring[:, None], np.linspace(0, 4, n)
    knots = np.concatenate([[0], np.linspace(0, 1, n), [1]])
    assert shape.is_closed(from_points(1, 1, [0, 0, 1, 2, 3, 4, 4], knots, P)) == (True, False)
    P[-1, 3, 1] = 0.2
    assert shape.is_closed(from_points(1, 1, [0, 0, 1, 2, 3, 4, 4], knots, P)) == (False, False)


FLAT = {
    "rectangle": rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]),
    "disc": disc(),
    "triangle": triangle([0, 0, 0], [1, 0, 0], [0, 1, 0]),
}
BENT = {
    "sphere": sphere(),
    "cylinder": cylinder(),
    "twisted": bilinear([0, 0, 0], [1, 0, 0], [1, 1, 1e-5], [0, 1, 0]),
    "one narrow spike": comb(),
}


@pytest.mark.parametrize("surface", FLAT.values(), ids=FLAT)
@pytest.mark.parametrize("scale", [1e-6, 1, 1e6])
def test_flat_surfaces_are_planar(surface, scale):
    assert shape.is_planar(shape.transformed(surface, np.diag([scale, scale, scale, 1]) @ TILT))


@pytest.mark.parametrize("surface", BENT.values(), ids=BENT)
def test_bent_surfaces_are_not_planar(surface):
    assert not shape.is_planar(surface)


def test_transformed_points_are_transformed():
    u, v = np.random.default_rng(8).uniform(size=(2, 20))
    expected = point(sphere(), u, v) @ TILT[:3, :3].T + TILT[:3, 3]
    assert np.abs(point(shape.transformed(sphere(), TILT), u, v) - expected).max() < 10 * EXACT


def test_a_mirror_turns_the_normals():
    u, v = np.array([0.3]), np.array([0.4])
    assert (normal(sphere(), u, v) * point(sphere(), u, v)).sum() > 0
    mirrored = shape.transformed(sphere(), np.diag([-1, 1, 1, 1]))
    assert (normal(mirrored, u, v) * point(mirrored, u, v)).sum() < 0


def test_box_faces_outwards():
    for face in box(2.0):
        N, S = normal(face, np.array([0.5]), np.array([0.5])), point(face, np.array([0.5]), np.array([0.5]))
        assert (N * (S - 1)).sum() == pytest.approx(1, rel=EXACT)
