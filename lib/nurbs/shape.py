"""What a surface is as a shape: closed, collapsed, planar, its area and extent; independent of knots and weights' scale."""

import numpy as np

from lib.nurbs.evaluate import evaluate_grid
from lib.nurbs.surface import NurbsSurface

SAME = 1e-9  # points closer than this share of the surface's size are one point
PLANAR = 1e-7  # a surface within this share of its size of a plane is planar: float32 rays can not tell
SIDE_SAMPLES = np.linspace(0.0, 1.0, 17)
GAUSS_CELLS, GAUSS_ORDER = 16, 4  # composite Gauss-Legendre between knots: 1e-9 on spheres


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


def _gauss(knots):
    """Nodes and weights over [0, 1]: no cell crosses a knot, where derivatives jump."""
    x, weight = np.polynomial.legendre.leggauss(GAUSS_ORDER)
    spans = np.unique(np.concatenate([[0.0, 1.0], knots[(knots > 0) & (knots < 1)]]))
    parts = np.ceil(np.diff(spans) * GAUSS_CELLS).astype(int)
    lines = [a + (b - a) * np.arange(n) / n for a, b, n in zip(spans[:-1], spans[1:], parts, strict=True)]
    start = np.concatenate([*lines, [1.0]])
    step = np.diff(start)[:, None]
    return (start[:-1, None] + step * (x + 1) / 2).ravel(), (step * weight / 2).ravel()


def area(surface):
    """Area of the surface [m^2], integral of |S_u x S_v|."""
    (u, weight_u), (v, weight_v) = _gauss(surface.knots_u), _gauss(surface.knots_v)
    _, S_u, S_v = evaluate_grid(surface, u, v)
    return float(weight_v @ np.linalg.norm(np.cross(S_u, S_v), axis=2) @ weight_u)


def extent(surface):
    """Mean length of the curves along u and along v: (length_u, length_v)."""
    (u, weight_u), (v, weight_v) = _gauss(surface.knots_u), _gauss(surface.knots_v)
    _, S_u, S_v = evaluate_grid(surface, u, v)
    return tuple(float(weight_v @ np.linalg.norm(along, axis=2) @ weight_u) for along in (S_u, S_v))


def transformed(surface, M):
    """The surface under the affine map M (4, 4): S' = M S.  Orientation of S_u x S_v flips if det M < 0."""
    Pw = surface.Pw @ np.asarray(M, dtype=np.float64).T
    return NurbsSurface(surface.degree_u, surface.degree_v, surface.knots_u, surface.knots_v, Pw)
