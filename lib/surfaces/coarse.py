"""Triangles of a surface of any kind for rough questions: where it is, and what stands before what."""

import numpy as np

from lib.nurbs.evaluate import evaluate, evaluate_grid
from lib.surfaces.mesh import Mesh
from lib.surfaces.trimmed import TrimmedSurface

LINES = np.linspace(0.0, 1.0, 9)


def coarse(surface):
    """V (n, 3), F (m, 3) int64: of a mesh its own, else cut at LINES of the map; normals along S_u x S_v."""
    if isinstance(surface, Mesh):
        return surface.V, surface.F.astype(np.int64)
    if isinstance(surface, TrimmedSurface):
        return _trimmed(surface)
    n = len(LINES)
    corner = np.arange(n * n).reshape(n, n)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    F = np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3)
    return evaluate_grid(surface, LINES, LINES)[0].reshape(-1, 3), F


def _trimmed(trim):
    from lib.surfaces.trim_mesh import TRY_RESOLVE, triangles  # a library of its own: only where there are trims

    k = len(trim.uv)
    after = np.arange(1, k + 1)
    after[trim.loop_start[1:] - 1] = trim.loop_start[:-1]
    inner = np.stack(np.meshgrid(LINES[1:-1], LINES[1:-1]), axis=2).reshape(-1, 2)
    uv, F = triangles(np.concatenate([trim.uv, inner]), np.stack([np.arange(k), after], axis=1), TRY_RESOLVE)
    return evaluate(trim.base, uv[:, 0], uv[:, 1])[0], F
