"""Cosine-distributed directions about normals.

Malley's method (Shirley 1991): a uniform point of the disc, lifted to the hemisphere, has density cos / pi.  The
tangent frame is that of Duff et al. 2017, which has no singular direction.
"""

import numpy as np

from lib.visibility import ray_kernels


def rays_about(x, N, points, shift):
    """Rays with density cos / pi about each normal.

    Parameters
    ----------
    x, N : (m, 3) origins and unit normals
    points : (K, 2) points of [0, 1)^2, shared by all normals; or (P, K, 2), of which normal i takes points[i % P]
    shift : (m / P, 2) Cranley-Patterson rotations, of which normal i takes shift[i // P]

    Returns origins, directions (m K, 3) float32, those of a normal together; directions are unit vectors.
    """
    points = points if points.ndim == 3 else points[None]
    phi = 2 * np.pi * points[..., 1]
    disc = (np.ascontiguousarray(a, dtype=np.float32) for a in (points[..., 0], np.cos(phi), np.sin(phi)))
    x, N, shift = (np.ascontiguousarray(a, dtype=np.float64) for a in (x, N, shift))
    origins = np.empty((len(N) * points.shape[1], 3), dtype=np.float32)
    D = np.empty_like(origins)
    ray_kernels.hemisphere_rays(x, N, shift, *disc, origins, D)
    return origins, D


def cosine_direction_each(N, points):
    """One direction of density cos / pi for each normal: N (m, 3), points (m, 2) of [0, 1)^2; (m, 3) float32."""
    N, points = (np.ascontiguousarray(a, dtype=np.float32) for a in (N, points))
    D = np.empty_like(N)
    ray_kernels.direction_each(N, points, D)
    return D
