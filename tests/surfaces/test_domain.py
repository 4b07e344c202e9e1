"""Which part of a map a surface fills: samples outside are moved in, cells that hold two charts are found."""

import numpy as np
import pytest

from lib.surfaces.domain import INSIDE, Domain

LOWER = [[[0.0, 0], [1, 0], [0, 1]]]  # the half of the square below its diagonal
SQUARE = [[[0.1, 0.1], [0.4, 0.1], [0.4, 0.4]], [[0.1, 0.1], [0.4, 0.4], [0.1, 0.4]]]


def two_charts():
    """A square of two triangles at the lower left, and the same at the lower right, 0.2 apart."""
    uv = np.array(SQUARE + (np.array(SQUARE) + [0.5, 0]).tolist())
    return Domain(uv, [7, 7, 9, 9], (16, 16))


def test_samples_inside_stay_and_others_come_to_the_nearest_place():
    domain = Domain(LOWER, [0], (16, 16))
    found = domain.locate([[0.25, 0.25], [0.8, 0.8], [0.75, 0.6]])
    assert found.is_inside.tolist() == [True, False, False]
    assert found.uv[0] == pytest.approx([0.25, 0.25], abs=1e-15)
    assert found.uv[1] == pytest.approx([0.5, 0.5], abs=0.03)  # places along the border lie 1/32 apart
    assert found.uv[2] == pytest.approx([0.575, 0.425], abs=0.03)
    assert (found.uv.sum(axis=1)[1:] < 1 - 0.5 * INSIDE).all()
    assert found.face.tolist() == [0, 0, 0]


def test_samples_on_the_border_are_moved_in():
    found = Domain(LOWER, [0], (16, 16)).locate([[0.0, 0.5], [0.5, 0.0], [0.5, 0.4999]])
    distance = np.minimum(found.uv.min(axis=1), (1 - found.uv.sum(axis=1)) / np.sqrt(2))
    assert (distance >= 0.99 * INSIDE).all() and (distance < 3 * INSIDE).all()


def test_the_line_between_two_triangles_of_a_chart_is_no_border():
    found = two_charts().locate([[0.25, 0.25], [0.2, 0.2001]])
    assert found.uv == pytest.approx(np.array([[0.25, 0.25], [0.2, 0.2001]]), abs=1e-12)
    assert found.chart.tolist() == [7, 7]


def test_charts_of_samples_between_them():
    found = two_charts().locate([[0.45, 0.2], [0.55, 0.2], [0.05, 0.9], [0.95, 0.9]])
    assert found.chart.tolist() == [7, 9, 7, 9] and not found.is_inside.any()


def test_cells_that_hold_a_part():
    domain = two_charts()
    chart, is_mixed = domain.coverage(10, 10)
    expected = np.full((10, 10), -1)
    expected[1:4, 1:4], expected[1:4, 6:9] = 7, 9
    assert (chart[1:4, 1:4] == 7).all() and (chart[1:4, 6:9] == 9).all()
    assert (chart[5:] == -1).all() and not is_mixed.any()
    assert domain.coverage(2, 1)[1].tolist() == [[True], [False]]


def test_cells_straddle_while_they_are_wide_and_no_more_when_they_are_narrow():
    domain = two_charts()
    needed, straddling = domain.cover(2, 2)
    assert needed.tolist() == [[True, True], [False, False]]
    assert straddling.tolist() == needed.tolist()  # the corner in the middle of the lower edge belongs to one of them
    needed, straddling = domain.cover(20, 20)
    assert needed.sum() >= 2 * 36 and not straddling.any()


def test_one_chart_never_straddles():
    needed, straddling = Domain(LOWER, [3], (16, 16)).cover(4, 4)
    row, column = np.indices((4, 4))
    assert needed[row + column <= 3].all() and not needed[row + column >= 5].any()
    assert not straddling.any()


def test_shares_add_up_to_the_area():
    domain = Domain(LOWER, [0], (16, 16))
    for n in (4, 16, 64):
        assert domain.shares(n, n)[1].mean() == pytest.approx(0.5, abs=0.5 / (4 * n) + 0.01)
    assert two_charts().shares(50, 50)[1].mean() == pytest.approx(0.18, rel=0.05)
