"""Parameters of a face, as its file counts them, to those of the NURBS surface it became.

Arcs become rational quadratics, one from knot to knot, whose parameter is not the angle: with x the angle from the
middle of an arc of half-angle h, and s in [-1, 1] between its knots, tan(x/2) = s tan(h/2), for the weights
1, cos h, 1 (Piegl, Tiller, The NURBS Book, 7.3).  For hyperbolas tanh stands in place of tan.
"""

import numpy as np

from lib.nurbs.evaluate import evaluate, point
from lib.nurbs.shape import size

HOWS = ("linear", "arc", "hyperbola")
MOST_ARC = 6.0  # an arc of nearly a turn has no such form
GRID = (np.arange(5) + 0.5) / 5 + 0.013  # not the middle of a span, where all of them agree
SAME = 1e-9  # of the surface's size
TURN = 1e-9  # of a period: as much as that short of a whole turn is whole
LOOSE = 1e-4  # of the face's size: edges farther from their surface than this are looked for on it again
ON_BORDER = 1e-6  # of the box's sides, and of its area
MOST_STEPS, ENOUGH = 30, 1e-3  # a step that gains less than this share of the distance left is the last


def outline(uses):
    """Corners (k, 2) of a loop of (uv (m, 2) along the edge, runs backward)."""
    return np.concatenate([uv[::-1] if is_backward else uv for uv, is_backward in uses])


def box(outlines, bounds, period):
    """The box of a face's loops, (2, 2) ascending in u and in v, and whether they cut something off it.  Loops that
    go all the way round make it the whole turn of the surface.

    outlines : corners (k, 2) of each loop;  bounds : (2, 2) of the surface;  period : (u, v), each None if not periodic

    >>> square = np.array([[0.0, 0], [2, 0], [2, 1], [0, 1]])
    >>> box([square], np.array([[-9.0, 9], [-9, 9]]), (None, None))[1], box([square[:3]], square, (None, None))[1]
    (False, True)
    """
    if not outlines:
        return np.array(bounds), False
    corners = np.concatenate(outlines)
    found = np.stack([corners.min(axis=0), corners.max(axis=0)], axis=1)
    side = found[:, 1] - found[:, 0]
    if not (side > 0).all():
        raise ValueError("its loops have no area in u, v")
    nearest = np.abs(corners[:, :, None] - found).min(axis=2) / side
    x, y = corners.T
    area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2 / side.prod()
    is_trimmed = len(outlines) > 1 or nearest.min(axis=1).max() > ON_BORDER or abs(area - 1.0) > ON_BORDER
    for k in range(2):
        if period[k] is None:
            found[k] = np.clip(found[k], *bounds[k])
        elif side[k] > period[k] * (1.0 - TURN):
            found[k] = bounds[k]  # its seam, rather than the loops': arcs cut elsewhere run in another way
    return found, bool(is_trimmed)


def to_unit(t, knots, how, period=None):
    """Parameters t (k,) of the file as parameters in [0, 1] between the first and the last of its distinct `knots`.

    period : of the file's parameter where the surface goes all the way round; whole turns become whole numbers

    >>> to_unit(np.pi * np.array([0, 1 / 6, 1 / 4, 1]), np.pi * np.array([0, 1 / 2, 1]), "arc").round(3).tolist()
    [0.0, 0.171, 0.25, 1.0]
    >>> thirds = np.linspace(0.0, 2 * np.pi, 4)
    >>> to_unit(thirds - np.pi, thirds, "arc", 2 * np.pi).round(3).tolist()
    [-0.5, -0.167, 0.167, 0.5]
    """
    t, turns = np.asarray(t, dtype=np.float64), 0.0
    if period is not None:
        over, under = (t - knots[-1]) / period - TURN, (t - knots[0]) / period + TURN
        turns = np.where(over > 0, np.ceil(over), np.where(under < 0, np.floor(under), 0.0))
        t = t - turns * period
    span = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 2)
    middle, half = (knots[span] + knots[span + 1]) / 2, (knots[span + 1] - knots[span]) / 2
    x = t - middle
    if how == "arc":
        x = half * np.tan(x / 2) / np.tan(half / 2)
    elif how == "hyperbola":
        x = half * np.tanh(x / 2) / np.tanh(half / 2)
    return (middle + x - knots[0]) / (knots[-1] - knots[0]) + turns


