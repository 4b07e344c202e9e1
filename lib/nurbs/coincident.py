"""Finds surfaces that lie in one another: the same one twice, or flat ones that overlap in a plane, lit on one side.

Which of the two a ray meets is then a matter of rounding.  Lit sides that face each other (a box on a floor) or turn
their backs (a wall of two sheets) are no such case.
"""

from itertools import combinations

import numpy as np

SAME = 1e-6  # of the scene's size: float32 rays can not tell
LEAST = 1e-6  # share of the smaller surface that must be covered
UPWARDS = np.array([0.43, 0.57, 0.70])  # tells the two sides of a plane apart; hardly any plane contains it


def coincident(surfaces, flip, size):
    """Pairs (a, b), a < b, ascending, of surfaces that coincide in part or in whole.

    surfaces : n NurbsSurface;  flip : (n,) bool;  size : largest side of the scene, > 0

    Flat quadrangles and triangles (2 x 2 control points) are compared by their overlap, others by control points.
    """
    flat = [k for k, s in enumerate(surfaces) if s.Pw.shape[:2] == (2, 2)]
    pairs = set(_overlapping(surfaces, flip, size, np.array(flat, dtype=int)))
    return sorted(pairs | set(_equal(surfaces, flip, size)))


def back_to_back(surfaces, flip, size):
    """(n,) bool: flat surfaces that overlap another one in their plane, lit on its other side.

    A wall of two sheets, a box on a floor: a ray may meet the back of one before the front of the other.
    """
    flat = np.array([k for k, s in enumerate(surfaces) if s.Pw.shape[:2] == (2, 2)], dtype=int)
    out = np.zeros(len(surfaces), dtype=bool)
    for pair in _overlapping(surfaces, flip, size, flat, opposite=True):
        out[list(pair)] = True
    return out


def _equal(surfaces, flip, size):
    """Pairs with equal control points."""
    kinds = {}
    for k, s in enumerate(surfaces):
        kinds.setdefault((s.Pw.shape, s.degree_u, s.degree_v, bool(flip[k])), []).append(k)
    for members in kinds.values():
        middle = np.array([surfaces[k].P.mean(axis=(0, 1)) for k in members])
        for group in _groups((middle - middle[0]) / size, SAME):
            for a, b in combinations([members[k] for k in group], 2):
                if np.abs(surfaces[a].P - surfaces[b].P).max() <= SAME * size:
                    yield a, b


def _overlapping(surfaces, flip, size, flat, opposite=False):
    """Pairs of planar quadrangles in one plane, lit on the same side (or opposite ones), whose interiors meet."""
    if flat.size < 2:
        return
    C = np.array([surfaces[k].P.reshape(4, 3)[[0, 2, 3, 1]] for k in flat])  # in their round
    C = (C - C.mean(axis=(0, 1))) / size
    N = np.cross(C[:, 2] - C[:, 0], C[:, 3] - C[:, 1])
    area = np.linalg.norm(N, axis=1) / 2
    N *= np.where(np.asarray(flip)[flat], -1.0, 1.0)[:, None] / (2 * np.maximum(area, 1e-300))[:, None]
    side = np.where(opposite & (N @ UPWARDS < 0), -1.0, 1.0)
    N *= side[:, None]
    d = np.einsum("kc,kc->k", N, C.mean(axis=1))
    planar = (np.abs(np.einsum("kpc,kc->kp", C, N) - d[:, None]).max(axis=1) <= SAME) & (area > 0)
    index = np.flatnonzero(planar)
    for group in _groups(np.concatenate([N, d[:, None]], axis=1)[index], 2 * SAME):
        for a, b in _boxes_that_meet(C.min(axis=1), C.max(axis=1), index[group]):
            if opposite == (side[a] != side[b]) and _overlap(C[a], C[b], N[a]) > LEAST * min(area[a], area[b]):
                yield tuple(sorted((int(flat[a]), int(flat[b]))))


def _groups(x, r):
    """Groups (index arrays, at least two members) of points (n, k) linked by steps <= r in every coordinate."""
    label = np.zeros(len(x), dtype=int)
    for column in x.T:
        order = np.lexsort((column, label))
        new = (np.diff(label[order]) != 0) | (np.diff(column[order]) > r)
        label[order] = np.concatenate([[0], np.cumsum(new)])
    order = np.argsort(label, kind="stable")
    return [group for group in np.split(order, np.flatnonzero(np.diff(label[order])) + 1) if len(group) > 1]


def _boxes_that_meet(low, high, group):
    """Pairs of a group whose flat boxes low..high (n, 3) share more than an edge: a sweep along its longest side."""
    low, high = low[group], high[group]
    axis = int(np.argmax(high.max(axis=0) - low.min(axis=0)))
    order = np.argsort(low[:, axis], kind="stable")
    low, high, group = low[order], high[order], group[order]
    end = np.searchsorted(low[:, axis], high[:, axis], side="right")
    for a in range(len(group)):
        b = np.arange(a + 1, end[a])
        shared = np.minimum(high[a], high[b]) - np.maximum(low[a], low[b])
        meets = (shared >= -SAME).all(axis=1) & ((shared > SAME).sum(axis=1) >= 2)
        yield from ((group[a], group[k]) for k in b[meets])


def _overlap(A, B, N):
    """Area common to two convex polygons (4, 3) in the plane with normal N (Sutherland, Hodgman 1974)."""
    axis = np.argsort(np.abs(N))[:2]  # dropping the largest component keeps the shape
    clip, scale = _turned(B[:, axis]), 1 / np.abs(N).max()
    polygon = list(_turned(A[:, axis]))
    for p, q in zip(clip, np.roll(clip, -1, axis=0), strict=True):
        side = [(q[0] - p[0]) * (x[1] - p[1]) - (q[1] - p[1]) * (x[0] - p[0]) for x in polygon]
        kept = []
        for k, x in enumerate(polygon):
            if side[k - 1] * side[k] < 0:
                kept.append(polygon[k - 1] + (x - polygon[k - 1]) * side[k - 1] / (side[k - 1] - side[k]))
            if side[k] >= 0:
                kept.append(x)
        polygon = kept
        if len(polygon) < 3:
            return 0.0
    return abs(_signed(np.array(polygon))) * scale


def _turned(polygon):
    """The polygon (n, 2) counter-clockwise."""
    return polygon if _signed(polygon) >= 0 else polygon[::-1]


def _signed(polygon):
    x, y = polygon.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
