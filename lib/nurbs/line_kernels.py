"""Compiled second differences and turning of the curves on a surface (see lib.nurbs.lines)."""

import math

from lib.compiled import compiled, inlined

NOTHING = 1e-9  # of the largest length: a vector so short has no direction


@inlined
def cross(a, b):
    """a x b of vectors (3,) as three numbers."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def length(x, y, z):
    """Of the vector (x, y, z)."""
    return math.sqrt(x * x + y * y + z * z)


@inlined
def inverse(size, largest):
    """1 / size, 0 where it is NOTHING beside the largest."""
    return 1.0 / size if size > NOTHING * largest else 0.0


@compiled("f8[:,:,:], f8[:,:,:], f8[:,:,:], f8[:], i8, i8, f8[:,:]")
def curvatures(S, along, across, at, first_is_border, last_is_border, out):
    """Second derivatives of the curves S (m + 1, n, 3), along their first axis, at the inner ones of `at` (m + 1,):
    the largest part that leaves the surface and the largest inside it, into out (2, m - 1).

    along, across (m + 1, n, 3) : first derivatives along the curves and across;  first_is_border, last_is_border :
    the first or last curve is an outline, where all that leaves its own tangent leaves the surface
    """
    n = S.shape[1]
    widest = fastest = 0.0
    for k in range(len(S)):
        for i in range(n):
            x, y, z = cross(along[k, i], across[k, i])
            widest = max(widest, length(x, y, z))
            fastest = max(fastest, length(along[k, i, 0], along[k, i, 1], along[k, i, 2]))
    for k in range(1, len(S) - 1):
        before, after = at[k] - at[k - 1], at[k + 1] - at[k]
        scale = 2.0 / (before + after)
        leaves = stays = 0.0
        for i in range(n):
            x = ((S[k + 1, i, 0] - S[k, i, 0]) / after - (S[k, i, 0] - S[k - 1, i, 0]) / before) * scale
            y = ((S[k + 1, i, 1] - S[k, i, 1]) / after - (S[k, i, 1] - S[k - 1, i, 1]) / before) * scale
            z = ((S[k + 1, i, 2] - S[k, i, 2]) / after - (S[k, i, 2] - S[k - 1, i, 2]) / before) * scale
            a, b, c = cross(along[k, i], across[k, i])
            unit = inverse(length(a, b, c), widest)
            a, b, c = a * unit, b * unit, c * unit
            normal = x * a + y * b + z * c
            stays = max(stays, length(x - normal * a, y - normal * b, z - normal * c))
            normal = abs(normal) if unit > 0.0 else length(x, y, z)
            if (i == 0 and first_is_border) or (i == n - 1 and last_is_border):
                a, b, c = along[k, i, 0], along[k, i, 1], along[k, i, 2]
                unit = inverse(length(a, b, c), fastest)
                a, b, c = a * unit, b * unit, c * unit
                tangent = x * a + y * b + z * c
                normal = length(x - tangent * a, y - tangent * b, z - tangent * c)
            leaves = max(leaves, normal)
        out[0, k - 1], out[1, k - 1] = leaves, stays
    return 0


@compiled("f8[:,:,:], f8[:]")
def turning(S, out):
    """The most that a curve of S (m + 1, n, 3) turns along its first axis [radians], into out (1,).

    Curves of next to no length beside the longest, and steps of next to none beside the longest step, do not count.
    """
    n, longest, step = S.shape[1], 0.0, 0.0
    for i in range(n):
        whole = 0.0
        for k in range(len(S) - 1):
            whole += length(S[k + 1, i, 0] - S[k, i, 0], S[k + 1, i, 1] - S[k, i, 1], S[k + 1, i, 2] - S[k, i, 2])
        longest = max(longest, whole)
    for only_measures in (True, False):
        most = 0.0
        for i in range(n):
            whole = turned = 0.0
            a, b, c, had_direction = 0.0, 0.0, 0.0, False
            for k in range(len(S) - 1):
                x, y, z = S[k + 1, i, 0] - S[k, i, 0], S[k + 1, i, 1] - S[k, i, 1], S[k + 1, i, 2] - S[k, i, 2]
                whole += length(x, y, z)
                if only_measures:
                    turned = max(turned, length(x, y, z))
                    continue
                has_direction = length(x, y, z) > NOTHING * step
                if has_direction and had_direction:
                    p, q, r = b * z - c * y, c * x - a * z, a * y - b * x
                    turned += math.atan2(length(p, q, r), a * x + b * y + c * z)
                a, b, c, had_direction = x, y, z, has_direction
            if whole > 1e-6 * longest:
                most = max(most, turned)
        step = max(step, most)
    out[0] = most
    return 0
