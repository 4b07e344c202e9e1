"""Loops in the plane of (u, v): what follows what, and which points lie inside."""

import numpy as np

AT_ONCE = 4_000_000  # pairs of a point and an edge


def following(loop_start):
    """The border point after each (k,) int64, round each loop of `loop_start` (m + 1,)."""
    after = np.arange(1, loop_start[-1] + 1, dtype=np.int64)
    after[np.asarray(loop_start[1:]) - 1] = loop_start[:-1]
    return after


def inside(trim, uv):
    """(n,) bool: the points uv (n, 2) lie inside the loops of a TrimmedSurface; those on the border on either side."""
    return inside_loops(trim.uv, trim.uv[following(trim.loop_start)], uv)


def inside_loops(A, B, uv):
    """(n,) bool: the points uv (n, 2) lie inside loops made of the segments A-B (e, 2).

    A ray along u crosses the loops an odd number of times.
    """
    uv = np.asarray(uv, dtype=np.float64)
    rises = B[:, 1] > A[:, 1]
    low, high = np.where(rises[:, None], A, B), np.where(rises[:, None], B, A)
    low, high = (x[A[:, 1] != B[:, 1]] for x in (low, high))
    along = high - low
    out = np.zeros(len(uv), dtype=bool)
    order = np.argsort(uv[:, 1], kind="stable")  # points that lie near together meet few segments
    step = max(1, AT_ONCE // max(len(low), 1))
    step = min(step, max(64, len(uv) // 16))
    for first in range(0, len(uv), step):
        part = order[first : first + step]
        u, v = (x[:, None] for x in uv[part].T)
        near = (low[:, 1] <= v[-1]) & (high[:, 1] > v[0])
        p, q, a = low[near], high[near], along[near]
        beside = (p[:, 1] <= v) & (v < q[:, 1])
        left = (u - p[:, 0]) * a[:, 1] < (v - p[:, 1]) * a[:, 0]
        out[part] = (beside & left).sum(axis=1) % 2 == 1
    return out
