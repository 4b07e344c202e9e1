"""Parameters of points that lie on or near a surface, point after point along polylines.

Start at the nearest point of a grid, then descend with damped Gauss-Newton steps (Marquardt 1963), kept inside the
domain or wrapped around a closed one.  What a single point can not tell is taken from its neighbours on the polyline:
on which side of a seam it lies, and the free parameter at a pole.
"""

import numpy as np

from lib.nurbs.evaluate import evaluate, evaluate_grid
from lib.nurbs.invert_kernels import descend, nearest_of_grid, stray
from lib.nurbs.shape import collapsed_sides, sides, size

MOST_LINES = 400  # grid lines in a direction
NEAR = 1e-4  # of the size: a point nearer to the surface than this needs no other start
POLE = 1e-5  # of the size: nearer to a pole the free parameter means nothing
JUMP = 1e-3  # of the size: a step whose image in the surface leaves it by more is looked at again
SACRIFICE = 2e-3  # of the size: so much distance may be lost to keep a polyline together
MOST_ROUNDS = 20
STARTS = 8  # grid points tried for a point that is not on the surface at first
CLOSED = 1e-5  # of the size: sides that differ by less are a seam here, where files are not exact


def invert(surface, points):
    """Parameters uv (k, 2) of the points (k, 3) of one polyline, and their distances (k,) from the surface.

    Parameters of a closed direction go on over the seam (they may leave [0, 1]); others stay in [0, 1].
    """
    return Inverter(surface).polylines([points])[0]


