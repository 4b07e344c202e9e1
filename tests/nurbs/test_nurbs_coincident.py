"""Surfaces in one another are found; neighbours, boxes on floors and walls of two sheets are left alone."""

import numpy as np
import pytest

from lib.nurbs.coincident import back_to_back, coincident
from lib.nurbs.shape import transformed
from lib.nurbs.surface import bezier, bilinear


def square(x, y, z, side=1.0, up=True):
    corners = [[x, y, z], [x + side, y, z], [x + side, y + side, z], [x, y + side, z]]
    return bilinear(*(corners if up else corners[::-1]))


def found(*surfaces, flip=None, size=5.0):
    return coincident(list(surfaces), np.zeros(len(surfaces), bool) if flip is None else np.array(flip), size)


def test_a_lamp_in_the_plane_of_the_ceiling():
    ceiling = square(0, 0, 3, 5, up=False)
    assert found(ceiling, square(2, 2, 3, up=False)) == [(0, 1)]
    assert found(ceiling, square(2, 2, 2.999, up=False)) == []
    assert found(ceiling, square(2, 2, 3), flip=[False, True]) == [(0, 1)]


def test_faces_that_touch_or_turn_their_backs_are_left_alone():
    floor = square(0, 0, 0, 5)
    assert found(floor, square(1, 1, 0, up=False)) == []
    assert found(floor, square(1, 1, 0), flip=[False, True]) == []


def test_neighbours_share_an_edge_only():
    assert found(square(0, 0, 0), square(1, 0, 0), square(1, 1, 0), square(3, 3, 0)) == []
    assert found(square(0, 0, 0), square(0.999, 0, 0)) == [(0, 1)]


def test_bounding_boxes_may_overlap_without_the_surfaces():
    a, b = (
        bilinear([0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]),
        bilinear([1, 1, 0], [0.1, 1, 0], [1, 0.1, 0], [1, 0.1, 0]),
    )
    assert found(a, b) == []
    assert found(a, square(0.2, 0.2, 0, 0.1)) == [(0, 1)]


@pytest.mark.parametrize("shift, scale", [([1e5, -1e5, 3e4], 1), ([0, 0, 0], 1e-6), ([0, 0, 0], 1e6)])
def test_anywhere_turned_and_of_any_size(shift, scale):
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    M = np.eye(4)
    M[:3, :3], M[:3, 3] = turn * scale, shift
    surfaces = [transformed(s, M) for s in (square(0, 0, 0, 5), square(1, 1, 0), square(1, 1, 0.01), square(5, 0, 0))]
    assert found(*surfaces, size=6 * scale) == [(0, 1)]


def test_a_curved_surface_twice():
    net = np.random.default_rng(1).uniform(size=(4, 4, 3))
    assert found(bezier(net), square(0, 0, 0), bezier(net)) == [(0, 2)]
    assert found(bezier(net), bezier(net), flip=[False, True]) == []
    assert found(bezier(net), bezier(net + 0.01)) == []


def test_a_floor_of_many_tiles_takes_no_time():
    tiles = [square(i, j, 0) for i in range(40) for j in range(40)]
    assert found(*tiles, square(3.2, 3.2, 0, 0.5), size=40.0) == [(123, 1600)]


@pytest.mark.parametrize("turn", np.linspace(0, 3, 7))
def test_sheets_back_to_back(turn):
    """A wall of two sheets, a box on a floor; not what faces the same way, lies apart, or shares an edge."""
    c, s = np.cos(turn), np.sin(turn)
    M = np.array([[c, -s * c, s * s, 3], [s, c * c, -s * c, 1], [0, s, c, 2], [0, 0, 0, 1]])
    surfaces = [
        square(0, 0, 0, 5),  # the floor
        square(1, 1, 0, up=False),  # below a box
        square(3, 3, 0),  # a carpet, turned by its flip
        square(3, 1, 0),  # a carpet that lies in the floor
        square(5, 0, 0, up=False),  # beside the floor
        square(1, 1, -0.001, up=False),
    ]
    flip = np.array([False, False, True, False, False, False])
    found = back_to_back([transformed(x, M) for x in surfaces], flip, 6.0)
    assert found.tolist() == [True, True, True, False, False, False]


def test_single_sheets_are_not_back_to_back():
    assert back_to_back([square(0, 0, 0)], np.zeros(1, bool), 1.0).tolist() == [False]
    assert not back_to_back([], np.zeros(0, bool), 1.0).any()
