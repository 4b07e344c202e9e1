"""Interior vertices of a trimmed surface: crossings of its lines that lie inside the loops and not near them, and the
cells between four of them.

Everything is counted along the lines, so that the cost is that of the border and the crossings, not their product.
"""

import numpy as np

NEAR = 0.4  # of the steps between lines: a crossing nearer to the border would make slivers there
SAMPLES = 4  # of the border in each step between lines
ON_LINE = 1e-9  # border points this near to a kink lie on it


class Grid:
    """Crossings of lines u, v (ascending, 0 and 1 among them) inside the segments A-B (e, 2) of loops.

    uv : (k, 2) the crossings;  number : (len(v), len(u)) int, which of them, -1 where there is none
    is_whole : (len(v) - 1, len(u) - 1) bool, cells between four of them that no border runs through
    """

    def __init__(self, A, B, u, v):
        self.u, self.v = u, v
        near, is_crossed = _nearness(A, B, u, v)
        is_free = np.zeros((v.size, u.size), dtype=bool)
        is_free[1:-1, 1:-1] = _inside(A, B, u[1:-1], v[1:-1]) & (near[1:-1, 1:-1] >= NEAR)
        j, i = np.nonzero(is_free)
        self.uv = np.stack([u[i], v[j]], axis=1)
        self.number = np.full(is_free.shape, -1)
        self.number[j, i] = np.arange(len(i))
        self.is_whole = is_free[:-1, :-1] & is_free[:-1, 1:] & is_free[1:, :-1] & is_free[1:, 1:] & ~is_crossed

    def dissolve(self, uv):
        """The cells with the points uv (n, 2) inside or on their border are whole no more."""
        for side_u in ("left", "right"):
            for side_v in ("left", "right"):
                i = np.clip(np.searchsorted(self.u, uv[:, 0], side=side_u) - 1, 0, self.u.size - 2)
                j = np.clip(np.searchsorted(self.v, uv[:, 1], side=side_v) - 1, 0, self.v.size - 2)
                self.is_whole[j, i] = False

    def cells(self):
        """Of the whole cells: triangles (m, 3) of the crossings, the edges (e, 2) around them all, and (k,) bool the
        crossings that lie inside.
        """
        n, w = self.number, self.is_whole
        corner = [x[w] for x in (n[:-1, :-1], n[:-1, 1:], n[1:, 1:], n[1:, :-1])]
        F = np.concatenate([np.stack([corner[0], corner[k], corner[k + 1]], axis=1) for k in (1, 2)])
        around = np.pad(w, 1)
        across_v = around[1:, 1:-1] != around[:-1, 1:-1]  # an edge along u between two cells
        across_u = around[1:-1, 1:] != around[1:-1, :-1]
        edges = np.concatenate(
            [
                np.stack([n[:, :-1][across_v], n[:, 1:][across_v]], axis=1),
                np.stack([n[:-1][across_u], n[1:][across_u]], axis=1),
            ]
        )
        inner = np.zeros(n.shape, dtype=bool)
        inner[1:-1, 1:-1] = w[:-1, :-1] & w[:-1, 1:] & w[1:, :-1] & w[1:, 1:]
        is_inner = np.zeros(len(self.uv), dtype=bool)
        is_inner[n[inner]] = True
        return F, edges, is_inner


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
    """Distance (len(v), len(u)) of each crossing from the segments, in steps between lines, inf beyond one step; and
    (len(v) - 1, len(u) - 1) bool, the cells they run through.
    """
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
    is_crossed = np.zeros((v.size - 1, u.size - 1), dtype=bool)
    is_crossed[j, i] = True
    return out, is_crossed


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
