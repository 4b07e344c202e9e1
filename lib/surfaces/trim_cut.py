"""Trimmed surfaces cut into triangles together, so that all faces along an edge keep the same points of it."""

from copy import copy

import numpy as np

from lib import forks
from lib.nurbs import lines as find_lines
from lib.nurbs.cut import amended
from lib.nurbs.evaluate import normal
from lib.surfaces.loops import signed_area
from lib.surfaces.trim_border import borders
from lib.surfaces.trim_mesh import ROUNDS, Lines, Unfit, triangulate

LESSONS = 3  # times lines are placed anew where they miss the tolerance by far
PATIENCE = 12  # times an edge's tolerance is lowered: to 2e-4 of the first or less
ROUGH_ROUNDS, FAR_OFF = 1, 1.3  # of putting points inside, where a count is asked for; where the distance is so large


class TrimmedPieces:
    """n TrimmedSurfaces, with what lib.surfaces.tessellate.Shapes knows of them.

    lattice : {surface: (u, v)} interior parameters that must have a line whatever the shape
    """

    def __init__(self, surfaces, known, lattice=None):
        self.surfaces, self.known = surfaces, known
        each = zip(surfaces, known.is_closed, known.is_collapsed, strict=True)
        demands = forks.mapped(lambda one: find_lines.demand(one[0].base, *one[1:]), each)
        for s, along in (lattice or {}).items():
            for d in (0, 1):
                demands[s] = find_lines.with_lines(demands[s], d, along[d])
        self.plan = find_lines.plan(demands, find_lines.links(len(surfaces), np.empty((0, 5), dtype=int)))
        self.borders = borders(surfaces)
        loops = [np.split(s.uv, s.loop_start[1:-1]) for s in surfaces]
        self.share = np.clip([sum(map(signed_area, own)) for own in loops], 0.0, 1.0)
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

    def lines(self, tolerance, slide):
        """The Lines of each surface for tolerance (n,) and slide (n,)."""
        both, count = self._steps(tolerance, slide)
        placed = find_lines.place(self.plan, both, count)
        out = []
        for s, (u, v) in enumerate(placed):
            d = self.plan.demands[s]
            kinks = tuple(np.union1d(k, f) if f.size else k for k, f in zip(d.kinks, d.forced, strict=True))
            out.append(Lines(u, v, kinks, self.known.extent[s]))
        return out

    def cut(self, tolerance, slide):
        """A list of Patch for tolerance (n,) and slide (n,), cut once, with a correction where that is far off."""
        job = _Job(self, FAR_OFF * tolerance)
        return job.cut(self.lines(tolerance, slide), ROUGH_ROUNDS)

    def cut_within(self, tolerance, slide):
        """A list of Patch within tolerance (n,); what is reached is in the patches.

        First border points and lines that do are found, by triangles between them alone; then points are put inside
        where that is not enough.
        """
        pieces, job = self, _Job(self, tolerance)
        for _ in range(LESSONS):
            patches = job.cut(pieces.lines(tolerance, slide), 0)
            better = pieces.learned(patches, tolerance, slide)
            if better is None:
                break
            job.forget([p.distance > FAR_OFF * t for p, t in zip(patches, tolerance, strict=True)])
            pieces = better
        job.forget([p is None or p.distance > t for p, t in zip(job.patches, tolerance, strict=True)])
        return job.cut(pieces.lines(tolerance, slide), ROUNDS)

    def learned(self, patches, tolerance, slide):
        """The pieces measured finer where `patches` miss tolerance (n,) by far; None if nowhere."""
        over = np.flatnonzero([q.distance > FAR_OFF * t for q, t in zip(patches, tolerance, strict=True)])
        demands, lines = list(self.plan.demands), self.lines(tolerance, slide)
        for s in over:
            own = (self.surfaces[s].base, self.known.is_closed[s], self.known.is_collapsed[s])
            placed = (lines[s].u, lines[s].v)
            demands[s], _ = amended(demands[s], *own, placed, patches[s].distance, tolerance[s], 0)
        if all(new is old for new, old in zip(demands, self.plan.demands, strict=True)):
            return None
        out = copy(self)
        out.plan = find_lines.plan(demands, self.plan.links)
        return out

    def normals(self, s, patch):
        """Unit normals (k, 3) of the exact surface s at a patch's vertices."""
        return normal(self.surfaces[s].base, patch.UV[:, 0], patch.UV[:, 1])


class _Job:
    """Patches of all surfaces of some TrimmedPieces for tolerance (n,), their border points agreed on."""

    def __init__(self, pieces, tolerance):
        self.pieces, self.tolerance = pieces, tolerance
        self.at_place = pieces.borders.tolerances(tolerance)
        self.patches, self._kept = [None] * len(tolerance), [None] * len(tolerance)

    def forget(self, which):
        """Surfaces `which` (n,) bool are to be cut again."""
        self._kept = [None if again else kept for again, kept in zip(which, self._kept, strict=True)]

    def cut(self, lines, rounds):
        """The patches along `lines`, points put inside so many rounds; edges that do not do get more points."""
        borders = self.pieces.borders
        for attempt in range(PATIENCE + 1):
            keep, unfit = borders.kept(self.at_place), []
            owns = np.split(keep, borders.start[1:-1])
            again = [s for s, own in enumerate(owns) if self._kept[s] is None or not np.array_equal(own, self._kept[s])]
            for s, made in zip(again, self._made(again, owns, lines, rounds, attempt == PATIENCE), strict=True):
                if isinstance(made, Unfit):
                    unfit.append((borders.edge[borders.start[s] + made.points], made.share))
                else:
                    self.patches[s], self._kept[s] = made, owns[s]
            if not unfit:
                break
            self.at_place = borders.lowered(self.at_place, unfit)
        return list(self.patches)

    def _made(self, numbers, owns, lines, rounds, is_last):
        """Patches of these surfaces, or the Unfit that says which border points one wants."""

        def made(s):
            own = owns[s]
            try:
                surface = self.pieces.surfaces[s]
                return triangulate(surface, own, lines[s], self.tolerance[s], rounds, is_last or own.all())
            except Unfit as error:
                return error

        return forks.mapped(made, numbers)
