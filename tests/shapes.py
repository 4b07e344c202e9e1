"""Surfaces with known shapes, for the tests of whatever cuts, lights or writes them."""

from pathlib import Path

import numpy as np

from lib.nurbs.surface import bezier, bilinear, from_points

HALF = np.sqrt(0.5)
CIRCLE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
CIRCLE_WEIGHTS = np.array([1, HALF, 1, HALF, 1, HALF, 1, HALF, 1])
CIRCLE_KNOTS = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]


def revolved(profile, weights, degree, knots):
    """The surface of revolution around z of a profile (k, 2) [radius, z]; u goes round, S_u x S_v outwards going up."""
    profile, weights = np.asarray(profile, dtype=float), np.asarray(weights, dtype=float)
    P = np.empty((9, len(profile), 3))
    P[..., :2] = CIRCLE[:, None] * profile[None, :, :1]
    P[..., 2] = profile[:, 1]
    return from_points(2, degree, CIRCLE_KNOTS, knots, P, CIRCLE_WEIGHTS[:, None] * weights)


def sphere(radius=1.0):
    """The exact sphere, poles at v = 0 and 1, seam at u = 0; normals outwards."""
    profile = radius * np.array([[0, -1], [1, -1], [1, 0], [1, 1], [0, 1]])
    return revolved(profile, [1, HALF, 1, HALF, 1], 2, [0, 0, 0, 1, 1, 2, 2, 2])


def cylinder(radius=1.0, height=1.0):
    return revolved([[radius, 0], [radius, height]], [1, 1], 1, [0, 0, 1, 1])


def disc(radius=1.0):
    """A flat disc, its centre a pole at v = 0; normals down."""
    return revolved([[0, 0], [radius, 0]], [1, 1], 1, [0, 0, 1, 1])


def rectangle(origin, u, v):
    origin, u, v = (np.asarray(x, dtype=float) for x in (origin, u, v))
    return bilinear(origin, origin + u, origin + u + v, origin + v)


def box(side=1.0):
    """Six squares, normals outwards."""
    x, y, z = side * np.eye(3)
    o = np.zeros(3)
    faces = [(o, y, x), (z, x, y), (o, x, z), (y, z, x), (o, z, y), (x, y, z)]
    return [rectangle(*face) for face in faces]


def triangle(A, B, C):
    """Corner C is the collapsed side v = 1."""
    return bilinear(*(np.asarray(x, dtype=float) for x in (A, B, C, C)))


def extruded(curve, height, knots=None, degree=1):
    """A sheet standing on the curve (k, 2) in the plane z = 0; u along the curve, v up."""
    curve = np.asarray(curve, dtype=float)
    if knots is None:
        knots = np.concatenate([np.zeros(degree), np.linspace(0, 1, len(curve) - degree + 1), np.ones(degree)])
    P = np.zeros((len(curve), 2, 3))
    P[:, :, :2] = curve[:, None]
    P[:, 1, 2] = height
    return from_points(degree, 1, knots, [0, 0, 1, 1], P)


def teapot():
    """Newell's teapot, 32 bicubic patches: 8 with a pole, rim and lid open."""
    numbers = (Path(__file__).parent / "data" / "teapot.bpt").read_text().split()
    return [bezier(np.array(numbers[k * 50 + 3 : k * 50 + 51], float).reshape(4, 4, 3)) for k in range(32)]
