"""Elements under walls fall into parts: drawn by hand, 4 x 4 points each."""

import numpy as np

from lib.elements.parts import parts


def links(rows, columns):
    return np.zeros((rows, columns - 1), dtype=bool), np.zeros((rows - 1, columns), dtype=bool)


def test_nothing_in_between_keeps_everything_together():
    found = parts(*links(8, 12), np.ones((8, 12), dtype=bool))
    assert found.keeps.all() and not found.is_alone.any() and found.keeps.shape == (6, 16)


def test_a_wall_through_an_element_keeps_the_larger_part():
    """Columns 0 | 1 2 3 of the second element of two: the wall stands behind its first column."""
    blocked_u, blocked_v = links(4, 8)
    blocked_u[:, 4] = True
    found = parts(blocked_u, blocked_v, np.ones((4, 8), dtype=bool))
    assert found.keeps[0].all()
    assert found.keeps[1].reshape(4, 4).tolist() == [[False, True, True, True]] * 4
    assert found.is_alone.tolist() == [False, True]


def test_a_wall_between_elements_parts_none_but_parts_their_lookups():
    blocked_u, blocked_v = links(8, 8)
    blocked_v[3] = True  # between the two rows of elements
    found = parts(blocked_u, blocked_v, np.ones((8, 8), dtype=bool))
    assert found.keeps.all() and found.is_alone.all()
    blocked_v[3, 0] = False  # a gap at one point joins the elements on the left
    assert parts(blocked_u, blocked_v, np.ones((8, 8), dtype=bool)).is_alone.tolist() == [False, True, False, True]


def test_a_table_leg_cuts_nothing():
    """One point walled in on all sides but usable is dropped; light goes round it."""
    blocked_u, blocked_v = links(4, 4)
    blocked_u[1, 0] = blocked_u[1, 1] = blocked_v[0, 1] = blocked_v[1, 1] = True
    found = parts(blocked_u, blocked_v, np.ones((4, 4), dtype=bool))
    assert found.keeps.sum() == 15 and not found.keeps[0, 5]
    buried = np.ones((4, 4), dtype=bool)
    buried[1, 1] = False  # the point under the leg, as the back faces tell
    found = parts(blocked_u, blocked_v, buried)
    assert found.keeps.sum() == 15 and not found.is_alone.any()


def test_a_winding_way_still_connects():
    """A comb: rows joined at alternating ends only."""
    blocked_u, blocked_v = links(4, 4)
    blocked_v[:] = True
    blocked_v[0, 3] = blocked_v[1, 0] = blocked_v[2, 3] = False
    found = parts(blocked_u, blocked_v, np.ones((4, 4), dtype=bool))
    assert found.keeps.all() and not found.is_alone.any()


def test_an_element_all_hidden_keeps_nothing():
    found = parts(*links(4, 4), np.zeros((4, 4), dtype=bool))
    assert not found.keeps.any() and not found.is_alone.any()
