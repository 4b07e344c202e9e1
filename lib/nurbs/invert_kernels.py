"""Compiled search for the parameters of points: the nearest points of a grid, and damped Gauss-Newton steps from them.

Every point is sought by itself, whatever the others are.  Source: Marquardt 1963 (damping).
"""

import math

from lib.compiled import compiled, inlined
from lib.nurbs.curve_kernels import off_segment
from lib.nurbs.surface_kernels import evaluate_points

MOST_STEPS = 60
CONVERGED = 1e-12  # last step in space, of the surface's size
MOST_DAMPING = 1e4
evaluated = inlined(evaluate_points.__wrapped__)


@compiled("f8[:,:,:], f8[:,:,:], f8[:,:], i8[:,:], f8[:,:]")
def nearest_of_grid(grid, boxes, points, found, square):
    """The n points of a grid nearest to each of points (k, 3): their numbers into found (k, n), the nearest first.

    grid : (rows, m, 3);  boxes : (rows, 2, 3) lowest and highest corner of each row;  square : (k, n) squared distances
    Of points equally far the one with the lower number is the nearer.
    """
    rows, m, n = grid.shape[0], grid.shape[1], found.shape[1]
    first = 0  # row of the nearest point: it is likely to be that of the next point too
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for k in range(n):
            found[i, k], square[i, k] = rows * m, math.inf
        for step in range(rows):
            row = (first + step) % rows
            dx = max(boxes[row, 0, 0] - x, x - boxes[row, 1, 0], 0.0)
            dy = max(boxes[row, 0, 1] - y, y - boxes[row, 1, 1], 0.0)
            dz = max(boxes[row, 0, 2] - z, z - boxes[row, 1, 2], 0.0)
            if dx * dx + dy * dy + dz * dz > square[i, n - 1]:
                continue
            for j in range(m):
                dx, dy, dz = grid[row, j, 0] - x, grid[row, j, 1] - y, grid[row, j, 2] - z
                far, number, k = dx * dx + dy * dy + dz * dz, row * m + j, n
                while k > 0 and (far < square[i, k - 1] or (far == square[i, k - 1] and number < found[i, k - 1])):
                    k -= 1
                    if k + 1 < n:
                        found[i, k + 1], square[i, k + 1] = found[i, k], square[i, k]
                if k < n:
                    found[i, k], square[i, k] = number, far
        first = found[i, 0] // m % rows
    return 0


@inlined
def inside(x):
    """x, or the end of [0, 1] that is nearer."""
    return min(max(x, 0.0), 1.0)


@inlined
def limited(x, limit):
    """x, or the end of [-limit, limit] that is nearer."""
    return min(max(x, -limit), limit)


@inlined
def dot(ax, ay, az, bx, by, bz):
    """Product of two vectors, added up in the order in which numpy's einsum does it for three numbers."""
    return ax * bx + az * bz + ay * by


