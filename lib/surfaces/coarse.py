"""Triangles of a surface of any kind for rough questions: where it is, and what stands before what."""

import numpy as np

from lib.nurbs.evaluate import evaluate, evaluate_grid
from lib.surfaces.measure import is_planar
from lib.surfaces.mesh import Mesh
from lib.surfaces.trimmed import TrimmedSurface

ROUGH, LEAST = 0.02, 4  # of the size; points of a loop
ROUNDS = 2  # of dividing the triangles of a curved trimmed surface
LINES = 9


def coarse(surface, lines=LINES):
    """V (n, 3), F (m, 3) int64, UV (n, 2): of a mesh its own, and None, else cut at LINES of the map, at `lines` if it
    is curved and has no trims; normals along S_u x S_v.
    """
    if isinstance(surface, Mesh):
        return surface.V, surface.F.astype(np.int64), None
    if isinstance(surface, TrimmedSurface):
        return _trimmed(surface)
    n = lines if lines == LINES or not is_planar(surface) else LINES
    corner, t = np.arange(n * n).reshape(n, n), np.linspace(0.0, 1.0, n)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    F = np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3)
    UV = np.stack(np.meshgrid(t, t), axis=2).reshape(-1, 2)
    return evaluate_grid(surface, t, t)[0].reshape(-1, 3), F, UV


def _trimmed(trim):
    from lib.surfaces.trim_mesh import domain_triangles  # a library of its own: only where there are trims

    uv, F = domain_triangles(_simplified(trim))
    for _ in range(ROUNDS if not is_planar(trim) else 0):
        uv, F = _divided(uv, F)
    return evaluate(trim.base, uv[:, 0], uv[:, 1])[0], F, uv


def _simplified(trim):
    """The trimmed surface with fewer border points: corners, and what stands out by ROUGH of the size."""
    bound = ROUGH * np.ptp(trim.S, axis=0).max()
    keep, start = trim.significance > bound, trim.loop_start
    for a, b in zip(start[:-1], start[1:], strict=True):
        if keep[a:b].sum() < LEAST:
            keep[a + (np.arange(LEAST) * (b - a)) // LEAST] = True
    count = [int(keep[a:b].sum()) for a, b in zip(start[:-1], start[1:], strict=True)]
    loops = np.cumsum([0, *count]).astype(np.int64)
    return TrimmedSurface(trim.base, trim.box, trim.uv[keep], loops, trim.S[keep], trim.significance[keep])


def _divided(uv, F):
    """Each triangle in four, at the middles of its edges."""
    edge = np.sort(F[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
    edge, which = np.unique(edge[:, 0] * len(uv) + edge[:, 1], return_inverse=True)  # far faster than rows
    edge = np.stack(np.divmod(edge, len(uv)), axis=1)
    a, b, c = F.T
    x, y, z = (len(uv) + which.reshape(-1, 3)).T
    uv = np.concatenate([uv, uv[edge].mean(axis=1)])
    parts = np.stack([[a, z, y], [z, b, x], [y, x, c], [x, y, z]])
    return uv, parts.transpose(2, 0, 1).reshape(-1, 3)
