"""Compiled points of NURBS curves, and distances from chords and polylines.

Source: Piegl, Tiller, The NURBS Book: A2.1 (span), A2.2 (basis), eq. 4.1 (rational curve).
"""

import math

from lib.compiled import compiled, inlined
from lib.nurbs.surface_kernels import basis_at


@inlined
def off_segment(points, i, corners, start, end):
    """Distance of points[i] from the segment corners[start]..corners[end], all of them (., 3)."""
    ax, ay, az = corners[start, 0], corners[start, 1], corners[start, 2]
    x, y, z = corners[end, 0] - ax, corners[end, 1] - ay, corners[end, 2] - az
    dx, dy, dz = points[i, 0] - ax, points[i, 1] - ay, points[i, 2] - az
    square, s = x * x + y * y + z * z, dx * x + dy * y + dz * z
    if square > 0:
        s /= square
    s = min(max(s, 0.0), 1.0)
    dx, dy, dz = dx - s * x, dy - s * y, dz - s * z
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@compiled("f8[:], f8[:,:], i8, f8[:], f8[:,:], f8[:,:]")
def points_on_curve(knots, Pw, degree, t, scratch, out):
    """Points at t (m,) into out (m, 3).  knots, Pw (n, 4), degree : those of the curve;  scratch (2, degree + 1)"""
    N, dN = scratch[0], scratch[1]
    for i in range(len(t)):
        k = basis_at(knots, degree, len(Pw), t[i], N, dN) - degree
        x = y = z = w = 0.0
        for a in range(degree + 1):
            f = N[a]
            x, y = x + f * Pw[k + a, 0], y + f * Pw[k + a, 1]
            z, w = z + f * Pw[k + a, 2], w + f * Pw[k + a, 3]
        out[i, 0], out[i, 1], out[i, 2] = x / w, y / w, z / w
    return 0


@compiled("f8[:,:], f8[:,:], f8[:]")
def off_chords(points, corners, out):
    """Distance of each of points (m, 3) from the segment that starts at its corner, of (m + 1, 3), into out (m,)."""
    for i in range(len(points)):
        out[i] = off_segment(points, i, corners, i, i + 1)
    return 0


@compiled("f8[:,:], f8[:,:], f8[:]")
def farthest(points, line, out):
    """The largest distance of `points` (m, 3) from the polyline `line` (k, 3), k >= 2, into out (1,)."""
    out[0] = 0.0
    for i in range(len(points)):
        least = math.inf
        for k in range(len(line) - 1):
            least = min(least, off_segment(points, i, line, k, k + 1))
        out[0] = max(out[0], least)
    return 0
