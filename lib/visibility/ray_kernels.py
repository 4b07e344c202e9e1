"""Compiled loops over rays: directions about normals, and what hits mean.

Arrays of rays hold those of a point together: ray i K + k is the k-th of point i.  Every kernel writes into arrays it
is given and returns 0 or a count.
"""

import math

import numpy as np

from lib.compiled import compiled, inlined

LEVEL = -1e-5  # z of a normal below which the frame is the other one: not 0, where rounding would choose it
NONE = np.float32(0)
ONE = np.float32(1)
TURN = np.float32(2 * np.pi)
FLAT = np.float32(1e-12)  # least cos^2 of a direction: never exactly along the plane


@inlined
def frame_of(x, y, z, one):
    """Sign, a and b of the tangent frame of the normal (x, y, z): T = (1 + sign x^2 a, sign b, -sign x),
    U = (b, sign + y^2 a, -y); Duff et al. 2017.  one : 1 of their type."""
    sign = one if z >= LEVEL else -one
    a = -one / (sign + z)
    return sign, a, x * y * a


@compiled("f8[:,:], f8[:,:], f8[:,:], f4[:,:], f4[:,:], f4[:,:], f4[:,:], f4[:,:]")
def hemisphere_rays(x, N, shift, radius2, cos_phi, sin_phi, origins, D):
    """K cosine directions about each of m normals, from points x.

    x, N (m, 3); radius2, cos_phi, sin_phi (P, K) points of the disc, of which normal i takes row i mod P; shift
    (m / P, 2), of which it takes row i // P; origins, D (m K, 3) come back.
    """
    P, K = radius2.shape
    for i in range(len(N)):
        row, group = i % P, i // P
        nx, ny, nz = N[i, 0], N[i, 1], N[i, 2]
        sign, a, b = frame_of(nx, ny, nz, 1.0)
        # The second coordinate turns about N: its shift turns the frame once, not every direction.
        turn = 2 * math.pi * shift[group, 1]
        c, s = math.cos(turn), math.sin(turn)
        tx, ty, tz = 1 + sign * nx * nx * a, sign * b, -sign * nx
        ux, uy, uz = b, sign + ny * ny * a, -ny
        Tx, Ty, Tz = np.float32(c * tx + s * ux), np.float32(c * ty + s * uy), np.float32(c * tz + s * uz)
        Ux, Uy, Uz = np.float32(c * ux - s * tx), np.float32(c * uy - s * ty), np.float32(c * uz - s * tz)
        Nx, Ny, Nz = np.float32(nx), np.float32(ny), np.float32(nz)
        q = np.float32(shift[group, 0])
        X, Y, Z = np.float32(x[i, 0]), np.float32(x[i, 1]), np.float32(x[i, 2])
        for k in range(K):
            r2 = radius2[row, k] + q
            if r2 >= ONE:
                r2 -= ONE
            r, z = np.sqrt(max(r2, NONE)), np.sqrt(max(ONE - r2, FLAT))
            t, u = r * cos_phi[row, k], r * sin_phi[row, k]
            ray = i * K + k
            D[ray, 0] = t * Tx + u * Ux + z * Nx
            D[ray, 1] = t * Ty + u * Uy + z * Ny
            D[ray, 2] = t * Tz + u * Uz + z * Nz
            origins[ray, 0], origins[ray, 1], origins[ray, 2] = X, Y, Z
    return 0


@inlined
def cosine_direction(x, y, z, radius2, phi):
    """One direction about the normal (x, y, z), all float32: its three components."""
    sign, a, b = frame_of(x, y, z, ONE)
    r = np.sqrt(radius2)
    t, u, n = r * np.cos(phi), r * np.sin(phi), np.sqrt(max(ONE - radius2, FLAT))
    return (
        t * (ONE + sign * x * x * a) + u * b + n * x,
        t * sign * b + u * (sign + y * y * a) + n * y,
        -t * sign * x - u * y + n * z,
    )


@compiled("f4[:,:], f4[:,:], f4[:,:]")
def direction_each(N, points, D):
    """One direction about each normal: N (m, 3), points (m, 2) of [0, 1)^2, D (m, 3) comes back."""
    for i in range(len(N)):
        x, y, z = cosine_direction(N[i, 0], N[i, 1], N[i, 2], points[i, 0], TURN * points[i, 1])
        D[i, 0], D[i, 1], D[i, 2] = x, y, z
    return 0


@compiled("i4[:], f4[:], f4[:], b1[:], i8[:], f8[:,:,:], i8[:], i8[:], i8[:], i8, i4[:], u1[:]")
def elements_met(face, a, b, is_back, surface, corners, n_u, n_v, first, side, element, point):
    """Element of each hit, and which of its side x side points is nearest (see MeshLookup.element_of).

    surface (f,), corners (f, 3, 2) of the faces, the second and third relative to the first; n_u, n_v, first
    (surfaces,) the grids; element, point (n,) come back.
    """
    for r in range(len(face)):
        f = face[r]
        point[r] = 0
        if f < 0:
            element[r] = -1
            continue
        s = surface[f]
        if is_back[r] or n_u[s] == 0:
            element[r] = -2
            continue
        u = corners[f, 0, 0] + a[r] * corners[f, 1, 0] + b[r] * corners[f, 2, 0]
        v = corners[f, 0, 1] + a[r] * corners[f, 1, 1] + b[r] * corners[f, 2, 1]
        i = min(max(int(u * n_u[s] * side), 0), side * n_u[s] - 1)
        j = min(max(int(v * n_v[s] * side), 0), side * n_v[s] - 1)
        element[r] = first[s] + j // side * n_u[s] + i // side
        point[r] = j % side * side + i % side
    return 0


@compiled("i4[:], b1[:], b1[:], i8, f8, f8, b1[:]")
def buried(face, is_back, in_shell, K, share_in_shell, share_behind, hidden):
    """Points whose K rays meet back faces, more than `share_in_shell` of them inside closed shells or more than
    `share_behind` of them anywhere.

    in_shell (f,) of the faces; hidden (m,) comes back.
    """
    for i in range(len(hidden)):
        back, inside = 0, 0
        for ray in range(i * K, i * K + K):
            if is_back[ray] and face[ray] >= 0:
                back += 1
                inside += in_shell[face[ray]]
        hidden[i] = inside > share_in_shell * K or back > share_behind * K
    return 0
