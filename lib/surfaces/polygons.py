"""Polygons in space cut into triangles: fans where they are convex, else ears."""

import numpy as np

MOST_CORNERS = 2000  # of one concave polygon: ears cost corners squared


def triangles(P, start):
    """Cut polygons into triangles with the same winding.

    P : (c, 3) float64 positions of the corners, polygon after polygon;  start : (f + 1,) where each begins, >= 3 apart
    Returns (corner, polygon): (t, 3) indices into P, (t,) of the polygon, in their order; a polygon of n corners makes
    n - 2 triangles.

    Raises ValueError `polygon K: ...` for a concave one of more than MOST_CORNERS corners.
    """
    count = np.diff(start)
    corner, polygon = [], []
    for n in np.unique(count).tolist():
        which = np.flatnonzero(count == n)
        index = start[which][:, None] + np.arange(n)
        fan = np.stack([np.zeros(n - 2, dtype=np.int64), np.arange(1, n - 1), np.arange(2, n)], axis=1)
        cut = index[:, fan]
        for k in np.flatnonzero(_is_concave(P[index])).tolist() if n > 3 else ():
            if n > MOST_CORNERS:
                raise ValueError(f"polygon {which[k]}: concave, with {n} corners; allowed: at most {MOST_CORNERS}")
            cut[k] = index[k][_ears(P[index[k]])]
        corner.append(cut.reshape(-1, 3))
        polygon.append(np.repeat(which, n - 2))
    if not corner:
        return np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64)
    corner, polygon = np.concatenate(corner), np.concatenate(polygon)
    order = np.argsort(polygon, kind="stable")
    return corner[order], polygon[order]


def _turns(P):
    """How much each corner of polygons P (f, n, 3) turns left about the polygon's normal, times lengths: (f, n)."""
    P = P - P[:, :1]
    ahead = np.roll(P, -1, axis=1)
    N = np.cross(P, ahead).sum(axis=1)  # Newell's normal: twice the area
    edge = ahead - P
    return np.einsum("fnk,fk->fn", np.cross(np.roll(edge, 1, axis=1), edge), N)


def _is_concave(P):
    """(f,) bool of polygons P (f, n, 3): a corner turns right, by more than rounding in float32."""
    turns = _turns(P)
    return turns.min(axis=1) < -1e-6 * np.abs(turns).max(axis=1)


def _ears(P):
    """Triangles (n - 2, 3) of one polygon P (n, 3), cutting off in turn the ear nearest to equal sides."""
    P = P - P.mean(axis=0)
    N = np.cross(P, np.roll(P, -1, axis=0)).sum(axis=0)
    axis = int(np.argmax(np.abs(N)))
    side = 1.0 if N[axis] > 0 else -1.0  # seen from the front it runs counterclockwise
    xy = np.stack([P[:, (axis + 1) % 3], side * P[:, (axis + 2) % 3]], axis=1)
    left = list(range(len(P)))
    out = []
    while len(left) > 3:
        best = _best_ear(xy[left])
        n = len(left)
        out.append((left[best - 1], left[best], left[(best + 1) % n]))
        del left[best]
    return np.array([*out, tuple(left)], dtype=np.int64)


def _best_ear(xy):
    """The corner to cut off: convex, nothing inside, the roundest; if there is none (edges cross) the flattest one."""
    before, after = np.roll(xy, 1, axis=0), np.roll(xy, -1, axis=0)
    turn = _cross(xy - before, after - xy)
    size = ((xy - before) ** 2 + (after - xy) ** 2 + (before - after) ** 2).sum(axis=1)
    roundness = turn / np.where(size > 0, size, 1.0)
    for k in np.argsort(-roundness, kind="stable").tolist():
        if turn[k] <= 0:
            break
        a, b, c = before[k], xy[k], after[k]
        inside = (_cross(b - a, xy - a) >= 0) & (_cross(c - b, xy - b) >= 0) & (_cross(a - c, xy - c) >= 0)
        # A keyhole lists a corner twice: what lies on a corner of the ear is not inside it.
        inside &= ~((xy == a).all(axis=1) | (xy == b).all(axis=1) | (xy == c).all(axis=1))
        if not inside.any():
            return k
    return int(np.argmin(np.abs(roundness)))


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
