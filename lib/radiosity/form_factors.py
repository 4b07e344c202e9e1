"""Form factors from a point to flat facets: the exact polygon for near ones, Gauss points farther off, the disc for far
ones.

Polygon: Lambert's formula, Baum et al. 1989, clipped to the receiver's horizon.  Disc: Wallace et al. 1989.
The disc's area below the fraction line is right on its axis alone: elsewhere it takes A / (pi r^2) away, 0.5 % at
r = 8 sqrt(A), and no subdivision into discs mends that nearby.  All lamps of a room seen aside are too dim by that,
so discs begin where it is small, and the kernel is summed over Gauss points between.
"""

import math

import numpy as np

from lib.compiled import compiled, inlined

NEAR, FAR = 8.0, 40.0  # polygons up to, discs from, in units of a facet's longer side: 0.02 % from there on
SQUARE = 1 / math.sqrt(12)  # Gauss points of the unit square lie this far from its middle: degree 3
NO_EDGE = 1e-30  # |v_k x v_k+1| below this: the edge is a point or seen end-on


@inlined
def disc(dx, dy, dz, nx, ny, nz, fx, fy, fz, area):
    """cos cos' / (pi r^2 + A) for a facet at (dx, dy, dz), 0 where either looks away; n, f unit normals of receiver
    and facet."""
    r2 = dx * dx + dy * dy + dz * dz
    cos_x, cos_y = dx * nx + dy * ny + dz * nz, -(dx * fx + dy * fy + dz * fz)
    if cos_x <= 0 or cos_y <= 0:
        return 0.0
    return cos_x * cos_y / max(r2 * (math.pi * r2 + area), NO_EDGE)


@inlined
def edge(ax, ay, az, bx, by, bz, nx, ny, nz):
    """theta n . c / |c| of the edge from a to b, c = a x b."""
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(cx * cx + cy * cy + cz * cz)
    if length <= NO_EDGE:
        return 0.0
    theta = math.atan2(length, ax * bx + ay * by + az * bz)
    return theta * (cx * nx + cy * ny + cz * nz) / length


@inlined
def polygon(vertices, i, x, y, z, nx, ny, nz):
    """F of the polygon vertices[i] (k, 3) seen from (x, y, z) with normal n: every edge is cut at the horizon; one that
    goes down leaves at `out`, one that comes up enters at `into`."""
    k = vertices.shape[1]
    total, is_cut = 0.0, False
    out_x = out_y = out_z = into_x = into_y = into_z = 0.0
    bx, by, bz = vertices[i, 0, 0] - x, vertices[i, 0, 1] - y, vertices[i, 0, 2] - z
    height_b = bx * nx + by * ny + bz * nz
    for following in range(1, k + 1):
        j = following % k
        ax, ay, az, height_a = bx, by, bz, height_b
        bx, by, bz = vertices[i, j, 0] - x, vertices[i, j, 1] - y, vertices[i, j, 2] - z
        height_b = bx * nx + by * ny + bz * nz
        if height_a > 0 and height_b > 0:
            total += edge(ax, ay, az, bx, by, bz, nx, ny, nz)
            continue
        is_cut = True
        if height_a <= 0 and height_b <= 0:
            continue
        t = height_a / (height_a - height_b)
        cx, cy, cz = ax + t * (bx - ax), ay + t * (by - ay), az + t * (bz - az)
        if height_a > 0:
            total += edge(ax, ay, az, cx, cy, cz, nx, ny, nz)
            out_x, out_y, out_z = cx, cy, cz
        else:
            total += edge(cx, cy, cz, bx, by, bz, nx, ny, nz)
            into_x, into_y, into_z = cx, cy, cz
    if is_cut:
        total += edge(out_x, out_y, out_z, into_x, into_y, into_z, nx, ny, nz)
    return abs(total) / (2 * math.pi)


@compiled("f8[:,:,:], f8[:,:], f8[:]")
def polygons(vertices, n, F):
    """F (m,) of one polygon each: vertices (m, k, 3) relative to the point, n (m, 3)."""
    for i in range(len(F)):
        F[i] = polygon(vertices, i, 0.0, 0.0, 0.0, n[i, 0], n[i, 1], n[i, 2])
    return 0


