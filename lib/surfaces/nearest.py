"""The nearest of many points in the plane, found through cells of equal size.

scipy's cKDTree does the same; to load it takes longer than what most scenes ask of it.
"""

import math

import numpy as np

from lib.compiled import compiled

IN_A_CELL = 2  # points, on average
MOST_CELLS = 2048  # along a side


class Nearest:
    """Points (k, 2), k >= 1, mostly in [0, 1] x [0, 1], to be asked which is the nearest."""

    def __init__(self, points):
        self._points = np.ascontiguousarray(points, dtype=np.float64)
        side = int(np.clip(np.sqrt(len(self._points) / IN_A_CELL), 1, MOST_CELLS))
        i, j = np.clip((self._points * side).astype(np.int64), 0, side - 1).T
        cell = j * side + i
        self._order, self._side = np.argsort(cell, kind="stable"), side
        self._start = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=side * side))])

    def __call__(self, places):
        """(n,) number of the point nearest to each of places (n, 2), of several as near the first."""
        found = np.empty(len(places), dtype=np.int64)
        _find(self._points, self._order, self._start, self._side, np.ascontiguousarray(places, dtype=np.float64), found)
        return found


@compiled("f8[:,:], i8[:], i8[:], i8, f8[:,:], i8[:]")
def _find(points, order, start, side, places, found):
    """Put the numbers of the nearest of points (k, 2) to places (n, 2) into found (n,).

    order (k,) : numbers of the points by cell, row after row;  start (side^2 + 1,) : where those of a cell begin
    """
    for q in range(len(places)):
        x, y = places[q, 0], places[q, 1]
        column, row = int(min(max(x * side, 0.0), side - 1.0)), int(min(max(y * side, 0.0), side - 1.0))
        nearest, least = len(points), math.inf
        for ring in range(side):
            # Cells of this ring and beyond are at least as far as the edge of those inside it
            edge = min(x * side - (column - ring + 1), column + ring - x * side)
            edge = min(edge, y * side - (row - ring + 1), row + ring - y * side) / side
            if edge > 0.0 and edge * edge > least:
                break
            for j in range(max(row - ring, 0), min(row + ring + 1, side)):
                step = 1 if abs(j - row) == ring else 2 * ring
                for i in range(column - ring, column + ring + 1, max(step, 1)):
                    if i < 0 or i >= side:
                        continue
                    for k in range(start[j * side + i], start[j * side + i + 1]):
                        number = order[k]
                        dx, dy = points[number, 0] - x, points[number, 1] - y
                        far = dx * dx + dy * dy
                        if far < least or (far == least and number < nearest):
                            nearest, least = number, far
        found[q] = nearest
    return 0
