"""What a surface is as a shape: closed, collapsed, planar, its area and extent, whatever its knots and weights."""

from functools import lru_cache

import numpy as np

from lib.nurbs.evaluate import evaluate_grid
from lib.nurbs.surface import NurbsSurface

SAME = 1e-9  # points closer than this share of the surface's size are one point
PLANAR = 1e-7  # a surface within this share of its size of a plane is planar: float32 rays can not tell
REMEMBERED = 4  # surfaces: what is done with a surface asks for its size and sides over and over
SIDE_SAMPLES = np.linspace(0.0, 1.0, 17)
GAUSS_CELLS, GAUSS_ORDER = 16, 4  # composite Gauss-Legendre between knots: 1e-9 on spheres
GAUSS = np.polynomial.legendre.leggauss(GAUSS_ORDER)


@lru_cache(maxsize=REMEMBERED)
def size(surface):
    """The largest side of the bounding box of points on the surface."""
    S = evaluate_grid(surface, SIDE_SAMPLES, SIDE_SAMPLES)[0].reshape(-1, 3)
    return float(np.ptp(S, axis=0).max())


@lru_cache(maxsize=REMEMBERED)
def sides(surface):
    """Points along the sides u=0, u=1 (2, k, 3) and v=0, v=1 (2, m, 3), some in every span between knots."""
    ends = np.array([0.0, 1.0])
    along_v = evaluate_grid(surface, ends, _samples(surface.knots_v))[0]
    along_u = evaluate_grid(surface, _samples(surface.knots_u), ends)[0]
    both = np.moveaxis(along_v, 1, 0), along_u
    for points in both:
        points.flags.writeable = False  # they are remembered
    return both


def _samples(knots):
    spans = np.unique(np.clip(knots, 0.0, 1.0))
    return np.union1d(SIDE_SAMPLES, np.concatenate([spans, (spans[:-1] + spans[1:]) / 2]))


def is_closed(surface):
    """(closed in u, closed in v): opposite sides are the same curve, and not one point."""
    same, collapsed = SAME * size(surface), collapsed_sides(surface)
    u, v = (bool(np.abs(first - last).max() <= same) for first, last in sides(surface))
    return u and not collapsed[0], v and not collapsed[2]


def collapsed_sides(surface):
    """(4,) bool: sides u=0, u=1, v=0, v=1 that are one point (poles)."""
    spread = [np.abs(S - S[:, :1]).max(axis=(1, 2)) for S in sides(surface)]
    return np.concatenate(spread) <= SAME * size(surface)


def is_planar(surface):
    """True when every point lies in one plane, to float32 precision.

    The control points tell: they lie in the plane of their surface, and it lies in their hull.
    """
    P = surface.P.reshape(-1, 3)
    centred = P - P.mean(axis=0)
    plane = np.linalg.svd(centred, full_matrices=False)[2][2]
    return bool(np.abs(centred @ plane).max() <= PLANAR * size(surface))


def _gauss(knots):
    """Nodes and weights over [0, 1]: no cell crosses a knot, where derivatives jump."""
    x, weight = GAUSS
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
