"""Points, tangents and unit normals of NURBS surfaces, vectorised over parameters.

Source: Piegl, Tiller, The NURBS Book: A2.1 (span), A2.2 (basis), eq. 2.7 (derivative), eq. 4.20 (rational derivatives).
Normals: N = S_u x S_v; where it vanishes (pole, cusp, doubled control points) the limit from inside is taken.
"""

from functools import lru_cache

import numpy as np

from lib.nurbs.surface_kernels import density_points, evaluate_points

REMEMBERED = 8192  # numbers in the largest basis matrix that is kept
DEGENERATE = 1e-10  # |S_u x S_v| below this share of the surface's own scale has no direction in float64
NUDGES = (1e-7, 1e-5, 1e-3)  # steps into the domain: the limit to 1e-7 at a plain pole, later ones for higher orders


def span(knots, degree, n, u):
    """Index k with knots[k] <= u < knots[k+1], degree <= k < n; the last non-empty span at the end of the domain."""
    k = np.searchsorted(knots, u, side="right") - 1
    last = np.searchsorted(knots, knots[n], side="left") - 1
    return np.clip(k, degree, last)


def basis(knots, degree, n, u):
    """Basis functions N and derivatives dN at u (m,): span (m,), N (m, degree + 1), dN (m, degree + 1).

    >>> k, N, _ = basis(np.array([0, 0, 0, 1, 2, 3, 4, 4, 5, 5, 5.0]), 2, 8, np.array([2.5]))
    >>> int(k[0]), N[0].tolist()
    (4, [0.125, 0.75, 0.125])
    """
    u = np.asarray(u, dtype=np.float64)
    k = span(knots, degree, n, u)
    N = np.ones((u.size, 1))
    for p in range(1, degree + 1):
        # knots left and right of every function of degree p - 1 that is not zero in the span
        left = knots[k[:, None] + np.arange(1 - p, 1)]
        right = knots[k[:, None] + np.arange(1, p + 1)]
        part = N / (right - left)
        if p == degree:
            dN = degree * (_shift(part, 1) - _shift(part, 0))
        N = _shift(part * (u[:, None] - left), 1) + _shift(part * (right - u[:, None]), 0)
    return k, N, dN


def _shift(a, left):
    out = np.zeros((len(a), a.shape[1] + 1))  # np.pad takes ten times as long
    out[:, left : left + a.shape[1]] = a
    return out


def evaluate(surface, u, v):
    """Points and first derivatives at parameters u, v (m,) in [0, 1]: S, S_u, S_v, each (m, 3)."""
    out = np.empty((3, np.broadcast(u, v).size, 3))
    _at_points(evaluate_points, surface, u, v, out)
    return out[0], out[1], out[2]


def densities(surface, u, v):
    """|S_u x S_v|, |S_u| and |S_v| at parameters u, v (m,) in [0, 1]: (m, 3)."""
    out = np.empty((np.broadcast(u, v).size, 3))
    _at_points(density_points, surface, u, v, out)
    return out


def _at_points(kernel, surface, u, v, out):
    u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
    u, v, Pw = (np.ascontiguousarray(x) for x in (u, v, surface.Pw))
    p, q = surface.degree_u, surface.degree_v
    kernel(surface.knots_u, surface.knots_v, Pw, p, q, u, v, np.empty((4, max(p, q) + 1)), out)


def _project(A, A_u, A_v):
    w = A[..., 3:]
    S = A[..., :3] / w
    return S, (A_u[..., :3] - A_u[..., 3:] * S) / w, (A_v[..., :3] - A_v[..., 3:] * S) / w


def evaluate_grid(surface, u, v):
    """Points and derivatives on the grid of u (m,) and v (k,): S, S_u, S_v, each (k, m, 3), row j is v[j]."""
    N, dN = _dense(surface.knots_u, surface.degree_u, surface.Pw.shape[0], u)
    M, dM = _dense(surface.knots_v, surface.degree_v, surface.Pw.shape[1], v)
    rows, rows_v = np.einsum("jb,abc->jac", M, surface.Pw), np.einsum("jb,abc->jac", dM, surface.Pw)
    return _project(N @ rows, dN @ rows, N @ rows_v)


