"""Trimmed surfaces cut into triangles together, so that all faces along an edge keep the same points of it."""

import numpy as np

from lib.nurbs import lines as find_lines
from lib.nurbs.evaluate import normal
from lib.surfaces.trim_border import borders
from lib.surfaces.trim_mesh import ROUNDS, Lines, Unfit, scales, triangulate

PATIENCE = 12  # times an edge's tolerance is lowered: to 2e-4 of the first or less
ROUGH_ROUNDS, FAR_OFF = 1, 1.3  # of putting points inside, where a count is asked for; where the distance is so large


class TrimmedPieces:
    """n TrimmedSurfaces, with what lib.surfaces.tessellate.Shapes knows of them.

    lattice : {surface: (u, v)} interior parameters that must have a line whatever the shape
    """

    def __init__(self, surfaces, known, lattice=None):
        self.surfaces, self.extent = surfaces, known.extent
        each = zip(surfaces, known.is_closed, known.is_collapsed, strict=True)
        demands = [find_lines.demand(s.base, c, p) for s, c, p in each]
        for s, along in (lattice or {}).items():
            for d in (0, 1):
                demands[s] = find_lines.with_lines(demands[s], d, along[d])
        self.plan = find_lines.plan(demands, find_lines.links(len(surfaces), np.empty((0, 5), dtype=int)))
        self.borders = borders(surfaces)
        whole = [_shoelace(s.uv, s.loop_start) for s in surfaces]
        self.share = np.clip(whole, 0.0, 1.0)
        self.holes = np.array([len(s.loop_start) - 2 for s in surfaces])

    def n_triangles(self, tolerance, slide):
        """Triangles (n,) for tolerance (n,) and slide (n,), about."""
        n_u, n_v = find_lines.per_surface(self.plan, self._steps(tolerance, slide)[1]).T
        kept = self.borders.kept(self.borders.tolerances(tolerance))
        kept = np.add.reduceat(kept, self.borders.start[:-1])
        inside = np.rint(self.share * (n_u - 1) * (n_v - 1)).astype(np.int64)
        return np.maximum(kept + 2 * inside + 2 * self.holes - 2, 1)

    def _steps(self, tolerance, slide):
        both = np.stack([tolerance, slide], axis=1)
        return both, find_lines.steps(self.plan, both)

    def _lines(self, tolerance, slide):
        both, count = self._steps(tolerance, slide)
        placed = find_lines.place(self.plan, both, count)
        out = []
        for s, (u, v) in enumerate(placed):
            d = self.plan.demands[s]
            kinks = tuple(np.union1d(k, f) for k, f in zip(d.kinks, d.forced, strict=True))
            out.append(Lines(u, v, kinks, scales(len(u) - 1, len(v) - 1, self.extent[s])))
        return out

    def cut(self, tolerance, slide):
        """A list of Patch for tolerance (n,) and slide (n,), cut once, with a correction where that is far off."""
        return self._cut(tolerance, slide, FAR_OFF, ROUGH_ROUNDS)

    def cut_within(self, tolerance, slide):
        """A list of Patch within tolerance (n,); what is reached is in the patches."""
        return self._cut(tolerance, slide, 1.0, ROUNDS)

    def _cut(self, tolerance, slide, factor, rounds):
        lines = self._lines(tolerance, slide)
        # Find border points that do, by the first triangles; then put points inside
        at_place, _ = self._attempt(self.borders.tolerances(tolerance), lines, factor * tolerance, 0)
        return self._attempt(at_place, lines, factor * tolerance, rounds)[1]

    def _attempt(self, at_place, lines, tolerance, rounds):
        """Tolerances of positions (places,) at which all surfaces can be cut, and their patches."""
        patches, kept = [None] * len(self.surfaces), [None] * len(self.surfaces)
        for attempt in range(PATIENCE + 1):
            keep, unfit = self.borders.kept(at_place), []
            for s, surface in enumerate(self.surfaces):
                first, end = self.borders.start[s : s + 2]
                own = keep[first:end]
                if kept[s] is not None and np.array_equal(own, kept[s]):
                    continue
                is_last = own.all() or attempt == PATIENCE
                try:
                    patches[s] = triangulate(surface, own, lines[s], tolerance[s], rounds, is_last)
                    kept[s] = own
                except Unfit as error:
                    unfit.append((self.borders.edge[first + error.points], error.share))
            if not unfit:
                break
            at_place = self.borders.lowered(at_place, unfit)
        return at_place, patches

    def learned(self, patches, tolerance, slide):
        """None: cutting already puts right what is far off."""
        return None

    def normals(self, s, patch):
        """Unit normals (k, 3) of the exact surface s at a patch's vertices."""
        return normal(self.surfaces[s].base, patch.UV[:, 0], patch.UV[:, 1])


def _shoelace(uv, loop_start):
    area = 0.0
    for a, b in zip(loop_start[:-1], loop_start[1:], strict=True):
        x, y = uv[a:b].T
        area += (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    return area
