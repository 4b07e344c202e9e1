"""Compiled distances from polylines."""

import math

from lib.compiled import compiled


@compiled("f8[:,:], f8[:,:], f8[:]")
def farthest(points, line, out):
    """The largest distance of `points` (m, 3) from the polyline `line` (k, 3), k >= 2, into out (1,)."""
    worst = 0.0
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        least = math.inf
        for k in range(len(line) - 1):
            a, b, c = line[k, 0], line[k, 1], line[k, 2]
            u, v, w = line[k + 1, 0] - a, line[k + 1, 1] - b, line[k + 1, 2] - c
            p, q, r = x - a, y - b, z - c
            t = (p * u + q * v + r * w) / max(u * u + v * v + w * w, 1e-300)
            t = min(max(t, 0.0), 1.0)
            p, q, r = p - t * u, q - t * v, r - t * w
            least = min(least, p * p + q * q + r * r)
        worst = max(worst, least)
    out[0] = math.sqrt(worst)
    return 0
