"""Closest points of triangles, exact to rounding in float64.

Triangles are halved by their middles again and again, and boxes put around the halves.  A search starts with the
triangle found for the point before: points that follow each other along a surface soon find theirs.
"""

import numpy as np

from lib.visibility import nearest_kernels as kernels

DEPTH = 64  # of the tree: for 2^64 triangles


class Tree:
    """Triangles F (m, 3) of V (n, 3) to search in, m > 0.  ValueError where there is none."""

    def __init__(self, V, F):
        if not len(F):
            raise ValueError("no triangle to be close to")
        corner = np.asarray(V, dtype=np.float64)[F]
        self._leaves = 1 << (-(-len(F) // kernels.LEAF) - 1).bit_length()
        self._box, self._order = np.empty((2 * self._leaves, 6)), np.empty(len(F), dtype=np.int64)
        kernels.plant(corner, self._leaves, np.empty((len(F), 3)), self._order, self._box)
        self._corner = corner[self._order]
        self._scratch = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)

    def distances(self, points):
        """Distances (n,) of points (n, 3) from the closest triangles."""
        return self.distances_beyond(0.0, points, np.ones(len(points), dtype=bool))

    def distances_beyond(self, least, points, is_exact):
        """Distances (n,) of points (n, 3) as far as it takes to know the largest of them and `least`.

        Where is_exact (n,) is False, and the distance is not larger than `least` or one before, it may come out larger,
        up to that number: the search ends with the first triangle as close as that.
        """
        out, points = np.empty(len(points)), np.ascontiguousarray(points, dtype=np.float64)
        kernels.distances(self._corner, self._box, self._leaves, points, is_exact, least, *self._scratch, out)
        return out

    def places(self, points):
        """(face (n,), weight (n, 3)): the places closest to points (n, 3), by the corners of a triangle in F."""
        points, triangle = np.ascontiguousarray(points, dtype=np.float64), np.empty(len(points), dtype=np.int64)
        weight = np.empty((len(points), 3))
        kernels.places(self._corner, self._box, self._leaves, points, *self._scratch, triangle, weight)
        return self._order[triangle], weight
