"""Meshes in a frame of their own, where float32 is enough."""

import numpy as np


def framed(V, F):
    """(V, F, centre (3,), scale): a checked mesh in float64 and int64, and the middle and largest side of its box.

    V : (n_v, 3), any unit;  F : (n_f, 3), n_f = 0 allowed: its frame is then the unit's own
    Raises ValueError for a vertex that is not finite or an index out of range.
    """
    V, F = np.asarray(V, dtype=np.float64).reshape(-1, 3), np.asarray(F, dtype=np.int64).reshape(-1, 3)
    if not np.isfinite(V).all():
        raise ValueError("V: not finite")
    if not len(F):
        return V, F, np.zeros(3), 1.0
    if F.min() < 0 or F.max() >= len(V):
        raise ValueError(f"F: indices {F.min()} to {F.max()}, expected 0 to {len(V) - 1}")
    low, high = V[F].min((0, 1)), V[F].max((0, 1))
    return V, F, (low + high) / 2, max(float((high - low).max()), np.finfo(float).tiny)