def form_factor_polygon(vertices, n):
    """Exact F of convex polygons seen from a point with normal n; what lies below the horizon is cut away.

    vertices (m, k, 3) relative to the point, in order (either way round; repeated ones are allowed), n (m, 3).
    Returns (m,) in [0, 1].

    F = 1 / (2 pi) |sum_k theta_k n . c_k / |c_k||, c_k = v_k x v_k+1, theta_k = atan2(|c_k|, v_k . v_k+1).
    """
    F = np.empty(len(vertices))
    polygons(*(np.ascontiguousarray(a, dtype=np.float64) for a in (vertices, n)), F)
    return F


@inlined
def gauss(dx, dy, dz, nx, ny, nz, normal, e1, e2, j, is_triangle):
    """F / A of facet j, whose origin lies at (dx, dy, dz): the bare kernel at Gauss points of degree 3, on triangles
    of degree 2."""
    n_points = 3 if is_triangle else 4
    total = 0.0
    for p in range(n_points):
        if is_triangle:
            a, b = (4 if p == 1 else 1) / 6, (4 if p == 2 else 1) / 6
        else:
            a, b = 0.5 + (SQUARE if p >= 2 else -SQUARE), 0.5 + (SQUARE if p % 2 else -SQUARE)
        x, y, z = (
            dx + a * e1[j, 0] + b * e2[j, 0],
            dy + a * e1[j, 1] + b * e2[j, 1],
            dz + a * e1[j, 2] + b * e2[j, 2],
        )
        total += disc(x, y, z, nx, ny, nz, normal[j, 0], normal[j, 1], normal[j, 2], 0.0)
    return total / n_points


@compiled(
    "f8[:,:], f8[:,:], f8[:,:], f8[:,:], f8[:,:], f8[:,:], f8[:,:,:], f8[:,:], f8[:], b1[:], f8, f8[:,:]",
)
def facets_seen(x, n, centre, origin, e1, e2, corners, normal, area, is_triangle, reach, F):
    """F (m, k) from m points to k facets (see form_factor_facets); reach, of the largest facet from its centre."""
    for j in range(len(area)):
        side = max(
            e1[j, 0] * e1[j, 0] + e1[j, 1] * e1[j, 1] + e1[j, 2] * e1[j, 2],
            e2[j, 0] * e2[j, 0] + e2[j, 1] * e2[j, 1] + e2[j, 2] * e2[j, 2],
        )
        fx, fy, fz = normal[j, 0], normal[j, 1], normal[j, 2]
        for i in range(len(x)):
            nx, ny, nz = n[i, 0], n[i, 1], n[i, 2]
            dx, dy, dz = centre[j, 0] - x[i, 0], centre[j, 1] - x[i, 1], centre[j, 2] - x[i, 2]
            F[i, j] = 0.0
            if dx * fx + dy * fy + dz * fz >= 0:
                continue
            height, r2 = dx * nx + dy * ny + dz * nz, dx * dx + dy * dy + dz * dz
            # What may reach below the horizon is cut there, as far off as it matters.
            is_low = height * height < side
            if height > -reach and r2 < side * (FAR * FAR if is_low else NEAR * NEAR):
                F[i, j] = polygon(corners, j, x[i, 0], x[i, 1], x[i, 2], nx, ny, nz)
            elif height > 0 and not is_low and r2 < FAR * FAR * side:
                dx, dy, dz = origin[j, 0] - x[i, 0], origin[j, 1] - x[i, 1], origin[j, 2] - x[i, 2]
                F[i, j] = area[j] * gauss(dx, dy, dz, nx, ny, nz, normal, e1, e2, j, is_triangle[j])
            else:
                F[i, j] = area[j] * disc(dx, dy, dz, nx, ny, nz, fx, fy, fz, area[j])
    return 0


def form_factor_facets(x, n, facets):
    """F from points to all facets, horizon and facing respected, visibility not.

    x, n (m, 3) points and unit normals; facets: Facets with k facets.  Returns (m, k) float64.
    """
    F, corners, centre = np.empty((len(x), len(facets.area))), facets.corners(), facets.centre
    reach = np.linalg.norm(corners - centre[:, None], axis=2).max(initial=0.0)
    arrays = x, n, centre, facets.origin, facets.e1, facets.e2, corners, facets.normal, facets.area
    arrays = (np.ascontiguousarray(a, dtype=np.float64) for a in arrays)
    facets_seen(*arrays, facets.is_triangle, reach, F)
    return F
