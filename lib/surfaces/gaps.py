"""How far neighbours are from each other along the curves they have in common."""

import numpy as np

from lib.nurbs import borders as find_borders
from lib.nurbs.surface import NurbsSurface
from lib.surfaces.loops import corner_runs
from lib.surfaces.trimmed import TrimmedSurface


def gap(mesh, surfaces, known):
    """Largest distance between neighbours of a SceneMesh along their borders, both ways between the polylines.

    Borders of equal speed are welded, and edges of trimmed surfaces hold the same points: these are found by what they
    are and measured all the same.  Other borders that are the same curve are found by their points.
    """
    largest = 0.0
    for a, side_a, b, side_b, is_reversed in known.borders.tolist():
        first, second = mesh.V[mesh.side[a][side_a]], mesh.V[mesh.side[b][side_b]]
        largest = max(largest, _between(first, second[::-1] if is_reversed else second))
    if not any(isinstance(s, NurbsSurface | TrimmedSurface) for s in surfaces):
        return largest  # meshes alone: their borders are where their files put them
    rows = _Rows(mesh, surfaces, known)
    for i, j in rows.pairs(known.borders):
        largest = max(largest, _between(rows.line(i), rows.line(j)))
    return largest


def _between(a, b):
    if len(a) == len(b):
        return float(min(np.abs(a - b).max(initial=0.0), np.abs(a - b[::-1]).max(initial=0.0)))
    return float(max(find_borders.to_polyline(a, b), find_borders.to_polyline(b, a)))


class _Rows:
    """Sides of whole surfaces and edges of trimmed ones as rows of one lib.nurbs.borders.Sides."""

    def __init__(self, mesh, surfaces, known):
        self.mesh = mesh
        whole = [s for s, surface in enumerate(surfaces) if isinstance(surface, NurbsSurface)]
        trimmed = [s for s, surface in enumerate(surfaces) if isinstance(surface, TrimmedSurface)]
        self.owner = [(s, k) for s in whole for k in range(4)]
        usable = ~known.is_collapsed[whole].ravel()
        sides = [find_borders.sides([surfaces[s] for s in whole])] if whole else []
        self.first = {s: 4 * n for n, s in enumerate(whole)}
        self.is_closed = known.is_closed
        edges = [(s, k, run) for s in trimmed for k, run in enumerate(runs(surfaces[s]))]
        if edges:
            self.owner += [(s, k) for s, k, _ in edges]
            usable = np.concatenate([usable, [_length(run) > 0 for _, _, run in edges]])
            sides.append(_edge_sides([run for _, _, run in edges]))
        self.usable = usable.astype(bool)
        each = [np.concatenate([getattr(x, name) for x in sides]) for name in ("points", "length", "within")]
        self.data = find_borders.Sides(*each)

    def line(self, row):
        s, k = self.owner[row]
        return self.mesh.V[self.mesh.side[s][k]]

    def pairs(self, borders):
        """Pairs of rows that are the same curve, the `borders` (m, 5) of whole surfaces and seams left out."""
        known = [(self.first[a] + i, self.first[b] + j) for a, i, b, j, _ in borders.tolist()]
        known = np.array(known, dtype=np.int64).reshape(-1, 2)
        for i, j in find_borders.same_curve(self.data, self.usable, known):
            (s, k), (t, m) = self.owner[i], self.owner[j]
            is_seam = s == t and s in self.first and k // 2 == m // 2 and self.is_closed[s, k // 2]
            if not is_seam and self._are_one(self.data.points[i], self.data.points[j], self.data.length[i]):
                yield i, j

    def _are_one(self, a, b, length):
        """Also between the places where curves are compared first."""
        far = max(find_borders.to_polyline(a, b), find_borders.to_polyline(b, a))
        return far <= find_borders.SAME_CURVE * length


def runs(trim):
    """Positions of the border from corner to corner, the runs that `side` of a trimmed surface's Patch goes along."""
    return [trim.S[run] for run in corner_runs(trim)]


def _length(run):
    return float(np.linalg.norm(np.diff(run, axis=0), axis=1).sum())


def _edge_sides(edges):
    """The Sides of edges (k, 3): points at equal steps of their length."""
    t = np.linspace(0.0, 1.0, (find_borders.SAMPLES.size - 1) * find_borders.FINE + 1)
    points, length = [], []
    for run in edges:
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(run, axis=0), axis=1))])
        length.append(along[-1])
        points.append(np.stack([np.interp(t * along[-1], along, x) for x in run.T], axis=1))
    length = np.array(length)
    return find_borders.Sides(np.array(points), length, find_borders.SAME * length)
