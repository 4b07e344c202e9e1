"""Point location: which of many triangles in the plane holds a place, found through cells of equal size.

Each cell lists the triangles that reach into it, row by row as far as they do there, so that slivers fill no boxes.
"""

import numpy as np

from lib.compiled import compiled, inlined

MOST_CELLS = 1024  # along a side
EDGE = 1e-9  # of a triangle's height: places so little outside still belong to it


class PointLocation:
    """Triangles (m, 3, 2) in [0, 1] x [0, 1], wound either way; where they overlap, the clearest counts."""

    def __init__(self, corner):
        self.corner = np.ascontiguousarray(corner, dtype=np.float64)
        self._side = int(np.clip(np.sqrt(2 * len(self.corner)), 1, MOST_CELLS))
        start = np.zeros(self._side**2 + 2, dtype=np.int64)
        total = _sorted_in(self.corner, self._side, start[2:], np.empty(0, dtype=np.int64))
        start, self._order = np.cumsum(start), np.empty(total, dtype=np.int64)
        _sorted_in(self.corner, self._side, start[1:], self._order)
        self._start = start[:-1].copy()

    def at(self, places):
        """(n,) int64: the triangle at each of places (n, 2), -1 outside of all."""
        found = np.empty(len(places), dtype=np.int64)
        places = np.ascontiguousarray(places, dtype=np.float64)
        _find(self.corner, self._order, self._start, self._side, places, found)
        return found

    def labels(self, label, rows, columns, places, owner):
        """Labels in the cells of a uniform grid: (smallest of the cell (rows, columns) int64, -1 where none is; bool,
        more than one).

        label (m,) int64 >= 0 of the triangles;  a cell has that of the triangle at its middle, and those of the
        triangles owner (k,) whose places (k, 2) lie in it
        """
        low, is_mixed = np.empty((rows, columns), dtype=np.int64), np.zeros((rows, columns), dtype=bool)
        _label(self.corner, self._order, self._start, self._side, label, places, owner, low, is_mixed)
        return low, is_mixed


@inlined
def cell_of(x, side):
    """The cell of a side that holds x, of those at the ends what is beyond."""
    return int(min(max(x * side, 0.0), side - 1.0))


@inlined
def reach(corner, k, low, high, sign):
    """The largest sign x of triangle k where low <= y <= high; -2 where it is not."""
    most = -2.0
    for a in range(3):
        b = (a + 1) % 3
        x, y, dx, dy = (
            corner[k, a, 0],
            corner[k, a, 1],
            corner[k, b, 0] - corner[k, a, 0],
            corner[k, b, 1] - corner[k, a, 1],
        )
        first, last = 0.0, 1.0
        if dy != 0.0:
            s, t = (low - y) / dy, (high - y) / dy
            first, last = max(first, min(s, t)), min(last, max(s, t))
        elif y < low or y > high:
            last = -1.0
        if first <= last:
            most = max(most, max(sign * (x + first * dx), sign * (x + last * dx)))
    return most


@inlined
def lowest(corner, k):
    """The least y of triangle k."""
    return min(corner[k, 0, 1], min(corner[k, 1, 1], corner[k, 2, 1]))


@inlined
def highest(corner, k):
    """The greatest y of triangle k."""
    return max(corner[k, 0, 1], max(corner[k, 1, 1], corner[k, 2, 1]))


@compiled("f8[:,:,:], i8, i8[:], i8[:]")
def _sorted_in(corner, side, start, order):
    """Put the triangles that reach into cell c at order[start[c]:], in ascending order; start[c] is the end of them
    then.  Without an order they are counted alone, from start[c] on.  Returns how many there are in all cells.
    """
    total = 0
    for k in range(len(corner)):
        for j in range(cell_of(lowest(corner, k) - EDGE, side), cell_of(highest(corner, k) + EDGE, side) + 1):
            low, high = j / side - EDGE, (j + 1) / side + EDGE
            first, last = -reach(corner, k, low, high, -1.0) - EDGE, reach(corner, k, low, high, 1.0) + EDGE
            if last < first:
                continue
            for i in range(cell_of(first, side), cell_of(last, side) + 1):
                if len(order):
                    order[start[j * side + i]] = k
                start[j * side + i] += 1
                total += 1
    return total


