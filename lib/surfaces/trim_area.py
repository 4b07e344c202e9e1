"""Integrals over the part of a surface inside its trims: area, mean lengths.

By Green's theorem the integral of f over the inside of the loops is that of G dv along them, where G(u, v) is the
integral of f(., v) from 0 to u.  Both are Gauss-Legendre sums over steps that cross no knot of the surface, where its
derivatives jump.  Loops need no triangles for it, and one that crosses itself counts as often as it goes round.
"""

import numpy as np

from lib.nurbs.evaluate import evaluate, evaluate_grid
from lib.surfaces.loops import following
from lib.surfaces.trimmed import TrimmedSurface

CELLS = 16  # steps over [0, 1], more where knots are nearer
ACROSS = np.polynomial.legendre.leggauss(4)  # along u
ALONG = np.polynomial.legendre.leggauss(3)  # along the loops


def integrals(trim: TrimmedSurface):
    """Integrals of |S_u x S_v|, |S_u|, |S_v| and 1 over the (u, v) inside the loops: (4,)."""
    A, B = trim.uv, trim.uv[following(trim.loop_start)]
    steps = [_steps(knots) for knots in (trim.base.knots_u, trim.base.knots_v)]
    A, B = _split(A, B, steps)
    x, weight = (ALONG[0] + 1) / 2, ALONG[1] / 2
    uv = (A[:, None] + (B - A)[:, None] * x[:, None]).reshape(-1, 2)
    dv = ((B - A)[:, 1:] * weight).ravel()
    uv, dv = np.clip(uv[dv != 0], 0.0, 1.0), dv[dv != 0]
    return dv @ _from_zero(trim.base, uv, steps[0])


def _steps(knots):
    """Ascending parameters from 0 to 1, knots among them."""
    spans = np.unique(np.concatenate([[0.0, 1.0], knots[(knots > 0) & (knots < 1)]]))
    parts = np.ceil(np.diff(spans) * CELLS).astype(int)
    lines = [a + (b - a) * np.arange(n) / n for a, b, n in zip(spans[:-1], spans[1:], parts, strict=True)]
    return np.concatenate([*lines, [1.0]])


def _split(A, B, steps):
    """The segments A-B (k, 2), cut where they cross the lines u = steps[0] and v = steps[1]."""
    row, t = [np.arange(len(A))], [np.zeros(len(A))]
    for d, lines in enumerate(steps):
        low, high = np.minimum(A[:, d], B[:, d]), np.maximum(A[:, d], B[:, d])
        first, last = np.searchsorted(lines, low, side="right"), np.searchsorted(lines, high, side="left")
        count = np.maximum(last - first, 0)
        own = np.repeat(np.arange(len(A)), count)
        line = lines[first[own] + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)]
        row.append(own)
        t.append((line - A[own, d]) / (B[own, d] - A[own, d]))
    row, t = np.concatenate(row), np.concatenate(t)
    order = np.lexsort((t, row))
    row, t = row[order], t[order]
    end = np.append(t[1:], 1.0)
    end[np.append(row[1:] != row[:-1], True)] = 1.0
    along = (B - A)[row]
    return A[row] + t[:, None] * along, A[row] + end[:, None] * along


def _from_zero(base, uv, lines):
    """Integrals (n, 4) of |S_u x S_v|, |S_u|, |S_v| and 1 along u, from (0, v) to the points uv (n, 2)."""
    x, weight = (ACROSS[0] + 1) / 2, ACROSS[1] / 2
    width = np.diff(lines)
    v, row = np.unique(uv[:, 1], return_inverse=True)
    _, S_u, S_v = evaluate_grid(base, (lines[:-1, None] + width[:, None] * x).ravel(), v)
    whole = _densities(S_u, S_v).reshape(v.size, width.size, x.size, 3)
    whole = np.einsum("vcqk,q,c->vck", whole, weight, width)
    whole = np.concatenate([np.zeros((v.size, 1, 3)), np.cumsum(whole, axis=1)], axis=1)
    cell = np.clip(np.searchsorted(lines, uv[:, 0], side="right") - 1, 0, width.size - 1)
    rest = uv[:, 0] - lines[cell]
    u = lines[cell][:, None] + rest[:, None] * x
    _, S_u, S_v = evaluate(base, u.ravel(), np.repeat(uv[:, 1], x.size))
    part = _densities(S_u, S_v).reshape(len(uv), x.size, 3)
    inside = whole[row.ravel(), cell] + np.einsum("nqk,q,n->nk", part, weight, rest)
    return np.concatenate([inside, uv[:, :1]], axis=1)


def _densities(S_u, S_v):
    return np.stack([np.linalg.norm(x, axis=-1) for x in (np.cross(S_u, S_v), S_u, S_v)], axis=-1)


def area(trim: TrimmedSurface):
    """Area inside the loops [square of the surface's unit]."""
    return float(integrals(trim)[0])


def extent(trim: TrimmedSurface):
    """(length_u, length_v): means of |S_u| and |S_v| over the part inside."""
    _, along_u, along_v, inside = integrals(trim)
    return float(along_u / inside), float(along_v / inside)
