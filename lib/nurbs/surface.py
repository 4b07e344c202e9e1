"""A NURBS surface as arrays: degrees, knots, homogeneous control points, over the domain [0, 1] x [0, 1].

Source: Piegl, Tiller, The NURBS Book, chapters 2 and 4.
"""

from dataclasses import dataclass
from numbers import Integral

import numpy as np


@dataclass(frozen=True, eq=False)
class NurbsSurface:
    """Degrees, knots and homogeneous control points.

    degree_u, degree_v : int >= 1
    knots_u : (n_u + degree_u + 1,) float64, non-decreasing; clamped, unclamped or periodic.  On construction they are
        mapped affinely so that the domain [knots[degree], knots[n]] becomes [0, 1].
    knots_v : likewise
    Pw : (n_u, n_v, 4) float64, rows (w x, w y, w z, w), w > 0

    Raises ValueError, naming the field, for anything else.
    """

    degree_u: int
    degree_v: int
    knots_u: np.ndarray
    knots_v: np.ndarray
    Pw: np.ndarray

    def __post_init__(self):
        Pw = np.asarray(self.Pw, dtype=np.float64)
        if Pw.ndim != 3 or Pw.shape[2] != 4 or not Pw.size:
            raise ValueError(f"points: shape {Pw.shape}, expected (n_u, n_v, 4) homogeneous")
        if not np.isfinite(Pw).all() or np.abs(Pw).max(initial=0.0) > 1e100:
            raise ValueError("points: NaN, Inf or a coordinate beyond 1e100")
        if Pw[..., 3].min(initial=np.inf) <= 0:
            raise ValueError("weights: every weight must be > 0")
        Pw = Pw / Pw[..., 3].max()  # a common factor of all weights changes nothing, not even the rounding
        object.__setattr__(self, "Pw", Pw)
        object.__setattr__(self, "knots_u", _unit_domain(self.knots_u, self.degree_u, Pw.shape[0], "u"))
        object.__setattr__(self, "knots_v", _unit_domain(self.knots_v, self.degree_v, Pw.shape[1], "v"))

    @property
    def P(self):
        """Control points, (n_u, n_v, 3)."""
        return self.Pw[..., :3] / self.Pw[..., 3:]

    @property
    def w(self):
        """Weights, (n_u, n_v), the largest is 1."""
        return self.Pw[..., 3]


def _unit_domain(knots, degree, n, direction):
    if isinstance(degree, bool) or not isinstance(degree, Integral) or degree < 1:
        raise ValueError(f"degree_{direction}: {degree!r}, expected an integer >= 1")
    if degree >= n:
        raise ValueError(f"degree_{direction}: {degree} needs at least {degree + 1} control points, found {n}")
    knots = np.asarray(knots, dtype=np.float64)
    name = f"knots_{direction}"
    if knots.shape != (n + degree + 1,):
        raise ValueError(f"{name}: {knots.size} knots, expected {n} + {degree} + 1 = {n + degree + 1}")
    if not np.isfinite(knots).all():
        raise ValueError(f"{name}: NaN or Inf")
    if (np.diff(knots) < 0).any():
        raise ValueError(f"{name}: knot {int(np.argmax(np.diff(knots) < 0)) + 1} goes back; expected non-decreasing")
    first, last = knots[degree], knots[n]
    if not last > first:
        raise ValueError(f"{name}: empty domain [{first:g}, {last:g}]")
    inner = knots[(knots > first) & (knots < last)]
    if inner.size and np.unique(inner, return_counts=True)[1].max() > degree:
        raise ValueError(f"{name}: an interior knot has multiplicity > degree {degree}")
    return (knots - first) / (last - first)


def from_points(degree_u, degree_v, knots_u, knots_v, P, w=None):
    """Make a surface from Euclidean control points P (n_u, n_v, 3) and weights w (n_u, n_v), default 1."""
    P = np.asarray(P, dtype=np.float64)
    if P.ndim != 3 or P.shape[2] != 3:
        raise ValueError(f"points: shape {P.shape}, expected (n_u, n_v, 3)")
    w = np.ones(P.shape[:2]) if w is None else np.asarray(w, dtype=np.float64)
    if w.shape != P.shape[:2]:
        raise ValueError(f"weights: shape {w.shape}, expected {P.shape[:2]}")
    if not np.isfinite(w).all():
        raise ValueError("weights: NaN or Inf")
    return NurbsSurface(degree_u, degree_v, knots_u, knots_v, np.concatenate([P * w[..., None], w[..., None]], axis=2))


def bilinear(S00, S10, S11, S01):
    """The bilinear surface through four corners S(0,0), S(1,0), S(1,1), S(0,1), each (3,)."""
    knots = np.array([0.0, 0.0, 1.0, 1.0])
    return from_points(1, 1, knots, knots, [[S00, S01], [S10, S11]])


def bezier(P, w=None):
    """The Bezier patch with control points P (degree_u + 1, degree_v + 1, 3)."""
    P = np.asarray(P, dtype=np.float64)
    p, q = P.shape[0] - 1, P.shape[1] - 1
    return from_points(p, q, np.repeat([0.0, 1.0], p + 1), np.repeat([0.0, 1.0], q + 1), P, w)
