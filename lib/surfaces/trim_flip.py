"""Diagonals that lie closer to the surface: Delaunay knows (u, v) alone.

A data dependent triangulation (Dyn, Levin, Rippa 1990): of the two diagonals of two neighbouring triangles, one of
them too far off, the one is taken whose middle is nearer to the surface.
"""

import numpy as np

from lib.nurbs.evaluate import evaluate
from lib.surfaces.loops import double_area

PASSES = 3
BETTER = 0.9  # of the other's distance, to be taken
CONVEX = 1e-3  # least share of the two triangles' area that each of the new ones has


def flipped(base, S, uv, F, is_failing, fixed):
    """Triangles F (m, 3) of points S (k, 3) at uv (k, 2), diagonals of the failing ones (m,) flipped where that is
    closer; the edges `fixed` (e, 2) stay.  At once only pairs that have no triangle in common.
    """
    F, is_failing = F.copy(), is_failing.copy()
    n = len(S)
    fixed = np.unique(np.sort(fixed, axis=1) @ [n, 1])
    for _ in range(PASSES):
        first, second, a, b, c, d = _pairs(F, is_failing, fixed, n)
        old, new = _off(base, S, uv, a, b), _off(base, S, uv, c, d)
        A, B, C, D = (uv[corner] for corner in (a, b, c, d))
        whole = double_area(A, B, C) + double_area(B, A, D)
        least = np.minimum(double_area(A, D, C), double_area(D, B, C))
        good = np.flatnonzero((new < BETTER * old) & (least > CONVEX * whole))
        if not good.size:
            break
        rank = np.empty(good.size, dtype=np.int64)
        rank[np.argsort(new[good] - old[good], kind="stable")] = np.arange(good.size)
        best = np.full(len(F), good.size)
        np.minimum.at(best, first[good], rank)
        np.minimum.at(best, second[good], rank)
        take = good[(best[first[good]] == rank) & (best[second[good]] == rank)]
        F[first[take]] = np.stack([a[take], d[take], c[take]], axis=1)
        F[second[take]] = np.stack([d[take], b[take], c[take]], axis=1)
        is_failing[first[take]] = is_failing[second[take]] = True
    return F


def _pairs(F, is_failing, fixed, n):
    """Pairs of triangles with a diagonal that may flip: first (p,), second (p,), the diagonal a-b, opposite it c in
    the first and d in the second.
    """
    a, b, c = (np.roll(F, -k, axis=1).ravel() for k in range(3))
    owner = np.repeat(np.arange(len(F)), 3)
    key = np.minimum(a, b) * n + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    two = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    i, j = order[two], order[two + 1]
    may = (is_failing[owner[i]] | is_failing[owner[j]]) & ~np.isin(key[i], fixed) & (a[i] == b[j])
    i, j = i[may], j[may]
    return owner[i], owner[j], a[i], b[i], c[i], c[j]


def _off(base, S, uv, a, b):
    """Distance of the surface from the middles of the edges a-b."""
    at = np.clip((uv[a] + uv[b]) / 2, 0.0, 1.0)
    return np.linalg.norm(evaluate(base, at[:, 0], at[:, 1])[0] - (S[a] + S[b]) / 2, axis=1)
