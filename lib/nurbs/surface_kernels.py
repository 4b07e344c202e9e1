"""Compiled points and derivatives of NURBS surfaces.

Source: Piegl, Tiller, The NURBS Book: A2.1 (span), A2.2 (basis), eq. 2.7 (derivative), eq. 4.20 (rational derivatives).
"""

import math

from lib.compiled import compiled, inlined


@inlined
def basis_at(knots, degree, n, u, N, dN):
    """Put the basis functions that are not zero at u, and their derivatives, into N and dN (degree + 1,); returns the
    span."""
    low, high = degree, n - 1  # the last k with knots[k] <= u, and knots[k] < knots[n]
    while low < high:
        middle = (low + high + 1) // 2
        if knots[middle] <= u and knots[middle] < knots[n]:
            low = middle
        else:
            high = middle - 1
    N[0] = 1.0
    for p in range(1, degree + 1):
        saved = before = 0.0
        for r in range(p):
            left, right = knots[low + 1 - p + r], knots[low + 1 + r]
            part = N[r] / (right - left)
            dN[r] = degree * (before - part)  # of the last round
            N[r] = saved + part * (right - u)
            saved, before = part * (u - left), part
        N[p], dN[p] = saved, degree * before
    return low


@inlined
def point_at(knots_u, knots_v, Pw, p, q, u, v, scratch):
    """S, S_u and S_v at one u, v: 9 numbers.

    knots_u, knots_v, Pw (n_u, n_v, 4), p, q : those of the surface and its degrees;  scratch (4, max(p, q) + 1)
    """
    N, dN, M, dM = scratch[0], scratch[1], scratch[2], scratch[3]
    k = basis_at(knots_u, p, Pw.shape[0], u, N, dN) - p
    m = basis_at(knots_v, q, Pw.shape[1], v, M, dM) - q
    x = y = z = w = x_u = y_u = z_u = w_u = x_v = y_v = z_v = w_v = 0.0
    for a in range(p + 1):
        rx = ry = rz = rw = tx = ty = tz = tw = 0.0  # along v: the row, and its derivative
        for b in range(q + 1):
            X, Y, Z, W = Pw[k + a, m + b, 0], Pw[k + a, m + b, 1], Pw[k + a, m + b, 2], Pw[k + a, m + b, 3]
            f, g = M[b], dM[b]
            rx, ry, rz, rw = rx + f * X, ry + f * Y, rz + f * Z, rw + f * W
            tx, ty, tz, tw = tx + g * X, ty + g * Y, tz + g * Z, tw + g * W
        f, g = N[a], dN[a]
        x, y, z, w = x + f * rx, y + f * ry, z + f * rz, w + f * rw
        x_u, y_u, z_u, w_u = x_u + g * rx, y_u + g * ry, z_u + g * rz, w_u + g * rw
        x_v, y_v, z_v, w_v = x_v + f * tx, y_v + f * ty, z_v + f * tz, w_v + f * tw
    x, y, z = x / w, y / w, z / w
    x_u, y_u, z_u = (x_u - w_u * x) / w, (y_u - w_u * y) / w, (z_u - w_u * z) / w
    return x, y, z, x_u, y_u, z_u, (x_v - w_v * x) / w, (y_v - w_v * y) / w, (z_v - w_v * z) / w


@compiled("f8[:], f8[:], f8[:,:,:], i8, i8, f8[:], f8[:], f8[:,:], f8[:,:,:]")
def evaluate_points(knots_u, knots_v, Pw, p, q, u, v, scratch, out):
    """S, S_u and S_v at each of u, v (m,) into out (3, m, 3); the rest as of `point_at`."""
    for i in range(len(u)):
        x, y, z, x_u, y_u, z_u, x_v, y_v, z_v = point_at(knots_u, knots_v, Pw, p, q, u[i], v[i], scratch)
        out[0, i, 0], out[0, i, 1], out[0, i, 2] = x, y, z
        out[1, i, 0], out[1, i, 1], out[1, i, 2] = x_u, y_u, z_u
        out[2, i, 0], out[2, i, 1], out[2, i, 2] = x_v, y_v, z_v
    return 0


@compiled("f8[:], f8[:], f8[:,:,:], i8, i8, f8[:], f8[:], f8[:,:], f8[:,:]")
def density_points(knots_u, knots_v, Pw, p, q, u, v, scratch, out):
    """|S_u x S_v|, |S_u| and |S_v| at each of u, v (m,) into out (m, 3); the rest as of `point_at`."""
    for i in range(len(u)):
        _, _, _, x, y, z, a, b, c = point_at(knots_u, knots_v, Pw, p, q, u[i], v[i], scratch)
        out[i, 0] = math.sqrt((y * c - z * b) ** 2 + (z * a - x * c) ** 2 + (x * b - y * a) ** 2)
        out[i, 1] = math.sqrt(x * x + y * y + z * z)
        out[i, 2] = math.sqrt(a * a + b * b + c * c)
    return 0
