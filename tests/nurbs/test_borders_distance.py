"""Distances of points from polylines, known without computing."""

import numpy as np
import pytest

from lib.nurbs.borders import to_polyline

HOOK = np.array([[0, 0, 0], [4, 0, 0], [4, 3, 0.0]])


@pytest.mark.parametrize(
    ("points", "far"),
    [
        ([[1, 0, 0], [4, 2, 0]], 0.0),
        ([[1, 0, 0], [2, 0, 1]], 1.0),  # beside a piece
        ([[4, 6, 4.0]], 5.0),  # beyond the end
        ([[-3, -4, 0], [3, 1, 0]], 5.0),  # before the start; inside the corner, 1 from both
        ([[3, 2, 0]], 1.0),  # nearer to the second piece
    ],
)
def test_the_farthest_point_counts_from_its_nearest_piece(points, far):
    assert to_polyline(np.array(points, dtype=float), HOOK) == pytest.approx(far)


def test_pieces_of_no_length_are_points():
    assert to_polyline(np.array([[0, 0, 2.0]]), np.zeros((3, 3))) == pytest.approx(2)


def test_a_number_that_is_none_is_not_hidden():
    assert not to_polyline(np.array([[np.nan, 0, 0]]), HOOK) <= 1
