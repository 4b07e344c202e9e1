"""Compiled closest places on edges and triangles."""

import numpy as np

from lib.compiled import compiled, inlined


@inlined
def along_edge(corner, t, i, j, x, y, z):
    """(squared distance, share of j): the closest point to (x, y, z) of the edge from corner i to j of triangle t."""
    ax, ay, az = corner[t, i, 0], corner[t, i, 1], corner[t, i, 2]
    dx, dy, dz = corner[t, j, 0] - ax, corner[t, j, 1] - ay, corner[t, j, 2] - az
    share = ((x - ax) * dx + (y - ay) * dy + (z - az) * dz) / max(dx * dx + dy * dy + dz * dz, 1e-300)
    share = min(max(share, 0.0), 1.0)
    ox, oy, oz = ax + share * dx - x, ay + share * dy - y, az + share * dz - z
    return ox * ox + oy * oy + oz * oz, share


@inlined
def on_triangle(corner, t, x, y, z):
    """(squared distance, weights of the three corners): the closest point to (x, y, z) of triangle t."""
    ax, ay, az = corner[t, 0, 0], corner[t, 0, 1], corner[t, 0, 2]
    ex, ey, ez = corner[t, 1, 0] - ax, corner[t, 1, 1] - ay, corner[t, 1, 2] - az
    fx, fy, fz = corner[t, 2, 0] - ax, corner[t, 2, 1] - ay, corner[t, 2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    ee, ef, ff = ex * ex + ey * ey + ez * ez, ex * fx + ey * fy + ez * fz, fx * fx + fy * fy + fz * fz
    pe, pf = px * ex + py * ey + pz * ez, px * fx + py * fy + pz * fz
    det = max(ee * ff - ef * ef, 1e-300)
    b, c = (ff * pe - ef * pf) / det, (ee * pf - ef * pe) / det
    if b >= 0 and c >= 0 and b + c <= 1:
        ox, oy, oz = b * ex + c * fx - px, b * ey + c * fy - py, b * ez + c * fz - pz
        return ox * ox + oy * oy + oz * oz, 1 - b - c, b, c
    # Outside, the closest point lies on one of the edges.
    least, best, share = np.inf, 0, 0.0
    for k in range(3):
        square, s = along_edge(corner, t, k, (k + 1) % 3, x, y, z)
        if square < least:
            least, best, share = square, k, s
    if best == 0:
        return least, 1 - share, share, 0.0
    if best == 1:
        return least, 0.0, 1 - share, share
    return least, share, 0.0, 1 - share


@compiled("f8[:,:,:], f8[:,:], f8[:,:]")
def closest_weights(corner, points, weight):
    """Barycentric weights (n, 3) of the places on triangles corner (n, 3, 3) that are closest to points (n, 3)."""
    for t in range(len(points)):
        _, weight[t, 0], weight[t, 1], weight[t, 2] = on_triangle(corner, t, points[t, 0], points[t, 1], points[t, 2])
    return 0
