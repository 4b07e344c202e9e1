"""What the corners of a thinned mesh carry, taken from the mesh it came from.

A wedge is a position with one value (of uv, or of the normal); the triangles around a position fall into as many
wedges as there are values.  Edges whose two triangles disagree are seams of that value, borders of a mesh are too.
Wedges that were merged without crossing a seam stay one; such a group gets the value of the closest place on the
triangles around it, or on its seams where it has any: values along a seam stay values along that seam, on both sides
for the same place.
"""

from dataclasses import dataclass

import numpy as np

from lib.surfaces.pieces import pieces
from lib.surfaces.rows import numbered

AT_ONCE = 400_000  # pairs of a point and a triangle in flight


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
    group = _groups(w, root)
    at_corner = group[w.of[alive]]
    needed, slot = np.unique(at_corner, return_inverse=True)
    slot = slot.reshape(at_corner.shape)
    target = np.empty((len(needed), 3))
    target[slot.ravel()] = X[root[w.F[alive]]].reshape(-1, 3)
    number = np.full(int(group.max()) + 1, -1)
    number[needed] = np.arange(len(needed))
    slot_of_wedge = number[group]
    value = np.full((len(needed), w.value.shape[1]), np.nan)
    # Where a wedge of the group lies there already, its value is the answer.
    here = np.flatnonzero(slot_of_wedge >= 0)
    same = here[(w.V[w.vertex[here]] == target[slot_of_wedge[here]]).all(axis=1)]
    value[slot_of_wedge[same]] = w.value[same]
    # Elsewhere it is that of the closest place: on seams, if the group has some, or on triangles.
    open_ = np.isnan(value[:, 0])
    on_seam = slot_of_wedge[w.of.ravel()[w.seam]]
    has_seam = np.zeros(len(needed), dtype=bool)
    has_seam[on_seam[on_seam >= 0]] = True
    _closest_on_seams(w, on_seam, open_, target, value)
    _closest_on_triangles(w, slot_of_wedge[w.of], open_ & ~has_seam, target, value)
    return value[slot]


def _groups(w, root):
    """(w,) group of each wedge: those that triangles join whose corners are one vertex now."""
    a, b = [], []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        met = root[w.F[:, i]] == root[w.F[:, j]]
        a.append(w.of[met, i])
        b.append(w.of[met, j])
    return pieces(len(w.value), np.concatenate(a), np.concatenate(b))


def _closest_on_seams(w, slot, is_open, target, value):
    """Fill value where is_open from the seam edges whose ends (s, 2) belong to these slots."""
    rows, row_slot = _rows(slot, is_open)
    corner = w.seam[rows]
    A, B = (w.V[w.F.ravel()[corner[:, k]]] for k in (0, 1))
    along = B - A
    t = np.einsum("ij,ij->i", target[row_slot] - A, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    t = np.clip(t, 0.0, 1.0)
    square = ((A + t[:, None] * along - target[row_slot]) ** 2).sum(axis=1)
    best = _least(row_slot, square)
    first, second = (w.value[w.of.ravel()[corner[best, k]]] for k in (0, 1))
    value[row_slot[best]] = first + t[best, None] * (second - first)


def _closest_on_triangles(w, slot, is_open, target, value):
    """Fill value where is_open from the triangles with corners (m, 3) in these slots."""
    rows, row_slot = _rows(slot, is_open)
    square, weight = np.empty(len(rows)), np.empty((len(rows), 3))
    for start in range(0, len(rows), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        weight[part] = closest_weights(*(w.V[w.F[rows[part], k]] for k in range(3)), target[row_slot[part]])
        at = np.einsum("nk,nkc->nc", weight[part], w.V[w.F[rows[part]]])
        square[part] = ((at - target[row_slot[part]]) ** 2).sum(axis=1)
    best = _least(row_slot, square)
    value[row_slot[best]] = np.einsum("nk,nkc->nc", weight[best], w.value[w.of[rows[best]]])


def _rows(slot, is_open):
    """(row, slot) of all entries of slot (r, k) that are open, each pair once."""
    open_ = np.append(is_open, False)  # the last stands for slot -1
    rows, column = np.nonzero(open_[slot])
    of = slot[rows, column]
    _, first = np.unique(rows * np.int64(len(open_)) + of, return_index=True)
    return rows[first], of[first]


def _least(slot, square):
    """One index for each value of slot, where square is least; the first of equal ones."""
    order = np.lexsort((square, slot))
    return order[np.concatenate([[True], np.diff(slot[order]) != 0])[: len(order)]]


def closest_weights(A, B, C, P):
    """Barycentric weights (n, 3) of the points of triangles ABC (n, 3) that are closest to P (n, 3).

    >>> closest_weights(*np.eye(3)[:, None], np.array([[0.0, 2.0, 0.0]])).tolist()
    [[0.0, 1.0, 0.0]]
    """
    e, f = B - A, C - A
    ee, ef, ff = (np.einsum("ij,ij->i", x, y) for x, y in ((e, e), (e, f), (f, f)))
    pe, pf = (np.einsum("ij,ij->i", P - A, x) for x in (e, f))
    det = np.maximum(ee * ff - ef * ef, 1e-300)
    v, u = (ff * pe - ef * pf) / det, (ee * pf - ef * pe) / det
    weight = np.stack([1 - v - u, v, u], axis=1)
    out = np.flatnonzero((weight < 0).any(axis=1))
    # Outside, the closest point lies on one of the edges.
    best = np.full(len(out), np.inf)
    corner = np.stack([A[out], B[out], C[out]])
    for i, j in ((0, 1), (1, 2), (2, 0)):
        along = corner[j] - corner[i]
        t = np.einsum("ij,ij->i", P[out] - corner[i], along)
        t = np.clip(t / np.maximum(np.einsum("ij,ij->i", along, along), 1e-300), 0.0, 1.0)
        square = ((corner[i] + t[:, None] * along - P[out]) ** 2).sum(axis=1)
        nearer = square < best
        best[nearer] = square[nearer]
        rows = out[nearer]
        weight[rows] = 0.0
        weight[rows, i], weight[rows, j] = 1 - t[nearer], t[nearer]
    return weight
