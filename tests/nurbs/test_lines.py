"""Numbers of lines and their places, against closed forms."""

import numpy as np
import pytest

from lib.nurbs import lines
from lib.surfaces.measure import transformed
from tests.shapes import cylinder, rectangle, sphere

NONE = np.empty((0, 5), dtype=int)
POLES = np.array([False, False, True, True])


def planned(surface, closed=(False, False), collapsed=(False,) * 4):
    return lines.plan([lines.demand(surface, np.array(closed), np.array(collapsed))], lines.links(1, NONE))


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_steps_round_a_cylinder(tolerance):
    """Sagitta 1 - cos(pi / n) <= tolerance, all of it spent on u, since v is straight."""
    p = planned(cylinder(), (True, False))
    n_u, n_v = lines.per_surface(p, lines.steps(p, np.array([[tolerance, 1.0]])))[0]
    ideal = np.pi / np.arccos(1 - tolerance)
    assert n_v == 1 and ideal <= n_u + 1e-9 and n_u <= 1.05 * ideal + 2


def test_a_circle_keeps_three_steps_however_coarse():
    p = planned(sphere(), (True, False), POLES)
    assert lines.per_surface(p, lines.steps(p, np.array([[1e6, 1e6]])))[0].tolist() == [3, 2]


@pytest.mark.parametrize("along", [(0, 0, 1), (0, 0, -1), (-1, -1, -1), (1, 1, 1)])
def test_straight_lines_do_not_turn_whichever_way_they_run(along):
    sheared = np.eye(4)
    sheared[:3, 2] = along
    demand = lines.demand(transformed(cylinder(), sheared), np.array([True, False]), np.zeros(4, dtype=bool))
    assert demand.least.tolist() == [3, 1]
    assert demand.root_K[1].max() < 1e-6 < 0.1 < demand.root_K[0].max()


def test_steps_grow_with_the_root_of_the_tolerance():
    p = planned(sphere(), (True, False), POLES)
    counts = [lines.per_surface(p, lines.steps(p, np.array([[t, 1.0]])))[0].prod() for t in (1e-3, 1e-5)]
    assert counts[1] / counts[0] == pytest.approx(100, rel=0.05)


def test_a_flat_surface_is_one_cell():
    p = planned(rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]))
    count = lines.steps(p, np.array([[1e-12, 1e-12]]))
    assert [t.tolist() for t in lines.place(p, np.array([[1e-12, 1e-12]]), count)[0]] == [[0, 1], [0, 1]]


def test_lines_of_a_mirrored_set_are_their_own_mirror():
    p = planned(sphere(), (True, False), POLES)
    p = lines.plan(p.demands, lines.Links(p.links.group, p.links.is_reversed, np.array([True, True])))
    both = np.array([[1e-3, 1.0]])
    for t in lines.place(p, both, lines.steps(p, both))[0]:
        assert np.array_equal(t, 1 - t[::-1]) and (np.diff(t) > 0).all()
