"""Which samples are buried in other things, judged by the back faces their rays meet."""

import numpy as np

from lib.visibility.hemisphere import cosine_directions
from lib.visibility.qmc import r2

RAYS = 16  # decide for a point: fewer meet back faces alone by chance
AT_ONCE = 1024  # points
BURIED_IN_SHELL = 0.10  # share of rays that meet the inside of a closed shell
BEHIND_ALL = 0.90  # share of rays that meet any back face: the back of an open sheet alone hides nothing


def is_hidden(is_back, in_shell, cast=None):
    """(n,) bool from rays (n, K): is_back, the ray meets a back face; in_shell, that face is part of a closed shell."""
    rays = is_back.shape[1] if cast is None else np.maximum(cast, 1)
    inside = (is_back & in_shell).sum(axis=1)
    return (inside > BURIED_IN_SHELL * rays) | (is_back.sum(axis=1) > BEHIND_ALL * rays)


def are_buried(x, N, shift, tracer, mesh):
    """(n,) bool: the points x (n, 3), lifted, with normals N and shifts (n, 2), are hidden, judged by RAYS rays
    each.
    """
    out = np.zeros(len(x), dtype=bool)
    sequence = r2(RAYS)
    for first in range(0, len(x), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        D = cosine_directions(N[part], sequence, shift[part])
        hits = tracer.closest(np.repeat(x[part].astype(np.float32), RAYS, axis=0), D.reshape(-1, 3))
        shape = (len(x[part]), RAYS)
        out[part] = is_hidden(hits.is_back.reshape(shape), mesh.is_shell(hits.face).reshape(shape))
    return out
