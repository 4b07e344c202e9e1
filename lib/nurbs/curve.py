"""NURBS curves in space: points, and polylines that stay within a chord tolerance.

Source: Piegl, Tiller, The NURBS Book, eq. 4.1 (rational curve).
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs.curve_kernels import off_chords, points_on_curve

MARGIN = 1.1  # more parts than the middle asks for, so that the next round finds little to mend
ROUNDS = 4  # of cutting: the first counts the parts, the others mend where the curve bends unevenly


@dataclass(frozen=True, eq=False)
class NurbsCurve:
    """degree >= 1, knots (n + degree + 1,) non-decreasing, Pw (n, 4) homogeneous points; any domain."""

    degree: int
    knots: np.ndarray
    Pw: np.ndarray


def curve_points(curve, t):
    """Points (m, 3) at parameters t (m,) of the curve's own domain."""
    knots, Pw, t = (np.ascontiguousarray(x, dtype=np.float64) for x in (curve.knots, curve.Pw, t))
    S = np.empty((t.size, 3))
    points_on_curve(knots, Pw, curve.degree, t, np.empty((2, curve.degree + 1)), S)
    return S


def polyline(curve, share=1e-5, least=2, most=500):
    """Points (k, 3) along the curve, ends included, whose chords lie within share of its bounding box's largest side.

    least : the smallest number of points;  most : about the largest (a curve of degree 1 keeps all its corners)

    >>> line = NurbsCurve(1, np.array([0, 0, 1, 1.0]), np.array([[0, 0, 0, 1], [2, 0, 0, 1.0]]))
    >>> polyline(line).tolist(), len(polyline(line, least=5))
    ([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], 5)
    """
    first, last = curve.knots[curve.degree], curve.knots[len(curve.Pw)]
    t = np.unique(np.clip(curve.knots, first, last))
    if curve.degree > 1:
        if t.size > most // 4:
            t = np.linspace(first, last, most // 4)
        t = _split(t, 3)
    S = curve_points(curve, t)
    within = share * max(float(np.ptp(S, axis=0).max()), 1e-300)
    # Cut every piece whose middle is off its chord: n parts are off by 1 / n^2 of it where the curve is a parabola
    for _ in range(ROUNDS if curve.degree > 1 else 0):
        off = np.empty(t.size - 1)
        off_chords(curve_points(curve, (t[:-1] + t[1:]) / 2), S, off)
        parts = np.sqrt(off / within)
        if not (parts > 1).any():
            break
        parts = MARGIN * parts
        if np.ceil(parts).clip(1).sum() > most - 1:
            t = _split(t, _fitting(parts, most - 1))
            break
        t = _split(t, np.ceil(parts).clip(1).astype(int))
        S = curve_points(curve, t)
    t = _split(t, -(-(least - 1) // (t.size - 1))) if t.size < least else t
    return curve_points(curve, t)


def _fitting(parts, most):
    """Whole parts of the pieces in the ratio of `parts`, as many as `most` allows."""
    low, high = 0.0, 1.0
    for _ in range(30):
        middle = (low + high) / 2
        fits = np.ceil(middle * parts).clip(1).sum() <= most
        low, high = (middle, high) if fits else (low, middle)
    return np.ceil(low * parts).clip(1).astype(int)


def _split(t, parts):
    """Each interval of t cut into `parts` equal ones, a number or (t.size - 1,) of them."""
    parts = np.broadcast_to(parts, t.size - 1)
    piece = np.repeat(np.arange(t.size - 1), parts)
    step = np.arange(piece.size) - (np.cumsum(parts) - parts)[piece]
    return np.append(t[piece] + (t[piece + 1] - t[piece]) * (step / parts[piece]), t[-1])