@inlined
def triangle_at(corner, order, start, side, u, v):
    """The triangle that holds (u, v) most clearly, -1 if none does."""
    cell, best, found = cell_of(v, side) * side + cell_of(u, side), -EDGE, -1
    for n in range(start[cell], start[cell + 1]):
        k = order[n]
        ex, ey = corner[k, 1, 0] - corner[k, 0, 0], corner[k, 1, 1] - corner[k, 0, 1]
        fx, fy = corner[k, 2, 0] - corner[k, 0, 0], corner[k, 2, 1] - corner[k, 0, 1]
        px, py = u - corner[k, 0, 0], v - corner[k, 0, 1]
        double = ex * fy - ey * fx
        if double != 0.0:
            second, third = (px * fy - py * fx) / double, (ex * py - ey * px) / double
            least = min(1.0 - second - third, min(second, third))
            if least > best:
                best, found = least, k
    return found


@compiled("f8[:,:,:], i8[:], i8[:], i8, f8[:,:], i8[:]")
def _find(corner, order, start, side, places, found):
    """Put the triangle at each of places (n, 2) into found (n,)."""
    for q in range(len(places)):
        found[q] = triangle_at(corner, order, start, side, places[q, 0], places[q, 1])
    return 0


@compiled("f8[:,:,:], i8[:], i8[:], i8, i8[:], f8[:,:], i8[:], i8[:,:], b1[:,:]")
def _label(corner, order, start, side, label, places, owner, low, is_mixed):
    """What `labels` returns, in low and is_mixed (rows, columns)."""
    rows, columns = low.shape
    for j in range(rows):
        for i in range(columns):
            k = triangle_at(corner, order, start, side, (i + 0.5) / columns, (j + 0.5) / rows)
            low[j, i] = label[k] if k >= 0 else -1
    for n in range(len(places)):
        i, j = cell_of(places[n, 0], columns), cell_of(places[n, 1], rows)
        own = label[owner[n]]
        if low[j, i] >= 0 and low[j, i] != own:
            is_mixed[j, i] = True
        if low[j, i] < 0 or own < low[j, i]:
            low[j, i] = own
    return 0


@compiled("f8[:,:,:], b1[:,:], i8[:], f8[:,:], f8, f8[:,:]")
def move_in(corner, is_border, face, places, inside, moved):
    """Put places (n, 2) of the triangles face (n,) into moved (n, 2), drawn towards the middle where they lie within
    `inside` of an edge that is_border (m, 3), opposite to each corner; at most a quarter of the height in.
    """
    for n in range(len(places)):
        k = face[n]
        ex, ey = corner[k, 1, 0] - corner[k, 0, 0], corner[k, 1, 1] - corner[k, 0, 1]
        fx, fy = corner[k, 2, 0] - corner[k, 0, 0], corner[k, 2, 1] - corner[k, 0, 1]
        px, py = places[n, 0] - corner[k, 0, 0], places[n, 1] - corner[k, 0, 1]
        double = ex * fy - ey * fx
        if abs(double) <= 1e-300:
            double = 1e-300
        second = (px * fy - py * fx) / double
        third = (ex * py - ey * px) / double
        first, second, third = max(1.0 - second - third, 0.0), max(second, 0.0), max(third, 0.0)
        total = max(first + second + third, 1e-300)
        first, second, third = first / total, second / total, third / total
        t = 0.0
        for c in range(3):
            if is_border[k, c]:
                weight = first if c == 0 else second if c == 1 else third
                a, b = (c + 1) % 3, (c + 2) % 3
                x, y = corner[k, b, 0] - corner[k, a, 0], corner[k, b, 1] - corner[k, a, 1]
                height = abs(double) / max((x * x + y * y) ** 0.5, 1e-300)
                short = min(inside / max(height, 1e-300), 0.25) - weight
                if short > 0.0:
                    t = max(t, short / (1.0 / 3.0 - min(weight, 0.3)))
        first, second, third = first + t * (1 / 3 - first), second + t * (1 / 3 - second), third + t * (1 / 3 - third)
        for d in range(2):
            moved[n, d] = first * corner[k, 0, d] + second * corner[k, 1, d] + third * corner[k, 2, d]
    return 0
