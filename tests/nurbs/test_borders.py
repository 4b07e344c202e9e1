"""Sides that are one curve, and shells."""

import numpy as np
import pytest

from lib.nurbs import borders, lines
from lib.nurbs.shape import transformed
from lib.nurbs.surface import from_points
from lib.surfaces import tessellate
from tests.shapes import box, cylinder, disc, rectangle, sphere, teapot


def found(surfaces, takes_part=None):
    known = tessellate.shapes(surfaces, np.ones(len(surfaces), bool) if takes_part is None else takes_part)
    return known.borders.tolist(), known.shell.tolist()


def test_two_rectangles_side_by_side():
    left = rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0])
    right = rectangle([1, 0, 0], [1, 0, 0], [0, 1, 0])
    turned = rectangle([2, 1, 0], [-1, 0, 0], [0, -1, 0])
    assert found([left, right])[0] == [[0, 1, 1, 0, 0]]
    assert found([left, turned])[0] == [[0, 1, 1, 1, 1]]


def test_half_a_side_is_no_border():
    long = rectangle([0, 0, 0], [1, 0, 0], [0, 2, 0])
    short = rectangle([1, 0, 0], [1, 0, 0], [0, 1, 0])
    assert found([long, short]) == ([], [-1, -1])


def test_another_speed_is_no_border_but_closes_a_shell():
    """A box whose lid runs unevenly along one direction."""
    faces = box()
    x, y = np.array([0, 0.2, 1]), np.array([0, 1])
    P = np.stack(np.broadcast_arrays(x[:, None], y[None], 1.0), axis=-1)
    faces[1] = from_points(2, 1, [0, 0, 0, 1, 1, 1], [0, 0, 1, 1], P)
    pairs, shell = found(faces)
    assert len(pairs) == 10 and shell == [0] * 6


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_two_boxes_are_two_shells_at_any_scale(scale):
    move = np.eye(4)
    move[0, 3] = 3 * scale
    boxes = box(scale)
    _, shell = found(boxes + [transformed(s, move) for s in boxes])
    assert shell == [0] * 6 + [1] * 6


def test_a_flap_does_not_open_the_box_it_hangs_on():
    flap = rectangle([0, 0, 1], [-1, 0, 1], [0, 1, 0])
    assert found([*box(), flap])[1] == [0] * 6 + [-1]


def test_surfaces_that_take_no_part_leave_a_hole():
    takes_part = np.array([True] * 5 + [False])
    assert found(box(), takes_part)[1] == [-1] * 6


def test_sphere_needs_no_partner_and_can_needs_its_lids():
    assert found([sphere()])[1] == [0]
    lid = disc()
    assert found([cylinder(), lid])[1] == [-1, -1]
    up = np.eye(4)
    up[2, 3] = 1
    assert found([cylinder(), lid, transformed(lid, up)])[1] == [0, 0, 0]


def test_thin_strip_is_not_closed_onto_itself():
    assert found([rectangle([0, 0, 0], [1e-6, 0, 0], [0, 1, 0])]) == ([], [-1])


def test_teapot_borders():
    """Newell's teapot: rim, lid and bottom in quarters, body joined to its rim; spout and handle in halves."""
    surfaces = teapot()
    pairs, shell = found(surfaces)
    assert len(surfaces) == 32 and set(shell) == {-1}
    a = np.array(pairs)
    assert (a[:, 0] < a[:, 2]).all()
    # every pair really is one curve
    data = borders.sides(surfaces)
    first, second = data.points[4 * a[:, 0] + a[:, 1]], data.points[4 * a[:, 2] + a[:, 3]]
    second = np.where(a[:, 4, None, None] == 1, second[:, ::-1], second)
    assert np.abs(first - second).max() < 1e-5
    # and none was missed: compare all with all
    points, usable, every = data.points, np.flatnonzero(data.length > 1e-6), set()
    for i in usable:
        for j in usable[usable > i]:
            if min(np.abs(points[i] - points[j]).max(), np.abs(points[i] - points[j][::-1]).max()) < 1e-6:
                every.add((i // 4, i % 4, j // 4, j % 4))
    assert every == {tuple(row[:4]) for row in pairs}


def test_links_carry_the_direction_along_a_chain():
    # 0 -(same)- 1 -(reversed)- 2 along v; a loop back that disagrees makes the set its own mirror
    pairs = np.array([[0, 1, 1, 0, 0], [1, 1, 2, 0, 1]])
    link = lines.links(3, pairs)
    nodes = [1, 3, 5]
    assert len(set(link.group[nodes])) == 1 and not link.is_mirrored.any()
    assert link.is_reversed[5] != link.is_reversed[3] and link.is_reversed[1] == link.is_reversed[3]
    strip = lines.links(3, np.array([*pairs.tolist(), [2, 1, 0, 0, 0]]))
    assert strip.is_mirrored[strip.group[1]]


def test_many_surfaces_stay_quick():
    """A sheet of 40 x 40 squares: 3120 inner borders, found by hashing."""
    surfaces = [rectangle([i, j, 0], [1, 0, 0], [0, 1, 0]) for i in range(40) for j in range(40)]
    data = borders.sides(surfaces)
    assert len(borders.same_speed(data, data.length > 0)) == 2 * 40 * 39
