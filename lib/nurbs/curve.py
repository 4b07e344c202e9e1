"""NURBS curves in space: points, and polylines that stay within a chord tolerance.

Source: Piegl, Tiller, The NURBS Book, eq. 4.1 (rational curve).
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs.evaluate import basis

MOST_SPLITS = 12  # halvings of a span: 1 / 4096 of it is finer than any tolerance asks for


@dataclass(frozen=True, eq=False)
class NurbsCurve:
    """degree >= 1, knots (n + degree + 1,) non-decreasing, Pw (n, 4) homogeneous points; any domain."""

    degree: int
    knots: np.ndarray
    Pw: np.ndarray


def curve_points(curve, t):
    """Points (m, 3) at parameters t (m,) of the curve's own domain."""
    k, N, _ = basis(curve.knots, curve.degree, len(curve.Pw), t)
    A = np.einsum("ka,kac->kc", N, curve.Pw[k[:, None] + np.arange(-curve.degree, 1)])
    return A[:, :3] / A[:, 3:]


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
    # Halve every piece whose middle is off its chord; a parabola's is off by a quarter after each halving
    for _ in range(MOST_SPLITS if curve.degree > 1 else 0):
        middle = (t[:-1] + t[1:]) / 2
        M = curve_points(curve, middle)
        far = off_chord(M, S[:-1], S[1:]) > within
        room = most - t.size
        if not far.any() or room <= 0:
            break
        t = np.sort(np.concatenate([t, middle[far][:room]]))
        S = curve_points(curve, t)
    return curve_points(curve, _split(t, -(-(least - 1) // (t.size - 1)))) if t.size < least else S


def _split(t, parts):
    """Each interval of t cut into `parts` equal ones."""
    steps = np.arange(parts) / parts
    return np.append((t[:-1, None] + np.diff(t)[:, None] * steps).ravel(), t[-1])


def off_chord(points, start, end):
    """Distances (m,) of points (m, 3) from the segments start..end, each (m, 3)."""
    along = end - start
    square = np.einsum("kc,kc->k", along, along)
    s = np.einsum("kc,kc->k", points - start, along) / np.where(square > 0, square, 1.0)
    return np.linalg.norm(points - start - np.clip(s, 0.0, 1.0)[:, None] * along, axis=1)
