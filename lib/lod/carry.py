"""What the corners of a thinned mesh carry, taken from the mesh it came from.

A wedge is a position with one value (of uv, or of the normal); the triangles around a position fall into as many
wedges as there are values.  Edges whose two triangles disagree are seams of that value, borders of a mesh are too.
Wedges that were merged without crossing a seam stay one; such a group gets the value of the closest place on the
triangles around it, or on its seams where it has any: values along a seam stay values along that seam, on both sides
for the same place.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lib.lod import carry_kernels as kernels
from lib.surfaces.rows import numbered


@dataclass(frozen=True)
class Wedges:
    """Values at the corners of m triangles F (m, 3) of positions V.

    of (m, 3) the wedge of each corner; value (w, c); vertex (w,) its position
    seam (s, 2) corners, 3 triangle + k, at the ends of the edges that are seams, one for each triangle at the edge
    """

    V: np.ndarray
    F: np.ndarray
    of: np.ndarray
    value: np.ndarray
    vertex: np.ndarray
    seam: np.ndarray

    @cached_property
    def corner(self):
        """(m, 3, 3) positions at the corners."""
        return self.V[self.F]


def wedges(V, F, part, value):
    """The Wedges of values (m, 3, c); part (m,): triangles of different parts share none."""
    place = np.stack([F, np.broadcast_to(part[:, None], F.shape)], axis=2)
    number, first = numbered(np.concatenate([place, value], axis=2).reshape(3 * len(F), -1))
    of = number.reshape(-1, 3)
    a, b = np.arange(of.size), np.arange(of.size).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    low, high = np.minimum(number[a], number[b]), np.maximum(number[a], number[b])
    _, edge, users = np.unique(low * np.int64(len(first)) + high, return_inverse=True, return_counts=True)
    is_seam = users[edge] != 2
    seam = np.stack([a[is_seam], b[is_seam]], axis=1)
    return Wedges(V, F, of, value.reshape(-1, value.shape[2])[first], F.ravel()[first], seam)


def carried(w, root, alive, X):
    """Values (a, 3, c) at the corners of the surviving triangles.

    w : Wedges;  root (n,) where each position went;  alive (a,) triangles that survive;  X : positions by root
    """
    # Number the groups that survive.
    n = len(w.value)
    group, slot = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    at_corner, target = np.empty((len(alive), 3), dtype=np.int64), np.empty((n, 3))
    kernels.group_wedges(w.F, w.of, root, group)
    count = kernels.number_slots(w.F, w.of, root, group, alive, X, slot, at_corner, target)
    # Where a wedge of the group lies there already, its value is the answer.
    is_open, value = np.ones(count, dtype=bool), np.empty((count, w.value.shape[1]))
    kernels.keep(w.V, w.vertex, w.value, slot, target, is_open, value)
    # Elsewhere it is that of the closest place: on seams, if the group has some, or on triangles.
    has_seam, square = np.zeros(count, dtype=bool), np.full(count, np.inf)
    kernels.closest_on_seams(w.of, w.corner, w.seam, w.value, slot, target, is_open, has_seam, square, value)
    kernels.closest_on_triangles(w.of, w.corner, w.value, slot, target, is_open & ~has_seam, square, value)
    return value[at_corner]
