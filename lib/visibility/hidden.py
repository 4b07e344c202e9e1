"""Which samples are buried in other things, judged by the back faces their rays meet."""

import numpy as np

from lib.visibility.hemisphere import rays_about
from lib.visibility.qmc import r2
from lib.visibility.ray_kernels import buried

RAYS = 16  # decide for a point: fewer meet back faces alone by chance
AT_ONCE = 1024  # points
BURIED_IN_SHELL = 0.10  # share of rays that meet the inside of a closed shell
BEHIND_ALL = 0.90  # share of rays that meet any back face: the back of an open sheet alone hides nothing


def is_hidden(hits, in_shell, K):
    """(n,) bool from the hits of K rays of each of n points; in_shell (faces,) bool, part of a closed shell."""
    out = np.empty(len(hits.face) // K, dtype=bool)
    buried(hits.face, hits.is_back, in_shell, K, BURIED_IN_SHELL, BEHIND_ALL, out)
    return out


def are_buried(x, N, shift, tracer, mesh):
    """(n,) bool: the points x (n, 3), lifted, with normals N and shifts (n, 2), are hidden, judged by RAYS rays
    each.
    """
    out = np.zeros(len(x), dtype=bool)
    sequence = r2(RAYS)
    for first in range(0, len(x), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        hits = tracer.closest(*rays_about(x[part], N[part], sequence, shift[part]))
        out[part] = is_hidden(hits, mesh.in_shell, RAYS)
    return out
