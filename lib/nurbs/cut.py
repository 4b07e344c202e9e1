"""Whole NURBS surfaces cut along their lines, neighbours along a border at the same parameters of it.

`WholePieces` holds where lines may go, whatever the tolerance, and cuts for given tolerances.
"""

import numpy as np

from lib.nurbs import lines as find_lines
from lib.nurbs.evaluate import normal
from lib.nurbs.facets import chord_errors, triangulate

ROUNDS = 16  # of measuring and cutting finer
PATIENCE = 2  # of these before single chords are halved
FEW = 4  # single: one chord in so many, or two
MORE = 1.03  # asked for, so that the next attempt does not fail by a hair
FAR_OFF = 1.3  # times the tolerance: worth measuring finer where a count is asked for and no distance
FLAT = 1e-7  # a planar surface so near its triangles needs no finer ones


class WholePieces:
    """n NurbsSurfaces, with what lib.surfaces.tessellate.Shapes knows of them.

    lattice : {surface: (u, v)} interior parameters that must have a line whatever the shape
    """

    def __init__(self, surfaces, known, lattice=None, plan=None):
        self.surfaces, self.known = surfaces, known
        self.plan = plan or _plan(surfaces, known, lattice or {})

    def n_triangles(self, tolerance, slide):
        """Triangles (n,) for tolerance (n,) and slide (n,)."""
        count = find_lines.steps(self.plan, np.stack([tolerance, slide], axis=1))
        n_u, n_v = find_lines.per_surface(self.plan, count).T
        poles = self.known.is_collapsed.astype(np.int64)
        return 2 * n_u * n_v - (poles[:, 0] + poles[:, 1]) * n_v - (poles[:, 2] + poles[:, 3]) * n_u

    def lines(self, tolerance, slide):
        """The lines (u, v) of each surface for tolerance (n,) and slide (n,)."""
        both = np.stack([tolerance, slide], axis=1)
        return find_lines.place(self.plan, both, find_lines.steps(self.plan, both))

    def cut(self, tolerance, slide):
        """A list of Patch for tolerance (n,) and slide (n,), cut as planned."""
        each = zip(self.lines(tolerance, slide), range(len(self.surfaces)), strict=True)
        return [self._patch(s, u, v) for (u, v), s in each]

    def _patch(self, s, u, v):
        return triangulate(self.surfaces[s], u, v, self.known.is_closed[s], self.known.is_collapsed[s])

    def learned(self, patches, tolerance, slide):
        """The pieces measured finer where `patches`, cut for these, miss tolerance (n,) by far; None if nowhere."""
        demands, placed = list(self.plan.demands), self.lines(tolerance, slide)
        over = np.flatnonzero([q.distance for q in patches] > FAR_OFF * tolerance)
        for s in over:
            own = (self.surfaces[s], self.known.is_closed[s], self.known.is_collapsed[s])
            demands[s], _ = amended(demands[s], *own, placed[s], patches[s].distance, tolerance[s], 0)
        return self._with(demands) if over.size else None

    def _with(self, demands):
        return WholePieces(self.surfaces, self.known, plan=find_lines.plan(demands, self.plan.links))

    def cut_within(self, tolerance, slide):
        """A list of Patch: cut until the measured distance stays within tolerance (n,).

        Where it does not, a little more is asked for and the plan is amended (`amended`).  Gives up after ROUNDS;
        the patches say what was reached.
        """
        pieces, ask, patches, before = self, tolerance.copy(), [None] * len(self.surfaces), None
        for attempt in range(ROUNDS):
            placed = pieces.lines(ask, slide)
            for s, (u, v) in enumerate(placed):
                if before is None or not (np.array_equal(u, before[s][0]) and np.array_equal(v, before[s][1])):
                    patches[s] = self._patch(s, u, v)
            before = placed
            distance = np.array([p.distance for p in patches])
            over = np.flatnonzero((distance > tolerance) & ~(self.known.is_planar & (distance <= FLAT)))
            if not over.size:
                break
            demands = list(pieces.plan.demands)
            for s in over:
                own = (self.surfaces[s], self.known.is_closed[s], self.known.is_collapsed[s])
                demands[s], share = amended(demands[s], *own, placed[s], distance[s], tolerance[s], attempt)
                ask[s] *= share
            pieces = self._with(demands)
        return patches

    def normals(self, s, patch):
        """Unit normals (k, 3) of surface s at a patch's vertices; ValueError where it has none."""
        return normal(self.surfaces[s], patch.UV[:, 0], patch.UV[:, 1])


def _plan(surfaces, known, lattice):
    demands = [
        find_lines.demand(s, c, p) for s, c, p in zip(surfaces, known.is_closed, known.is_collapsed, strict=True)
    ]
    for s, along in lattice.items():
        for d in (0, 1):
            demands[s] = find_lines.with_lines(demands[s], d, along[d])
    return find_lines.plan(demands, find_lines.links(len(surfaces), known.borders))


def amended(demand, surface, is_closed, is_collapsed, placed, distance, tolerance, attempt):
    """A Demand that fails with the lines `placed` (u, v), amended, and the share of the tolerance to ask for next.

    Chords that fail show where: there the surface is measured finer.  If that did not help, few failing ones are
    halved, for a bend much shorter than the chord; if many fail, or none explains the distance (then it is the twist),
    a smaller tolerance is asked for.
    """
    errors = chord_errors(surface, *placed, is_closed, is_collapsed)
    is_everywhere = errors[0].max() + errors[1].max() < distance / 2
    for d in (0, 1):
        failing = errors[d] > tolerance / 2
        if failing.any():
            demand = find_lines.refined(surface, demand, d, placed[d], failing, is_closed, is_collapsed)
        if attempt >= PATIENCE and failing.any():
            if failing.sum() <= max(2, failing.size // FEW):
                demand = find_lines.with_lines(demand, d, ((placed[d][1:] + placed[d][:-1]) / 2)[failing])
            else:
                is_everywhere = True
    return demand, (tolerance / distance if is_everywhere else 1.0) / MORE
