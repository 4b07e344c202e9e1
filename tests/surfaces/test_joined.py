"""Surfaces that share borders, put together by hand."""

import numpy as np
import pytest

from lib.surfaces.joined import joined
from tests.shapes import box, rectangle, sphere
from tests.surfaces.trimmed_shapes import SQUARE, cut_out

TURNED = np.array([False, True, False, False, True, True])


def walls(is_trimmed):
    """The six walls of a cube, all facing one way: rectangles, or trimmed to their whole domain."""
    return [cut_out(wall, [SQUARE]) if is_trimmed else wall for wall in box(1.0)]


@pytest.mark.parametrize("is_trimmed", [True, False])
def test_neighbours_whose_border_runs_against_itself_face_to_one_side(is_trimmed):
    body, side = joined(walls(is_trimmed), np.zeros(6, dtype=bool))
    assert len(set(body)) == 1 and len(set(side)) == 1
    body, side = joined(walls(is_trimmed), TURNED)
    assert len(set(body)) == 1
    assert (side * np.where(TURNED, -1, 1)).tolist() in ([1] * 6, [-1] * 6)


def test_what_shares_no_border_is_on_its_own():
    far = rectangle([5, 0, 0], [1, 0, 0], [0, 1, 0])
    body, side = joined([*walls(True), far, cut_out(far, [SQUARE / 2]), sphere(1.0)], np.zeros(9, dtype=bool))
    assert len(set(body)) == 4 and len(set(body[:6])) == 1 and side[6:].tolist() == [1, 1, 1]
    assert joined([], np.zeros(0, dtype=bool))[0].size == 0
