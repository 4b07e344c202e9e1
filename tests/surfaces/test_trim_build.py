"""Loops become trimmed surfaces: areas in closed form, orientation, boxes, seams, poles, and what is refused."""

import numpy as np
import pytest

from lib.nurbs.evaluate import point
from lib.nurbs.surface import bilinear, from_points
from lib.surfaces.loops import inside_loops, signed_area
from lib.surfaces.measure import area
from lib.surfaces.significance import significance
from lib.surfaces.trim_build import EdgeUse, trimmed

PLANE = bilinear((0, 0, 0), (4, 0, 0), (4, 2, 0), (0, 2, 0))
RING = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0.0]])
ROUND = np.array([1, np.sqrt(0.5)] * 4 + [1])[:, None]
KNOTS = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
CYLINDER = from_points(2, 1, KNOTS, [0, 0, 1, 1], [[[x, y, 0], [x, y, 2]] for x, y in RING], ROUND.repeat(2, axis=1))
CONE = from_points(2, 1, KNOTS, [0, 0, 1, 1], [[[x, y, 0], [0, 0, 1]] for x, y in RING], ROUND.repeat(2, axis=1))


def use(surface, uv, S=None):
    """An EdgeUse along uv (k, 2), with the points of the surface there unless S is given."""
    uv = np.array(uv, dtype=float)
    S = point(surface, *(uv - np.floor(uv * (1 - 1e-15))).T) if S is None else S
    return EdgeUse(uv, S, significance(S))


def straight(surface, *corners, steps=8):
    """A closed loop of straight edges in u, v."""
    corners = np.array(corners, dtype=float)
    t = np.linspace(0, 1, steps + 1)[:, None]
    return [use(surface, a + (b - a) * t) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]


def circle(surface, centre, radius, n=400, turn=1):
    t = np.linspace(0, turn * 2 * np.pi, n + 1)
    return [use(surface, np.array(centre) + np.column_stack([np.cos(t), np.sin(t)]) * radius)]


BORDER = ((0, 0), (1, 0), (1, 1), (0, 1))


@pytest.mark.parametrize("turn", [1, -1])
def test_a_plane_with_a_round_hole(turn):
    hole = circle(PLANE, (0.5, 0.5), (0.125, 0.25), turn=turn)  # a circle of radius 0.5 in the plane
    made = trimmed(PLANE, [hole, straight(PLANE, *BORDER)[::turn] if turn == 1 else straight(PLANE, *BORDER)])
    assert made.box.tolist() == [0, 1, 0, 1] and made.base is PLANE
    outer, inner = (made.uv[a:b] for a, b in zip(made.loop_start, made.loop_start[1:], strict=False))
    assert signed_area(outer) == 1.0 and signed_area(inner) < 0
    polygon = 200 * np.sin(2 * np.pi / 400) * 0.25  # of 400 corners on a circle of radius 0.5
    assert area(made) == pytest.approx(8 - polygon, rel=1e-12)
    assert len(outer) == 32 and len(inner) == 400
    assert np.isinf(made.significance).sum() == 5
    assert np.array_equal(point(made.base, *made.uv.T)[:32], made.S[:32])


def test_the_box_is_that_of_the_outer_loop():
    corners = ((0.25, 0.5), (0.75, 0.5), (0.75, 1 + 1e-8), (0.25, 1 - 1e-9))
    made = trimmed(PLANE, [straight(PLANE, *corners[::-1], steps=1)])
    assert made.box.tolist() == [0.25, 0.75, 0.5, 1.0]
    assert sorted(made.uv.tolist()) == [[0, 0], [0, 1], [1, 0], [1, 1]]
    assert area(made) == pytest.approx(2.0, rel=1e-12)


def test_a_cylinder_whose_border_runs_along_its_seam_twice():
    seam = use(CYLINDER, np.column_stack([np.zeros(5), np.linspace(0, 1, 5)]))
    t = np.linspace(0, 1, 65)
    low, high = (use(CYLINDER, np.column_stack([t, np.full(65, v)])) for v in (0.0, 1.0))
    made = trimmed(CYLINDER, [[low, seam, high.reversed(), seam.reversed()]])  # the seam is given at u = 0 both times
    assert made.box.tolist() == [0, 1, 0, 1] and made.base is CYLINDER
    assert signed_area(made.uv) == 1.0
    right, left = made.uv[:, 0] == 1, made.uv[:, 0] == 0
    assert right.sum() == left.sum() == 5
    upwards = [np.flatnonzero(side)[np.argsort(made.uv[side, 1])] for side in (left, right)]
    assert np.array_equal(*(made.S[rows] for rows in upwards))
    assert np.array_equal(*(made.significance[rows] for rows in upwards))
    assert area(made) == pytest.approx(4 * np.pi, rel=1e-9)


def test_a_patch_and_a_hole_across_the_seam():
    patch = straight(CYLINDER, (0.8, 0.25), (1.25, 0.25), (1.25, 0.75), (0.8, 0.75))
    hole = circle(CYLINDER, (0.0, 0.5), (0.05, 0.1))
    made = trimmed(CYLINDER, [patch, hole])
    assert made.box == pytest.approx([0.8, 1.25, 0.25, 0.75], abs=1e-12)
    assert np.abs(point(made.base, *made.uv.T) - made.S).max() < 1e-12
    outer = made.uv[: made.loop_start[1]]
    assert inside_loops(outer, np.roll(outer, -1, axis=0), made.uv[made.loop_start[1] :]).all()
    hole_alone = trimmed(CYLINDER, [hole])
    assert area(made) + area(hole_alone) == pytest.approx(area(trimmed(CYLINDER, [patch])), rel=1e-9)
    assert hole_alone.box[:2] == pytest.approx([0.95, 1.05], abs=1e-4)


def test_a_cone_with_its_pole():
    t = np.linspace(0, 1, 33)
    rim = use(CONE, np.column_stack([t, 0 * t]))
    seam = [use(CONE, np.column_stack([np.full(9, u), np.linspace(0, 1, 9)])) for u in (1.0, 0.0)]
    made = trimmed(CONE, [[rim, seam[0], seam[1].reversed()]])
    assert area(made) == pytest.approx(np.pi * np.sqrt(2), rel=1e-9)
    at_pole = made.uv[made.uv[:, 1] == 1]
    assert sorted(at_pole[:, 0]) == [0, 1]


def test_what_does_not_close_is_told():
    loop = straight(PLANE, *BORDER)
    with pytest.raises(ValueError, match=r"loop 2: does not close in u, v: edge 2 to edge 3 leaves a gap of "):
        trimmed(PLANE, [loop, loop[:2] + loop[3:]])
    t = np.linspace(0, 1, 33)
    rim = [use(CYLINDER, np.column_stack([t, 0 * t]))]
    with pytest.raises(ValueError, match="loop 1: does not close in u, v: it winds around in u"):
        trimmed(CYLINDER, [rim])
    back = [loop[0], loop[0].reversed()]
    with pytest.raises(ValueError, match="loop 1: encloses no area"):
        trimmed(PLANE, [back])
    aside = straight(PLANE, (0.1, 0.1), (0.2, 0.1), (0.2, 0.2))
    with pytest.raises(ValueError, match="loop 2: lies outside"):
        trimmed(PLANE, [straight(PLANE, (0.4, 0.4), (0.9, 0.4), (0.9, 0.9)), aside])
    with pytest.raises(ValueError, match="loops: there is none"):
        trimmed(PLANE, [])
