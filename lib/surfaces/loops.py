"""Loops in the plane of (u, v): what follows what, and which points lie inside."""

import numpy as np

AT_ONCE = 4_000_000  # pairs of a point and an edge


def following(loop_start):
    """The border point after each (k,) int64, round each loop of `loop_start` (m + 1,)."""
    after = np.arange(1, loop_start[-1] + 1, dtype=np.int64)
    after[np.asarray(loop_start[1:]) - 1] = loop_start[:-1]
    return after


def inside(trim, uv):
    """(n,) bool: the points uv (n, 2) lie inside the loops of a TrimmedSurface.

    A ray along u crosses the border an odd number of times.  Points on the border are on either side.
    """
    uv, A = np.asarray(uv, dtype=np.float64), trim.uv
    B = A[following(trim.loop_start)]
    rises = B[:, 1] > A[:, 1]
    low, high = np.where(rises[:, None], A, B), np.where(rises[:, None], B, A)
    low, high = (x[A[:, 1] != B[:, 1]] for x in (low, high))
    along = high - low
    out = np.zeros(len(uv), dtype=bool)
    step = max(1, AT_ONCE // max(len(low), 1))
    for first in range(0, len(uv), step):
        u, v = (x[:, None] for x in uv[first : first + step].T)
        beside = (low[:, 1] <= v) & (v < high[:, 1])
        left = (u - low[:, 0]) * along[:, 1] < (v - low[:, 1]) * along[:, 0]
        out[first : first + step] = (beside & left).sum(axis=1) % 2 == 1
    return out