@inlined
def distance_of(points, i, S, k):
    """Distance between points[i] and S[k], both (m, 3)."""
    dx, dy, dz = points[i, 0] - S[k, 0], points[i, 1] - S[k, 1], points[i, 2] - S[k, 2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@compiled("f8[:], f8[:], f8[:,:,:], i8, i8, i8, i8, f8, f8[:,:], f8[:,:], f8[:], f8[:,:], f8[:,:,:,:], f8[:,:]")
def descend(knots_u, knots_v, Pw, p, q, closed_u, closed_v, size, points, uv, distance, scratch, places, at):
    """Damped Gauss-Newton from uv (k, 2), which is changed, towards points (k, 3): distances into distance (k,).

    knots_u, knots_v, Pw, p, q, scratch : as in evaluate_points;  closed_u, closed_v : 0 or 1;  size : of the surface
    places : (2, 3, 1, 3) S, S_u, S_v where the search is and where it may go;  at : (2, 1) parameters, wrapped
    """
    now, new = places[0], places[1]
    for i in range(len(points)):
        u, v = uv[i, 0], uv[i, 1]
        at[0, 0], at[1, 0] = u, v
        evaluated(knots_u, knots_v, Pw, p, q, at[0], at[1], scratch, now)
        far, damping = distance_of(points, i, now[0], 0), 1e-6
        for _ in range(MOST_STEPS):
            # One damped step, inside the domain
            rx, ry, rz = points[i, 0] - now[0, 0, 0], points[i, 1] - now[0, 0, 1], points[i, 2] - now[0, 0, 2]
            ux, uy, uz, vx, vy, vz = now[1, 0, 0], now[1, 0, 1], now[1, 0, 2], now[2, 0, 0], now[2, 0, 1], now[2, 0, 2]
            b, g, h = dot(ux, uy, uz, vx, vy, vz), dot(ux, uy, uz, rx, ry, rz), dot(vx, vy, vz, rx, ry, rz)
            floor = 1e-30 * (size * size)
            a = dot(ux, uy, uz, ux, uy, uz) * (1 + damping) + floor
            c = dot(vx, vy, vz, vx, vy, vz) * (1 + damping) + floor
            det = max(a * c - b * b, 1e-14 * a * c)
            next_u, next_v = u + (c * g - b * h) / det, v + (a * h - b * g) / det
            # Where one parameter is held at its end, the other is solved for alone
            if not closed_u:
                held = inside(next_u)
                if held != next_u:
                    next_v = v + (h - b * (held - u)) / c
                next_u = held
            if not closed_v:
                held = inside(next_v)
                if held != next_v:
                    next_u = u + (g - b * (held - v)) / a
                    if not closed_u:
                        next_u = inside(next_u)
                next_v = held
            next_u = u + limited(next_u - u, 0.25 if closed_u else 1.0)
            next_v = v + limited(next_v - v, 0.25 if closed_v else 1.0)

            # Take it if it leads nearer
            at[0, 0] = next_u - math.floor(next_u) if closed_u else next_u
            at[1, 0] = next_v - math.floor(next_v) if closed_v else next_v
            evaluated(knots_u, knots_v, Pw, p, q, at[0], at[1], scratch, new)
            moved, trial = distance_of(new[0], 0, now[0], 0), distance_of(points, i, new[0], 0)
            if trial < far:
                u, v, far = next_u, next_v, trial
                damping /= 10
                for j in range(3):
                    for k in range(3):
                        now[j, 0, k] = new[j, 0, k]
            else:
                damping *= 100
            if moved <= CONVERGED * size or damping > MOST_DAMPING:
                break
        uv[i, 0] = u - math.floor(u) if closed_u else u
        uv[i, 1] = v - math.floor(v) if closed_v else v
        distance[i] = far
    return 0


@compiled("f8[:], f8[:], f8[:,:,:], i8, i8, i8, i8, f8[:,:], f8[:,:], f8[:,:], f8[:,:,:,:], f8[:,:], f8[:]")
def stray(knots_u, knots_v, Pw, p, q, closed_u, closed_v, line, uv, scratch, places, at, out):
    """How far the middle of each step in uv (k, 2) lies from the step in space, of line (k, 3), into out (k - 1,).

    The others are as in `descend`.
    """
    now = places[0]
    for i in range(len(line) - 1):
        du, dv = uv[i + 1, 0] - uv[i, 0], uv[i + 1, 1] - uv[i, 1]
        u, v = uv[i, 0] + (du - round(du) if closed_u else du) / 2, uv[i, 1] + (dv - round(dv) if closed_v else dv) / 2
        at[0, 0], at[1, 0] = u - math.floor(u) if closed_u else u, v - math.floor(v) if closed_v else v
        evaluated(knots_u, knots_v, Pw, p, q, at[0], at[1], scratch, now)
        out[i] = off_segment(now[0], 0, line, i, i + 1)
    return 0
