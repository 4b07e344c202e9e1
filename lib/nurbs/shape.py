"""What a surface is as a shape: closed, collapsed, planar, its area and extent; independent of knots and weights' scale."""

import numpy as np

from lib.nurbs.evaluate import evaluate_grid
from lib.nurbs.surface import NurbsSurface

SAME = 1e-9  # points closer than this share of the surface's size are one point
PLANAR = 1e-7  # a surface within this share of its size of a plane is planar: float32 rays can not tell
SIDE_SAMPLES = np.linspace(0.0, 1.0, 17)
GAUSS_CELLS, GAUSS_ORDER = 16, 4  # composite Gauss-Legendre: 1e-9 on spheres, 1e-5 across creases between cells


def size(surface):
    """The largest side of the bounding box of points on the surface."""
    S = evaluate_grid(surface, SIDE_SAMPLES, SIDE_SAMPLES)[0].reshape(-1, 3)
    return float(np.ptp(S, axis=0).max())


def sides(surface):
    """Points along the sides u=0, u=1, v=0, v=1: (4, 17, 3)."""
    ends = np.array([0.0, 1.0])
    along_v = evaluate_grid(surface, ends, SIDE_SAMPLES)[0]
    along_u = evaluate_grid(surface, SIDE_SAMPLES, ends)[0]
    return np.stack([along_v[:, 0], along_v[:, 1], along_u[0], along_u[1]])


def is_closed(surface):
    """(closed in u, closed in v): opposite sides are the same curve, and not one point."""
    S, same = sides(surface), SAME * size(surface)
    collapsed = collapsed_sides(surface)
    return (
        bool(np.abs(S[0] - S[1]).max() <= same and not collapsed[0]),
        bool(np.abs(S[2] - S[3]).max() <= same and not collapsed[2]),
    )


def collapsed_sides(surface):
    """(4,) bool: sides u=0, u=1, v=0, v=1 that are one point (poles)."""
    S = sides(surface)
    return np.abs(S - S[:, :1]).max(axis=(1, 2)) <= SAME * size(surface)


def is_planar(surface):
    """True when every point lies in one plane, to float32 precision."""
    S = evaluate_grid(surface, SIDE_SAMPLES, SIDE_SAMPLES)[0].reshape(-1, 3)
    centred = S - S.mean(axis=0)
    plane = np.linalg.svd(centred, full_matrices=False)[2][2]
    return bool(np.abs(centred @ plane).max() <= PLANAR * np.ptp(S, axis=0).max())


def _gauss():
    x, weight = np.polynomial.legendre.leggauss(GAUSS_ORDER)
    t = (np.arange(GAUSS_CELLS)[:, None] + (x + 1) / 2).ravel() / GAUSS_CELLS
    return t, np.tile(weight / 2 / GAUSS_CELLS, GAUSS_CELLS)


def area(surface):
    """Area of the surface [m^2], integral of |S_u x S_v|."""
    t, weight = _gauss()
    _, S_u, S_v = evaluate_grid(surface, t, t)
    return float(weight @ np.linalg.norm(np.cross(S_u, S_v), axis=2) @ weight)


def extent(surface):
    """Mean length of the curves along u and along v: (length_u, length_v)."""
    t, weight = _gauss()
    _, S_u, S_v = evaluate_grid(surface, t, t)
    return float(weight @ np.linalg.norm(S_u, axis=2) @ weight), float(weight @ np.linalg.norm(S_v, axis=2) @ weight)


def transformed(surface, M):
    """The surface under the affine map M (4, 4): S' = M S.  Orientation of S_u x S_v flips if det M < 0."""
    Pw = surface.Pw @ np.asarray(M, dtype=np.float64).T
    return NurbsSurface(surface.degree_u, surface.degree_v, surface.knots_u, surface.knots_v, Pw)
