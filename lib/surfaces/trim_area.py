"""Integrals over the part of a surface inside its trims: area, mean lengths.

By Green's theorem the integral of f over the inside of the loops is that of G dv along them, where G(u, v) is the
integral of f(., v) from 0 to u.  Steps cross no knot of the surface, where its derivatives jump.  Up to the last
line before u, G is the antiderivative of a polynomial through Gauss-Legendre nodes, the same for all loops; the rest is
a Gauss-Legendre sum.  Loops need no triangles for it, and one that crosses itself counts as often as it goes round.
"""

from functools import lru_cache

import numpy as np

from lib.nurbs.evaluate import densities
from lib.surfaces.loops import following
from lib.surfaces.trimmed import TrimmedSurface

CELLS = 16  # steps over [0, 1], more where knots are nearer
NODES = np.polynomial.legendre.leggauss(5)  # in each cell, and from its side to the loop
ALONG = {n: np.polynomial.legendre.leggauss(n) for n in (2, 3)}  # along each piece of a loop
SHORT = 1 / 64  # pieces that rise less take two nodes, most of them, the others three
REMEMBERED = 8  # surfaces


@lru_cache(maxsize=REMEMBERED)
def integrals(trim: TrimmedSurface):
    """Integrals of |S_u x S_v|, |S_u|, |S_v| and 1 over the (u, v) inside the loops: (4,)."""
    A, B = trim.uv, trim.uv[following(trim.loop_start)]
    steps = [_steps(knots) for knots in (trim.base.knots_u, trim.base.knots_v)]
    A, B = _split(A, B, steps)
    A, B = A[A[:, 1] != B[:, 1]], B[A[:, 1] != B[:, 1]]
    cell = [
        np.clip(np.searchsorted(t, x, side="right") - 1, 0, len(t) - 2)
        for t, x in zip(steps, (A + B).T / 2, strict=True)
    ]
    total = _up_to_lines(trim.base, A, B, cell, steps)
    is_short = np.abs(B[:, 1] - A[:, 1]) < SHORT
    for n, own in ((2, is_short), (3, ~is_short)):
        total = total + _from_lines(trim.base, A[own], B[own], steps[0][cell[0][own]], ALONG[n])
    return np.append(total, (A[:, 0] + B[:, 0]) @ (B[:, 1] - A[:, 1]) / 2)


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


def _up_to_lines(base, A, B, cell, steps):
    """What the pieces A-B (k, 2) of loops, each in its `cell` (u, v), sweep up to the side of the cell: (3,)."""
    x, weight = (NODES[0] + 1) / 2, NODES[1] / 2
    width, height = (np.diff(t) for t in steps)
    u, v = ((t[:-1, None] + np.diff(t)[:, None] * x).ravel() for t in steps)
    swept = densities(base, np.tile(u, v.size), np.repeat(v, u.size))
    swept = weight @ swept.reshape(height.size, x.size, width.size, x.size, 3)
    swept = np.cumsum(swept * width[:, None], axis=2)
    has_cells = cell[0] > 0
    column, row = cell[0][has_cells] - 1, cell[1][has_cells]
    start, end = (_antiderivatives((X[has_cells, 1] - steps[1][row]) / height[row]) for X in (A, B))
    return np.einsum("nqk,nq,n->k", swept[row, :, column], end - start, height[row])


def _antiderivatives(t):
    """Integrals (n, q) from 0 to t (n,) of the polynomials that are 1 at one node and 0 at the others."""
    x = (NODES[0] + 1) / 2
    powers = np.arange(x.size)
    coefficients = np.linalg.inv(x[:, None] ** powers)  # column q: of the polynomial of node q
    return (t[:, None] ** (powers + 1) / (powers + 1)) @ coefficients


def _from_lines(base, A, B, line, rule):
    """What the pieces A-B (k, 2) sweep from u = line (k,): (3,)."""
    along, dv = (rule[0] + 1) / 2, rule[1] / 2
    x, weight = (NODES[0] + 1) / 2, NODES[1] / 2
    at = A[:, None] + (B - A)[:, None] * along[:, None]
    rest = at[..., 0] - line[:, None]
    u = line[:, None, None] + rest[..., None] * x
    v = np.broadcast_to(at[..., 1:], u.shape)
    values = weight @ densities(base, *(np.clip(t.ravel(), 0.0, 1.0) for t in (u, v))).reshape(*u.shape, 3)
    return (rest * dv * (B - A)[:, 1:]).ravel() @ values.reshape(-1, 3)


def area(trim: TrimmedSurface):
    """Area inside the loops [square of the surface's unit]."""
    return float(integrals(trim)[0])


def extent(trim: TrimmedSurface):
    """(length_u, length_v): means of |S_u| and |S_v| over the part inside."""
    _, along_u, along_v, inside = integrals(trim)
    return float(along_u / inside), float(along_v / inside)
