"""The part of a NURBS surface over a box of its parameters, exactly; on a closed surface the box may cross the seam.

Source: Piegl, Tiller, The NURBS Book, 5.2 and 5.3 (knot insertion and refinement), by blossoms: the control point j of
a refined knot vector T is the polar form of the polynomial piece around it at T[j+1] .. T[j+p] (Ramshaw 1989).
"""

import numpy as np

from lib.nurbs.surface import NurbsSurface

SAME_WEIGHT = 1e-9  # weights on both sides of a seam may differ by a factor, not by more than this in shape
SAME_KNOT = 1e-12  # of the domain: a knot so near the cut is the cut


def cropped(surface, u0, u1, v0, v1):
    """The surface over [u0, u1] x [v0, v1] as a clamped NurbsSurface over [0, 1] x [0, 1].

    0 <= u0 < u1 <= 1, or u1 up to u0 + 1 where the surface is closed in u; likewise v.

    Raises ValueError if the box runs over a seam whose two sides differ.
    """
    knots_u, Pw = _along(surface.degree_u, surface.knots_u, surface.Pw, u0, u1, "u")
    knots_v, Pw = _along(surface.degree_v, surface.knots_v, Pw.swapaxes(0, 1), v0, v1, "v")
    return NurbsSurface(surface.degree_u, surface.degree_v, knots_u, knots_v, Pw.swapaxes(0, 1))


def _along(degree, knots, Pw, a, b, direction):
    """Knots and control points over [a, b] along the first axis of Pw (n, m, 4), in the input's parameter."""
    if b <= 1.0:
        return _piece(degree, knots, Pw, a, b)
    if a >= 1.0:
        return _along(degree, knots, Pw, a - 1.0, b - 1.0, direction)
    # Put the part behind the seam after the part before it: they meet in a knot of full multiplicity
    knots_a, A = _piece(degree, knots, Pw, a, 1.0)
    knots_b, B = _piece(degree, knots, Pw, 0.0, b - 1.0)
    factor = A[-1, :, 3].sum() / B[0, :, 3].sum()
    gap = np.abs(A[-1] - factor * B[0])
    scale = np.abs(Pw).max(axis=(0, 1))[:3].max()
    if gap[:, 3].max() > SAME_WEIGHT * A[-1, :, 3].max() or gap[:, :3].max() > 1e-6 * scale:
        raise ValueError(f"the surface does not run on over its seam in {direction}")
    return np.concatenate([knots_a[:-1], knots_b[degree + 1 :] + 1.0]), np.concatenate([A, factor * B[1:]])


def _piece(degree, knots, Pw, a, b):
    """Knots and control points of the part [a, b] within the domain [0, 1]."""
    inner = knots[(knots > a + SAME_KNOT) & (knots < b - SAME_KNOT)]
    refined = np.concatenate([np.full(degree + 1, a), inner, np.full(degree + 1, b)])
    return refined, _blossom(degree, knots, Pw, refined)


def _blossom(degree, knots, Pw, refined):
    """Control points of the curve family Pw (n, m, 4) over knots, for the refined knots of a part of the domain."""
    count = refined.size - degree - 1
    j = np.arange(count)
    # Find a span with some length within the support of each new function: its middle lies in one span of the old knots
    filled = np.flatnonzero(np.diff(refined) > 0)
    own = filled[np.searchsorted(filled, np.maximum(j, degree))]
    middle = (refined[own] + refined[own + 1]) / 2
    k = np.searchsorted(knots, middle, side="right") - 1
    # De Boor's triangle with a new argument in every row
    D = Pw[k[:, None] + np.arange(-degree, 1)]
    for r in range(1, degree + 1):
        at = refined[j + r][:, None]
        i = k[:, None] + np.arange(r - degree, 1)
        left, right = knots[i], knots[i + degree + 1 - r]
        s = ((at - left) / (right - left))[:, :, None, None]
        D = (1.0 - s) * D[:, :-1] + s * D[:, 1:]
    return D[:, 0]
