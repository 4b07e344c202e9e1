"""Polylines of curves: a circle's sagitta, the corners of a polygon, the bounds on the number of points."""

import numpy as np
import pytest

from lib.nurbs.curve import NurbsCurve, curve_points, polyline
from lib.nurbs.curve_kernels import off_chords

HALF = np.sqrt(0.5)
SQUARE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0.0]])
WEIGHT = np.array([1, HALF] * 4 + [1])
CIRCLE = NurbsCurve(
    2, np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4.0]), np.column_stack([SQUARE * WEIGHT[:, None], 0 * WEIGHT, WEIGHT])
)


def test_a_rational_circle_keeps_its_radius():
    S = curve_points(CIRCLE, np.linspace(0, 4, 101))
    assert np.abs(np.linalg.norm(S, axis=1) - 1).max() < 1e-14


def test_chords_of_a_circle_stay_within_the_tolerance():
    S = polyline(CIRCLE, share=2e-5)
    within = 2e-5 * 2  # of the box of the circle
    length = np.linalg.norm(np.diff(S, axis=0), axis=1)
    sagitta = 1 - np.sqrt(1 - (length / 2) ** 2)
    assert sagitta.max() <= within
    assert len(S) <= 1.25 * 2 * np.pi / (2 * np.sqrt(2 * within))  # as the sagitta asks, and a margin


def test_corners_of_a_polygon_are_kept_and_nothing_else():
    P = np.array([[0, 0, 0, 1], [1, 0, 0, 1], [1, 2, 0, 1.0]])
    line = NurbsCurve(1, np.array([0, 0, 1, 3, 3.0]), P)
    assert np.array_equal(polyline(line), P[:, :3])
    assert len(polyline(line, least=9)) == 9


@pytest.mark.parametrize("most", [40, 100])
def test_the_number_of_points_is_bounded(most):
    rng = np.random.default_rng(1)
    knots = np.concatenate([[0] * 3, np.arange(0, 61), [60] * 3])
    wild = NurbsCurve(3, knots.astype(float), np.column_stack([rng.normal(size=(63, 3)), np.ones(63)]))
    assert len(polyline(wild, most=most)) <= most


def test_distances_from_chords_count_their_ends():
    points, out = np.array([[0.5, 1, 0], [1, 3, 4], [-1, 0, 0.0]]), np.empty(3)
    off_chords(points, np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0.0]]), out)
    assert out.tolist() == [1, 5, 1]
