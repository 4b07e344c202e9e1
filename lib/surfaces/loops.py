"""Loops in the plane of (u, v): what follows what, and which points lie inside."""

import numpy as np

AT_ONCE = 4_000_000  # pairs of a point and an edge


def following(loop_start):
    """The border point after each (k,) int64, round each loop of `loop_start` (m + 1,)."""
    after = np.arange(1, loop_start[-1] + 1, dtype=np.int64)
    after[np.asarray(loop_start[1:]) - 1] = loop_start[:-1]
    return after


def corner_runs(trim):
    """Border points (k,) of each run of a TrimmedSurface from corner to corner, both among them; a loop without a
    corner is one run from its first point round to that."""
    out = []
    for a, b in zip(trim.loop_start[:-1], trim.loop_start[1:], strict=True):
        corner = np.flatnonzero(np.isinf(trim.significance[a:b]))
        corner = corner if corner.size else np.array([0])
        loop = np.roll(np.arange(a, b), -corner[0])
        loop = np.append(loop, loop[0])
        bounds = np.append(corner - corner[0], b - a)
        out += [loop[i : j + 1] for i, j in zip(bounds[:-1], bounds[1:], strict=True)]
    return out


def signed_area(uv):
    """Area of a polygon (k, 2), > 0 if it runs counterclockwise.

    >>> float(signed_area(np.array([[0, 0], [2, 0], [2, 1], [0, 1.0]])))
    2.0
    """
    x, y = (uv - uv[0]).T
    return (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def double_area(a, b, c):
    """Twice the area of triangles (..., 2) in the plane, > 0 where they run counterclockwise."""
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])


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
