"""How far a polyline may be simplified before each of its points is dropped.

Source: Douglas, Peucker 1973, with the order of the splits kept in the numbers.
"""

import math

import numpy as np

from lib.compiled import compiled
from lib.nurbs.curve_kernels import off_segment


def significance(points):
    """Tolerances (k,) up to which each point of a polyline (k, 3) is kept; inf at both ends.

    The points with significance > t make a polyline within t of the whole one; which these are does not depend on the
    direction.  A point's value is its distance from the chord at whose split it is the farthest, or that of the split
    before it where this is less: the kept points of a larger t are among those of a smaller one.

    >>> significance(np.array([[0, 0, 0], [1, 0, 0], [2, 1, 0], [4, 0, 0.0]])).round(3).tolist()
    [inf, 0.447, 1.0, inf]
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    differs = np.flatnonzero((points != points[::-1]).any(axis=1))
    is_turned = differs.size and tuple(points[differs[0]]) > tuple(points[-1 - differs[0]])
    result = np.empty(len(points))
    _split(np.ascontiguousarray(points[::-1]) if is_turned else points, np.empty(len(points), dtype=np.int64), result)
    return result[::-1].copy() if is_turned else result


@compiled("f8[:,:], i8[:], f8[:]")
def _split(points, ends, value):
    """Put the significance of points (k, 3) into value (k,); ends (k,) is for the ends of pieces not yet looked at."""
    if len(points) == 0:
        return 0
    value[0] = value[len(points) - 1] = math.inf
    start, waiting = 0, 1
    ends[0] = len(points) - 1
    while waiting > 0:
        end = ends[waiting - 1]
        if end - start < 2:
            start, waiting = end, waiting - 1
            continue
        # The point farthest from the chord, the first of those as far
        most, farthest = -1.0, start + 1
        for i in range(start + 1, end):
            far = off_segment(points, i, points, start, end)
            if far > most:
                most, farthest = far, i
        # One of the ends is the split before this one, and the other has no smaller value
        value[farthest] = min(most, value[start], value[end])
        ends[waiting] = farthest
        waiting += 1
    return 0
