"""Compiled loops of direct light: which points of emitters shadow rays go to, and what share of them is seen.

Pairs (sample, emitter) are listed: asked (k,) the sample's row, l (k,) its emitter.  F (m, facets) are form factors and
`running` their sums along each row; facets first[l]:first[l + 1] are those of emitter l.
"""

import math

import numpy as np

from lib.compiled import compiled, inlined

LAST = 1 - 1e-9  # below 1, where the facet ends


@inlined
def chosen(running, F, row, begin, end, p):
    """Facet of begin .. end - 1 chosen with probability F, by the number p of [0, 1), and the number that is left."""
    before = running[row, begin - 1] if begin > 0 else 0.0
    target = before + p * (running[row, end - 1] - before)
    low, high = begin, end - 1
    while low < high:  # the first whose sum exceeds the target
        middle = (low + high) // 2
        if running[row, middle] > target:
            high = middle
        else:
            low = middle + 1
    own = F[row, low]
    left = (target - (running[row, low] - own)) / own if own > 0 else 0.5
    return low, min(max(left, 0.0), LAST)


@compiled(
    "f8[:,:], f8[:,:], f8[:,:], f8[:,:], i8[:], i8[:], f8[:,:], f8[:,:], i8[:],"
    "f8[:,:], f8[:,:], f8[:,:], f8[:,:], b1[:], f8[:], i8, f4[:,:], f4[:,:], f8[:], i8[:]",
)
def shadow_rays(
    x,
    N,
    shift,
    points,
    asked,
    l,
    F,
    running,
    first,
    origin,
    e1,
    e2,
    normal,
    is_triangle,
    area,
    alike,
    origins,
    D,
    w,
    pair,
):
    """Rays from samples to points on emitters, and the weights w_k of those points.

    x, N (m, 3), shift (m, 2) of all samples; points (p, 2); of the facets area, times weight
    alike : every emitter is a single facet, whose area cancels
    origins, D (k p, 3), w, pair (k p,) come back: rays with w > 0 and the number of their pair, in their order; returns
    how many.
    """
    n = 0
    for k in range(len(asked)):
        row, begin, end = asked[k], first[l[k]], first[l[k] + 1]
        X, Y, Z = x[row, 0], x[row, 1], x[row, 2]
        nx, ny, nz = N[row, 0], N[row, 1], N[row, 2]
        f, density = begin, 1.0
        for point in range(len(points)):
            a, b = points[point, 0] + shift[row, 0], points[point, 1] + shift[row, 1]
            a, b = a - 1 if a >= 1 else a, b - 1 if b >= 1 else b
            if not alike:
                f, a = chosen(running, F, row, begin, end, a)
                density = F[row, f] / area[f]
                if density <= 0:
                    continue
            if is_triangle[f] and a + b > 1:
                a, b = 1 - a, 1 - b
            dx = origin[f, 0] - X + a * e1[f, 0] + b * e2[f, 0]
            dy = origin[f, 1] - Y + a * e1[f, 1] + b * e2[f, 1]
            dz = origin[f, 2] - Z + a * e1[f, 2] + b * e2[f, 2]
            cos_x = dx * nx + dy * ny + dz * nz
            cos_y = -(dx * normal[f, 0] + dy * normal[f, 1] + dz * normal[f, 2])
            if cos_x <= 0 or cos_y <= 0:
                continue
            r2 = dx * dx + dy * dy + dz * dz
            w[n] = cos_x * cos_y / max(r2 * r2, 1e-30) / density
            pair[n] = k
            origins[n, 0], origins[n, 1], origins[n, 2] = X, Y, Z
            D[n, 0], D[n, 1], D[n, 2] = dx, dy, dz
            n += 1
    return n


@compiled("f8[:], i8[:], b1[:], f8[:], f8[:]")
def seen_and_total(w, pair, blocked, seen, total):
    """Add the weights w (n,) of rays to total[pair], and those that are not blocked to seen[pair]."""
    for n in range(len(blocked)):
        total[pair[n]] += w[n]
        if not blocked[n]:
            seen[pair[n]] += w[n]
    return 0


@compiled("f8[:,:], f8[:,:], i8[:], i8[:], f8[:,:], f8[:,:], i8[:], f8[:,:,:], f4[:,:]")
def to_highest_corners(x, N, asked, l, F, running, first, corners, D):
    """Towards the corner highest above the horizon of the facet in the middle of each emitter: D (k, 3)."""
    for k in range(len(asked)):
        row = asked[k]
        facet, _ = chosen(running, F, row, first[l[k]], first[l[k] + 1], 0.5)
        best = -math.inf
        for corner in range(corners.shape[1]):
            dx = corners[facet, corner, 0] - x[row, 0]
            dy = corners[facet, corner, 1] - x[row, 1]
            dz = corners[facet, corner, 2] - x[row, 2]
            height = dx * N[row, 0] + dy * N[row, 1] + dz * N[row, 2]
            if height > best:
                best = height
                D[k, 0], D[k, 1], D[k, 2] = np.float32(dx), np.float32(dy), np.float32(dz)
    return 0
