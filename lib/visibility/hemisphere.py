"""Cosine-distributed directions about normals.

Malley's method (Shirley 1991): a uniform point of the disc, lifted to the hemisphere, has density cos / pi.  The
tangent frame is that of Duff et al. 2017, which has no singular direction.
"""

import numpy as np

LEVEL = -1e-5  # z of a normal below which the frame is the other one: not 0, where rounding would choose it


def tangent_frames(N):
    """Orthonormal rows T, U, N for unit normals N (m, 3): (m, 3, 3)."""
    x, y, z = N[:, 0], N[:, 1], N[:, 2]
    sign = np.where(z < LEVEL, -1.0, 1.0).astype(N.dtype)
    a = -1 / (sign + z)
    b = x * y * a
    T = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    U = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.stack([T, U, N], axis=1)


def cosine_directions(N, points, shift):
    """Directions with density cos / pi about each normal.

    Parameters
    ----------
    N : (m, 3) unit normals
    points : (K, 2) points of [0, 1)^2, shared by all normals
    shift : (m, 2) Cranley-Patterson rotation of each

    Returns (m, K, 3) float32 unit vectors.

    The second coordinate turns about N, so its shift turns the frame once per normal instead of every direction.
    """
    turn = 2 * np.pi * shift[:, 1]
    frames = tangent_frames(np.asarray(N, dtype=np.float64))
    T, U = frames[:, 0], frames[:, 1]
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    frames = np.stack([c * T + s * U, c * U - s * T, frames[:, 2]], axis=1).astype(np.float32)
    a = points[:, 0].astype(np.float32) + shift[:, :1].astype(np.float32)
    a -= a >= 1
    r = np.sqrt(np.maximum(a, 0, out=a))
    phi = 2 * np.pi * points[:, 1]
    local = np.empty((*a.shape, 3), dtype=np.float32)
    np.multiply(r, np.cos(phi).astype(np.float32), out=local[..., 0])
    np.multiply(r, np.sin(phi).astype(np.float32), out=local[..., 1])
    np.sqrt(np.maximum(1 - a, 1e-12), out=local[..., 2])  # never exactly along the plane
    return local @ frames


def cosine_direction_each(N, points):
    """One direction of density cos / pi for each normal: N (m, 3), points (m, 2) of [0, 1)^2; (m, 3) float32."""
    N, points = N.astype(np.float32), points.astype(np.float32)
    x, y, z = N.T
    r, phi = np.sqrt(points[:, 0]), np.float32(2 * np.pi) * points[:, 1]
    t, u, n = r * np.cos(phi), r * np.sin(phi), np.sqrt(np.maximum(1 - points[:, 0], np.float32(1e-12)))
    sign = np.where(z < LEVEL, np.float32(-1), np.float32(1))
    a = -1 / (sign + z)
    b = x * y * a
    D = np.empty((len(N), 3), dtype=np.float32)
    D[:, 0] = t * (1 + sign * x * x * a) + u * b + n * x
    D[:, 1] = t * sign * b + u * (sign + y * y * a) + n * y
    D[:, 2] = -t * sign * x - u * y + n * z
    return D
