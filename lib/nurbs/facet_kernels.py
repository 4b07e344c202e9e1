"""Compiled loops over triangles: which have an area, and how far a surface is from those between points of it."""

import math

from lib.compiled import compiled
from lib.nurbs.surface_kernels import point_at

WHOLE, NO_AREA, ONE_PLACE = 0, 1, 2


@compiled("f8[:,:], i8[:,:], f8, i8[:]")
def kinds(points, F, flat, kind):
    """kind (m,) of the triangles F (m, 3) of points (k, 3): ONE_PLACE where two corners are in one, NO_AREA where that
    is at most `flat` of the longest edge squared.
    """
    for i in range(len(F)):
        a, b, c = F[i, 0], F[i, 1], F[i, 2]
        x, y, z = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        p, q, r = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        s, t, u = points[c, 0] - points[b, 0], points[c, 1] - points[b, 1], points[c, 2] - points[b, 2]
        first, second, third = x * x + y * y + z * z, p * p + q * q + r * r, s * s + t * t + u * u
        double = math.sqrt((y * r - z * q) ** 2 + (z * p - x * r) ** 2 + (x * q - y * p) ** 2)
        is_one = (x == 0.0 and y == 0.0 and z == 0.0) or (p == 0.0 and q == 0.0 and r == 0.0)
        if is_one or (s == 0.0 and t == 0.0 and u == 0.0):
            kind[i] = ONE_PLACE
        elif double > flat * max(first, max(second, third)):
            kind[i] = WHOLE
        else:
            kind[i] = NO_AREA
    return 0


@compiled(
    "f8[:], f8[:], f8[:,:,:], i8, i8, f8[:,:], f8[:,:], i8[:,:], f8[:,:], f8[:,:],f8[:], f8[:,:], f8[:], f8[:], f8[:]"
)
def measure(knots_u, knots_v, Pw, p, q, uv, S, F, weights, scratch, height, on_edge, square, slide, area):
    """Distances of a surface from triangles F (m, 3) of points S (k, 3) at uv (k, 2), at places in each with the
    barycentric weights (n, 3).

    knots_u, knots_v, Pw, p, q, scratch : as of `point_at`
    height, square, slide, area (m,), on_edge (m, 3) : largest distance from the plane, its mean square, the largest
    whole vector, the triangle's area, and the largest distance of places on the edge from corner c to the next
    """
    for i in range(len(F)):
        a, b, c = F[i, 0], F[i, 1], F[i, 2]
        x, y, z = S[b, 0] - S[a, 0], S[b, 1] - S[a, 1], S[b, 2] - S[a, 2]
        d, e, f = S[c, 0] - S[a, 0], S[c, 1] - S[a, 1], S[c, 2] - S[a, 2]
        x, y, z = y * f - z * e, z * d - x * f, x * e - y * d
        double = math.sqrt(x * x + y * y + z * z)
        area[i] = double / 2
        double = max(double, 1e-300)
        x, y, z = x / double, y / double, z / double
        height[i] = square[i] = slide[i] = 0.0
        on_edge[i, 0] = on_edge[i, 1] = on_edge[i, 2] = 0.0
        for n in range(len(weights)):
            f, g, h = weights[n, 0], weights[n, 1], weights[n, 2]
            u = min(max(f * uv[a, 0] + g * uv[b, 0] + h * uv[c, 0], 0.0), 1.0)
            v = min(max(f * uv[a, 1] + g * uv[b, 1] + h * uv[c, 1], 0.0), 1.0)
            X, Y, Z, _, _, _, _, _, _ = point_at(knots_u, knots_v, Pw, p, q, u, v, scratch)
            X -= f * S[a, 0] + g * S[b, 0] + h * S[c, 0]
            Y -= f * S[a, 1] + g * S[b, 1] + h * S[c, 1]
            Z -= f * S[a, 2] + g * S[b, 2] + h * S[c, 2]
            above = abs(X * x + Y * y + Z * z)
            height[i] = max(height[i], above)
            square[i] += above * above / len(weights)
            slide[i] = max(slide[i], math.sqrt(X * X + Y * Y + Z * Z))
            for k in range(3):
                if weights[n, (k + 2) % 3] == 0.0:
                    on_edge[i, k] = max(on_edge[i, k], above)
    return 0