def _dense(knots, degree, n, u):
    """Basis functions and derivatives as full rows: (2, m, n), remembered, since surfaces share knots and grids."""
    u = np.asarray(u, dtype=np.float64)
    remembered = _remembered if u.size * n <= REMEMBERED else _remembered.__wrapped__
    return remembered(knots.tobytes(), degree, n, u.tobytes())


@lru_cache(maxsize=256)
def _remembered(knots, degree, n, u):
    u = np.frombuffer(u)
    k, N, dN = basis(np.frombuffer(knots), degree, n, u)
    full = np.zeros((2, u.size, n))
    columns = k[:, None] + np.arange(-degree, 1)
    np.put_along_axis(full[0], columns, N, axis=1)
    np.put_along_axis(full[1], columns, dN, axis=1)
    full.flags.writeable = False
    return full


def point(surface, u, v):
    """Points S (m, 3) at parameters u, v (m,)."""
    return evaluate(surface, u, v)[0]


def normal(surface, u, v):
    """Unit normals S_u x S_v (m, 3); at a pole or cusp the limit from inside.

    Raises ValueError if there is no direction even a thousandth inside the domain.
    """
    u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
    _, S_u, S_v = evaluate(surface, u, v)
    return _limit(surface, u, v, np.cross(S_u, S_v))


def frame(surface, u, v):
    """Points and unit normals at once: S (m, 3), N (m, 3)."""
    u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
    S, S_u, S_v = evaluate(surface, u, v)
    return S, _limit(surface, u, v, np.cross(S_u, S_v))


def frame_grid(surface, u, v):
    """Points and unit normals on a grid: S (k, m, 3), N (k, m, 3), row j is v[j]."""
    return density_grid(surface, u, v)[:2]


def density_grid(surface, u, v):
    """Points, unit normals and area per area of (u, v) on a grid: S (k, m, 3), N (k, m, 3), |S_u x S_v| (k, m)."""
    S, S_u, S_v = evaluate_grid(surface, u, v)
    cross = np.cross(S_u, S_v)
    density = np.linalg.norm(cross, axis=2)
    uu, vv = np.meshgrid(u, v)
    N = _limit(surface, uu.ravel(), vv.ravel(), cross.reshape(-1, 3))
    return S, N.reshape(S.shape), density


def _limit(surface, u, v, cross):
    """Normalise; where the cross product vanishes, step into the domain until it has a direction."""
    smallest = DEGENERATE * scale(surface)
    length = np.linalg.norm(cross, axis=1)
    flat = np.flatnonzero(~(length > smallest))
    for step in NUDGES:
        if not flat.size:
            break
        inside_u = u[flat] + np.where(u[flat] < 0.5, step, -step)
        inside_v = v[flat] + np.where(v[flat] < 0.5, step, -step)
        _, S_u, S_v = evaluate(surface, inside_u, inside_v)
        cross[flat] = np.cross(S_u, S_v)
        length[flat] = np.linalg.norm(cross[flat], axis=1)
        flat = flat[~(length[flat] > smallest)]
    if flat.size:
        raise ValueError(f"no normal at u = {u[flat[0]]:g}, v = {v[flat[0]]:g}: the surface has no area there")
    return cross / length[:, None]


def scale(surface):
    """A bound like |S_u| |S_v| from the control net, for relative comparisons; > 0 unless the surface is a curve."""
    P = surface.P
    along_u = np.linalg.norm(np.diff(P, axis=0), axis=2).sum(axis=0).max()
    along_v = np.linalg.norm(np.diff(P, axis=1), axis=2).sum(axis=1).max()
    return along_u * along_v
