"""Interior vertices of a trimmed surface: crossings of its lines that lie inside the loops and not near them.

Everything is counted along the lines, so that the cost is that of the border and the crossings, not their product.
"""

import numpy as np

NEAR = 0.4  # of the steps between lines: a crossing nearer to the border would make slivers there
SAMPLES = 4  # of the border in each step between lines
ON_LINE = 1e-9  # border points this near to a kink lie on it


def nodes(A, B, u, v):
    """Crossings (k, 2) of the lines u, v (ascending, 0 and 1 among them) inside the segments A-B (e, 2) of loops."""
    U, V = u[1:-1], v[1:-1]
    if not (U.size and V.size):
        return np.empty((0, 2))
    is_free = _inside(A, B, U, V) & (_nearness(A, B, u, v)[1:-1, 1:-1] >= NEAR)
    j, i = np.nonzero(is_free)
    return np.stack([U[i], V[j]], axis=1)


def _inside(A, B, U, V):
    """(len(V), len(U)) bool: the crossing lies inside the loops, by the borders crossed on the way from u = 0."""
    line, crossing = crossings(A, B, V)
    count = np.zeros((V.size, U.size + 1), dtype=np.int64)
    np.add.at(count, (line, np.searchsorted(U, crossing)), 1)
    return np.cumsum(count, axis=1)[:, :-1] % 2 == 1


def crossings(A, B, lines):
    """Where the segments A-B cross the lines of constant second coordinate (ascending): line (c,) int, first
    coordinate (c,).  A segment's lower end counts, its upper one does not.
    """
    low, high = np.minimum(A[:, 1], B[:, 1]), np.maximum(A[:, 1], B[:, 1])
    first, last = np.searchsorted(lines, low), np.searchsorted(lines, high)
    count = last - first
    own = np.repeat(np.arange(len(A)), count)
    line = first[own] + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    t = (lines[line] - A[own, 1]) / (B[own, 1] - A[own, 1])
    return line, A[own, 0] + t * (B[own, 0] - A[own, 0])


def _nearness(A, B, u, v):
    """(len(v), len(u)) distance of each crossing from the segments, in steps between lines; inf beyond one step."""
    out = np.full((v.size, u.size), np.inf)
    columns, rows = np.arange(u.size), np.arange(v.size)
    step = [np.abs(np.interp(B[:, d], t, n) - np.interp(A[:, d], t, n)) for d, t, n in ((0, u, columns), (1, v, rows))]
    count = np.ceil(SAMPLES * np.maximum(*step)).astype(np.int64) + 1
    own = np.repeat(np.arange(len(A)), count)
    t = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)) / count[own]
    at = A[own] + t[:, None] * (B - A)[own]
    x, y = np.interp(at[:, 0], u, columns), np.interp(at[:, 1], v, rows)
    i, j = np.minimum(x.astype(np.int64), u.size - 2), np.minimum(y.astype(np.int64), v.size - 2)
    for di in (0, 1):
        for dj in (0, 1):
            np.minimum.at(out, (j + dj, i + di), np.hypot(x - i - di, y - j - dj))
    return out


def creases(uv, A, B, kinks):
    """Edges (e, 2) between the points uv (k, 2) that follow one another on a line of `kinks` (u, v), inside A-B."""
    out = []
    for d, lines in enumerate(kinks):
        across, ends = uv[:, d], [X[:, ::-1] if d == 0 else X for X in (A, B)]
        line, cut = crossings(*ends, lines)
        for k, at in enumerate(lines):
            own = np.flatnonzero(np.abs(across - at) <= ON_LINE)
            own = own[np.argsort(uv[own, 1 - d], kind="stable")]
            t, border = uv[own, 1 - d], np.sort(cut[line == k])
            before = np.searchsorted(border, t[:-1] + ON_LINE)
            is_free = (before == np.searchsorted(border, t[1:] - ON_LINE)) & (before % 2 == 1)
            out.append(np.stack([own[:-1], own[1:]], axis=1)[is_free])
    return np.concatenate(out) if out else np.empty((0, 2), dtype=np.int64)
