"""Compiled steps of lib.lod.collapse, and sums for lib.lod.thinned.

Quadrics (p, 10) are the upper triangles of n n' for planes n = (a, b, c, d), row by row.
"""

import numpy as np

from lib.compiled import compiled, inlined


@compiled("i4[:,:], f8[:,:], f8[:,:]")
def sum_at_corners(T, x, out):
    """Add the rows x (t, c) of triangles T (t, 3) to those of their corners, out (p, c): of all first corners first."""
    for k in range(3):
        for t in range(len(T)):
            for c in range(x.shape[1]):
                out[T[t, k], c] += x[t, c]
    return 0


@compiled("i8[:], f8[:,:], f8[:,:]")
def sum_rows(number, x, out):
    """Add each row of x (n, c) to the row of its number in out."""
    for i in range(len(x)):
        for c in range(x.shape[1]):
            out[number[i], c] += x[i, c]
    return 0


@inlined
def error(q, i, x, y, z):
    """The quadric q[i] at a place."""
    return (
        (q[i, 0] * x * x + 2 * q[i, 1] * x * y + 2 * q[i, 2] * x * z + 2 * q[i, 3] * x + q[i, 4] * y * y)
        + (2 * q[i, 5] * y * z + 2 * q[i, 6] * y + q[i, 7] * z * z + 2 * q[i, 8] * z + q[i, 9])
    )  # fmt: skip


@compiled("i8[:,:], f8[:,:], f8[:,:], f8[:,:], i8[:], i8[:,:], f8[:,:], b1[:]")
def replay(pair, Q, X, Y, stands, own, at, is_sound):
    """own, at and is_sound (c,) of collapses, as lib.lod.collapse says.

    Q (p, 10), X (p, 3) : quadrics and positions of the Added, Y (p, 3) positions in the unit of the mesh
    stands (p,) : for which of the mesh's own vertices, -1 for none
    All four change with every collapse.
    """
    for k in range(len(pair)):
        a, b = pair[k, 0], pair[k, 1]
        for c in range(10):
            Q[a, c] = Q[b, c] + Q[a, c]
        # The best of both ends and the middle; of equal ones the last, as there.
        best, least = 0, np.inf
        for end in range(3):
            i, j = b if end == 1 else a, a if end == 0 else b
            x, y, z = (X[i, 0] + X[j, 0]) / 2, (X[i, 1] + X[j, 1]) / 2, (X[i, 2] + X[j, 2]) / 2
            found = error(Q, a, x, y, z)
            if found <= least:
                best, least = end, found
        own[k, 0], own[k, 1] = stands[a], stands[b]
        is_sound[k] = (stands[a] >= 0) == (stands[b] >= 0) or best == (0 if stands[a] >= 0 else 1)
        for c in range(3):
            if best == 1:
                X[a, c], Y[a, c] = X[b, c], Y[b, c]
            elif best == 2:
                X[a, c], Y[a, c] = (X[a, c] + X[b, c]) / 2, (Y[a, c] + Y[b, c]) / 2
            at[k, c] = Y[a, c]
        if stands[a] < 0:
            stands[a] = stands[b]
    return 0