class Inverter:
    """What inverting needs to know about a surface, made once.

    surface, size : the surface and its largest side;  collapsed : (4,) bool, sides as in shape
    gap : (2,) the largest distance of opposite sides at equal parameters;  closed : (2,) bool, as good as none
    """

    def __init__(self, surface):
        self.surface, self.size = surface, size(surface)
        self.collapsed = collapsed_sides(surface)
        self.gap = np.array([np.abs(first - last).max() for first, last in sides(surface)])
        self.closed = (self.gap <= CLOSED * self.size) & ~self.collapsed[[0, 2]]
        u, v = _lines(surface.knots_u, surface.degree_u), _lines(surface.knots_v, surface.degree_v)
        for lines, ends in ((u, self.collapsed[:2]), (v, self.collapsed[2:])):
            for end in np.flatnonzero(ends):  # no step leads out of a pole
                lines[-end] = (lines[-end] + lines[1 - 3 * end]) / 2
        S = np.ascontiguousarray(evaluate_grid(surface, u, v)[0])
        self._grid, self._u, self._v = S, u, v
        self._boxes = np.stack([S.min(axis=1), S.max(axis=1)], axis=1)
        p, q = surface.degree_u, surface.degree_v
        Pw = np.ascontiguousarray(surface.Pw)
        self._kernel = surface.knots_u, surface.knots_v, Pw, p, q, int(self.closed[0]), int(self.closed[1])
        self._scratch = np.empty((4, max(p, q) + 1)), np.empty((2, 3, 1, 3)), np.empty((2, 1))

    def polylines(self, lines):
        """[(uv (k, 2), distance (k,))] of each polyline of points (k, 3), k >= 1."""
        points = np.concatenate(lines)
        uv, distance = self._nearest(points)
        ends = np.cumsum([len(line) for line in lines])[:-1]
        result = []
        for line, place, far in zip(lines, np.split(uv, ends), np.split(distance, ends), strict=True):
            place, far = self._follow(line, place, far)
            result.append((self._unwrapped(self._at_poles(line, place)), far))
        return result

    def _nearest(self, points):
        """The best parameters of each point by itself."""
        uv, distance = self._descend(points, self._starts(points, 1)[:, 0])
        off = np.flatnonzero(distance > NEAR * self.size)
        if off.size:
            starts = self._starts(points[off], min(STARTS, self._u.size * self._v.size))
            count = starts.shape[1]
            others, far = self._descend(np.repeat(points[off], count, axis=0), starts.reshape(-1, 2))
            best = far.reshape(-1, count).argmin(axis=1) + np.arange(off.size) * count
            better = far[best] < distance[off]
            uv[off[better]], distance[off[better]] = others[best[better]], far[best[better]]
        return uv, distance

    def _starts(self, points, count):
        """Parameters (k, count, 2) of the grid points nearest to each of points (k, 3)."""
        found = np.empty((len(points), count), dtype=np.int64)
        nearest_of_grid(self._grid, self._boxes, points, found, np.empty(found.shape))
        row, column = np.divmod(found, self._u.size)
        return np.stack([self._u[column], self._v[row]], axis=2)

    def _descend(self, points, uv):
        """Damped Gauss-Newton from uv (k, 2): new uv, and distances (k,)."""
        uv, distance = uv.copy(), np.empty(len(points))
        descend(*self._kernel, self.size, points, uv, distance, *self._scratch)
        return uv, distance

    def _wrapped(self, uv):
        return np.where(self.closed, uv - np.floor(uv), uv)

    def _follow(self, line, uv, distance):
        """Start again from a neighbour where the image of a step leaves the polyline, until nothing changes."""
        uv, distance = uv.copy(), distance.copy()
        for _ in range(MOST_ROUNDS if len(line) > 1 else 0):
            off = self._stray(line, uv)
            if not off.max() > JUMP * self.size:  # as of most lines
                break
            beside = 4 * np.median(distance)  # an edge that runs beside the surface strays by as much
            bad = np.flatnonzero(off > JUMP * self.size + beside)
            if not bad.size:
                break
            # Either end of a stray step may be the wrong one: move the one that loses less by it
            place, far = self._descend(line[np.append(bad + 1, bad)], uv[np.append(bad, bad + 1)])
            changed = False
            for k, step in enumerate(bad):
                options = [
                    (far[j] - distance[i], i, place[j], far[j]) for j, i in ((k, step + 1), (k + bad.size, step))
                ]
                for loss, i, at, d in sorted(options, key=lambda option: option[:2]):
                    if loss <= SACRIFICE * self.size and self._shortens(line, uv, i, at):
                        uv[i], distance[i], changed = at, d, True
                        break
            if not changed:
                break
        return uv, distance

    def _shortens(self, line, uv, i, at):
        """True if point i strays at most half as much at `at` as it does now."""
        near = slice(max(i - 1, 0), i + 2)
        trial = uv[near].copy()
        trial[i - near.start] = at
        return self._stray(line[near], trial).sum() < 0.5 * self._stray(line[near], uv[near]).sum()

    def _stray(self, line, uv):
        """(k - 1,) how far the middle of each step in u, v lies from the step in space."""
        out = np.empty(len(line) - 1)
        stray(*self._kernel, line, uv, *self._scratch, out)
        return out

    def _at_poles(self, line, uv):
        """Points at a pole: on its side exactly, with the free parameter of the nearest point that has one."""
        uv, free = uv.copy(), np.full(len(line), -1)
        for side in np.flatnonzero(self.collapsed):
            across, end = side // 2, float(side % 2)
            corner = np.full((1, 2), end)
            pole = evaluate(self.surface, corner[:, 0], corner[:, 1])[0]
            here = np.linalg.norm(line - pole, axis=1) <= POLE * self.size
            here &= np.abs(uv[:, across] - end) < 0.5
            uv[here, across], free[here] = end, 1 - across
        known = np.flatnonzero(free < 0)
        if known.size:
            for i in np.flatnonzero(free >= 0):
                uv[i, free[i]] = uv[known[np.argmin(np.abs(known - i))], free[i]]
        return uv

    def _unwrapped(self, uv):
        """Whole periods added so that no step is longer than half of one, from the point farthest from a seam."""
        uv = uv.copy()
        for axis in np.flatnonzero(self.closed):
            x = uv[:, axis]
            start = int(np.argmax(np.minimum(x, 1.0 - x)))
            step = np.round(np.diff(x))
            turns = np.concatenate([[0.0], np.cumsum(step)])
            uv[:, axis] = x - (turns - turns[start])
        return uv


def _lines(knots, degree):
    """Grid lines in a direction: some in every span between knots."""
    spans = np.unique(np.clip(knots, 0.0, 1.0))
    parts = int(np.clip(MOST_LINES // max(spans.size - 1, 1), 1, 2 * degree + 2 if spans.size > 3 else 12))
    steps = np.arange(parts) / parts
    return np.append((spans[:-1, None] + np.diff(spans)[:, None] * steps).ravel(), 1.0)