class Map:
    """From a face's own parameters to [0, 1] x [0, 1] of the NURBS surface of its box.

    surface : NurbsSurface;  knots : its distinct knots as the file counts, in u and in v;  box, period : see `box`
    own : function of u (k,), v (k,) of the file, gives the points (k, 3) there
    off : how far the two surfaces lie apart at most, on a grid [size of the surface]
    """

    def __init__(self, surface, knots, box, period, own):
        self.surface, self.knots = surface, knots
        self.start, self.period = [], []
        for k, p, side in zip(knots, period, box, strict=True):
            self.start.append(p * np.round((side[0] - k[0]) / p) if p else 0.0)  # the part may begin turns away
            self.period.append(p if p and k[-1] - k[0] > p * (1.0 - TURN) else None)
        self.how, self.off = self._measured(own)

    def _measured(self, own):
        """How each parameter runs, and the distance that is left."""
        u, v = (k[0] + GRID * 0.98 * (k[-1] - k[0]) for k in self.knots)
        u, v = (a.ravel() for a in np.meshgrid(u, v))
        expected, extent, best = own(u + self.start[0], v + self.start[1]), size(self.surface), None
        hows = [HOWS if np.diff(k).max() < MOST_ARC else HOWS[:1] for k in self.knots]
        for how in ((a, b) for a in hows[0] for b in hows[1]):
            S = point(self.surface, *(to_unit(t, k, h) for t, k, h in zip((u, v), self.knots, how, strict=True)))
            off = float(np.abs(S - expected).max() / extent)
            if best is None or off < best[1]:
                best = how, off
            if off <= SAME:
                break
        return best

    def __call__(self, uv, S, extent):
        """uv (k, 2) of the file, where the surface should pass S (k, 3): uv of the NURBS surface, and the largest
        distance left [extent].  Where that is large the uv are moved to the nearest points."""
        columns = zip(uv.T, self.start, self.knots, self.how, self.period, strict=True)
        uv = np.stack([to_unit(t - start, k, how, p) for t, start, k, how, p in columns], axis=1)
        turns = np.where([p is not None for p in self.period], np.floor(np.clip(uv, 1e-12, None) - 1e-12), 0.0)
        uv = uv - turns
        gap = self._gap(uv, S) / extent
        if gap > LOOSE:
            uv = nearer(self.surface, uv, S)
            gap = self._gap(uv, S) / extent
        return uv + turns, gap

    def _gap(self, uv, S):
        return float(np.linalg.norm(point(self.surface, *np.clip(uv, 0.0, 1.0).T) - S, axis=1).max())


def nearer(surface, uv, S):
    """uv (k, 2) moved so that the surface passes S (k, 3) there as nearly as it does near by: damped Gauss-Newton
    (Marquardt 1963).  Points that do not get nearer stay."""
    uv = np.clip(uv, 0.0, 1.0)
    damping = np.full(len(uv), 1e-6)
    P, S_u, S_v = evaluate(surface, *uv.T)
    off = np.linalg.norm(S - P, axis=1)
    for _ in range(MOST_STEPS):
        a, b, c = (np.einsum("kc,kc->k", x, y) for x, y in ((S_u, S_u), (S_u, S_v), (S_v, S_v)))
        g, h = np.einsum("kc,kc->k", S_u, S - P), np.einsum("kc,kc->k", S_v, S - P)
        a, c = a * (1 + damping) + 1e-300, c * (1 + damping) + 1e-300
        det = np.maximum(a * c - b * b, 1e-14 * a * c)
        trial = np.clip(uv + np.stack([c * g - b * h, a * h - b * g], axis=1) / det[:, None], 0.0, 1.0)
        new = evaluate(surface, *trial.T)
        far = np.linalg.norm(S - new[0], axis=1)
        better, gain = far < off, off - far
        uv[better], off[better] = trial[better], far[better]
        P, S_u, S_v = (np.where(better[:, None], x, y) for x, y in zip(new, (P, S_u, S_v), strict=True))
        damping = np.where(better, damping / 10, damping * 10)
        if better.any() and gain.max() < ENOUGH * off.max() or damping.min() > 1e6:
            break
    return uv
