"""Which triangles of a mesh belong to a closed shell."""

import numpy as np

from lib.surfaces.pieces import pieces
from lib.surfaces.rows import numbered


def in_closed_shell(V, F):
    """(n_f,) bool: the face is part of a closed shell.

    V (n_v, 3), F (n_f, 3): positions equal bit for bit are one vertex (0.0 and -0.0 are equal).  Faces that share an
    edge are of one component; a component is closed when each of its edges is used as often in one direction as in the
    other: bodies that touch along an edge stay closed.
    """
    F = np.asarray(F, dtype=np.int64)
    if not len(F):
        return np.zeros(0, dtype=bool)
    ends = numbered(V)[0][F]
    a, b = ends.ravel(), np.roll(ends, -1, axis=1).ravel()
    face = np.repeat(np.arange(len(F)), 3)
    key = np.minimum(a, b) * len(V) + np.maximum(a, b)
    _, edge, uses = np.unique(key, return_inverse=True, return_counts=True)
    turns = np.bincount(edge, weights=np.sign(b - a), minlength=len(uses))
    is_sound = turns == 0
    # faces and edges are the nodes; an edge joins all faces that use it
    group = pieces(len(F) + len(uses), face, len(F) + edge)
    is_open = np.zeros(group.max() + 1, dtype=bool)
    is_open[group[len(F) :][~is_sound]] = True
    return ~is_open[group[: len(F)]]
