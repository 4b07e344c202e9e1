"""Parameters of points that lie on or near a surface, point after point along polylines.

Start at the nearest point of a grid, then descend with damped Gauss-Newton steps (Marquardt 1963), kept inside the
domain or wrapped around a closed one.  What a single point can not tell is taken from its neighbours on the polyline:
on which side of a seam it lies, and the free parameter at a pole.
"""

import numpy as np

from lib.nurbs.curve import off_chord
from lib.nurbs.evaluate import evaluate, evaluate_grid
from lib.nurbs.shape import collapsed_sides, sides, size

MOST_LINES = 400  # grid lines in a direction
MOST_STEPS = 60
CONVERGED = 1e-12  # last step in space, of the surface's size
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
        from scipy.spatial import cKDTree  # here: it takes 0.4 s to load, and whole surfaces need none

        S = evaluate_grid(surface, u, v)[0]
        self._grid = np.stack(np.meshgrid(u, v), axis=2).reshape(-1, 2)
        self._tree = cKDTree(S.reshape(-1, 3))

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
        uv, distance = self._descend(points, self._grid[self._tree.query(points)[1]])
        off = np.flatnonzero(distance > NEAR * self.size)
        if off.size:
            nearest = self._tree.query(points[off], min(STARTS, len(self._grid)))[1]
            count = nearest.shape[1]
            others, far = self._descend(np.repeat(points[off], count, axis=0), self._grid[nearest.ravel()])
            best = far.reshape(-1, count).argmin(axis=1) + np.arange(off.size) * count
            better = far[best] < distance[off]
            uv[off[better]], distance[off[better]] = others[best[better]], far[best[better]]
        return uv, distance

    def _descend(self, points, uv):
        """Damped Gauss-Newton from uv (k, 2): new uv, and distances (k,)."""
        uv = uv.copy()
        S, S_u, S_v = evaluate(self.surface, uv[:, 0], uv[:, 1])
        distance = np.linalg.norm(points - S, axis=1)
        damping, left = np.full(len(points), 1e-6), np.arange(len(points))
        for _ in range(MOST_STEPS):
            if not left.size:
                break
            trial = self._step(points[left] - S[left], S_u[left], S_v[left], uv[left], damping[left])
            new = evaluate(self.surface, *self._wrapped(trial).T)
            far = np.linalg.norm(points[left] - new[0], axis=1)
            moved = np.linalg.norm(new[0] - S[left], axis=1)
            better = far < distance[left]
            took = left[better]
            uv[took], distance[took] = trial[better], far[better]
            S[took], S_u[took], S_v[took] = (a[better] for a in new)
            damping[left] = np.where(better, damping[left] / 10, damping[left] * 100)
            done = (moved <= CONVERGED * self.size) | (damping[left] > 1e4)
            left = left[~done]
        return self._wrapped(uv), distance

    def _step(self, r, S_u, S_v, uv, damping):
        """Parameters after one damped step towards the points, inside the domain."""
        a, b, c = (np.einsum("kc,kc->k", x, y) for x, y in ((S_u, S_u), (S_u, S_v), (S_v, S_v)))
        g, h = np.einsum("kc,kc->k", S_u, r), np.einsum("kc,kc->k", S_v, r)
        floor = 1e-30 * self.size**2
        a, c = a * (1 + damping) + floor, c * (1 + damping) + floor
        det = np.maximum(a * c - b * b, 1e-14 * a * c)
        u, v = uv[:, 0] + (c * g - b * h) / det, uv[:, 1] + (a * h - b * g) / det
        # Where one parameter is held at its end, the other is solved for alone
        if not self.closed[0]:
            held = np.clip(u, 0.0, 1.0)
            v = np.where(held != u, uv[:, 1] + (h - b * (held - uv[:, 0])) / c, v)
            u = held
        if not self.closed[1]:
            held = np.clip(v, 0.0, 1.0)
            again = uv[:, 0] + (g - b * (held - uv[:, 1])) / a
            u = np.where(held != v, again if self.closed[0] else np.clip(again, 0.0, 1.0), u)
            v = held
        limit = np.where(self.closed, 0.25, 1.0)
        return uv + np.clip(np.stack([u, v], axis=1) - uv, -limit, limit)

    def _wrapped(self, uv):
        return np.where(self.closed, uv - np.floor(uv), uv)

    def _follow(self, line, uv, distance):
        """Start again from a neighbour where the image of a step leaves the polyline, until nothing changes."""
        uv, distance = uv.copy(), distance.copy()
        for _ in range(MOST_ROUNDS if len(line) > 1 else 0):
            off = self._stray(line, uv)
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
        step = np.diff(uv, axis=0)
        step -= np.where(self.closed, np.round(step), 0.0)
        middle = evaluate(self.surface, *self._wrapped(uv[:-1] + step / 2).T)[0]
        return off_chord(middle, line[:-1], line[1:])

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
