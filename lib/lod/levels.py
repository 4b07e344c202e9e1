"""Levels of detail of a NURBS scene: each is cut anew from the exact surfaces, by chord tolerance or by triangle count.

A level needs one number, the tolerance; how many triangles it will cost is known from the plan (lib.nurbs.lines)
without cutting anything, so a count is met by bisection over the tolerance of all surfaces together: triangles go
where the largest distances are.

Thinning a finer mesh by quadrics instead (fast_simplification, positions only: it gives up the parameters, seams and
borders) was measured on the teapot, a sphere and a head: at 30 % to 1 % of the triangles its largest distance is 1.5 to
5 times that of a level cut here, the root mean square 0.7 to 4.6 times.
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs import borders as find_borders
from lib.nurbs import evaluate, facets, tessellate
from lib.nurbs import lines as find_lines

DEVIATION = 1e-4  # of the frame: the finest level, where none is named
SLIDE = 8  # a texture may slide as many tolerances, or tessellate.SLIDE of the surface's size if that is more
COARSEST, FINEST = 10.0, 1e-9  # tolerances searched, in frames
LESSONS = 1  # times a level by count is cut again after measuring finer what came out far off
MOST = 4_000_000  # triangles of one level


class TooFine(ValueError):
    """The level asked for has more triangles than MOST."""


@dataclass(frozen=True)
class Level:
    """One level in the frame of its surfaces.

    mesh : lib.nurbs.tessellate.Mesh
    N : (n_v, 3) float64 unit normals of the exact surfaces, along S_u x S_v
    tolerance : float    chord tolerance it was cut for
    gap : float          largest distance between two surfaces along a border they share
    asked : int or None  triangles asked for
    is_smallest : bool   the asked count was below what these surfaces need
    """

    mesh: tessellate.Mesh
    N: np.ndarray
    tolerance: float
    gap: float
    asked: int | None
    is_smallest: bool


class Scene:
    """Surfaces (n,) in their frame, with what `tessellate.shapes` knows of them; levels are cut from it.

    lattice : {surface: (u, v)} interior parameters that have a line in every level, for light stored in vertices
    """

    def __init__(self, surfaces, known, lattice=None):
        self.surfaces, self.known = surfaces, known
        self.plan = tessellate.plan(surfaces, known, lattice)
        self.size = known.extent.max(axis=1)

    def slide(self, tolerance):
        """Allowed slide (n,) at a chord tolerance."""
        return np.maximum(SLIDE * tolerance, tessellate.SLIDE * self.size)

    def predicted(self, tolerance, plan=None):
        """Triangles a chord tolerance will cost, before measuring."""
        plan = plan or self.plan
        both = np.stack([np.full(len(self.surfaces), tolerance), self.slide(tolerance)], axis=1)
        return int(tessellate.n_triangles(plan, self.known, find_lines.steps(plan, both)).sum())

    def by_deviation(self, tolerance):
        """The Level whose measured distance is at most `tolerance` (> 0)."""
        self._affordable(self.predicted(tolerance))
        whole = np.full(len(self.surfaces), float(tolerance))
        patches = tessellate.cut_within(self.surfaces, self.known, self.plan, whole, self.slide(tolerance))
        return self._level(patches, tolerance, None, False)

    def by_count(self, asked):
        """The Level of at most `asked` triangles, or the smallest there is."""
        self._affordable(asked)
        plan = self.plan
        for _ in range(1 + LESSONS):
            tolerance = self.tolerance_for(asked, plan)
            whole = np.full(len(self.surfaces), tolerance)
            patches, placed = tessellate.cut(self.surfaces, self.known, plan, whole, self.slide(tolerance))
            better = tessellate.learned(self.surfaces, self.known, plan, patches, placed, whole)
            if better is None:
                break
            plan = better
        return self._level(patches, tolerance, asked, sum(len(p.F) for p in patches) > asked)

    def tolerance_for(self, asked, plan=None):
        """The smallest tolerance found by bisection whose count is at most `asked`; the coarsest if none is."""
        low, high = np.log(FINEST), np.log(COARSEST)
        if self.predicted(COARSEST, plan) > asked:
            return COARSEST
        for _ in range(40):
            middle = (low + high) / 2
            if self.predicted(np.exp(middle), plan) <= asked:
                high = middle
            else:
                low = middle
        return float(np.exp(high))

    def _affordable(self, count):
        if count > MOST:
            raise TooFine(f"needs {count} triangles, at most {MOST} are allowed")

    def _level(self, patches, tolerance, asked, is_smallest):
        mesh = tessellate.assemble(patches, self.known)
        N = np.concatenate([_normals(*each) for each in zip(self.surfaces, patches, strict=True)])
        return Level(mesh, N, float(tolerance), gap(mesh, self.surfaces, self.known), asked, is_smallest)


def _normals(surface, patch):
    """Unit normals (k, 3) of the exact surface at a patch's vertices; of its triangles where the surface has none."""
    try:
        return evaluate.normal(surface, patch.UV[:, 0], patch.UV[:, 1])
    except ValueError:
        N, area = facets.normals(*(patch.S[patch.F[:, k]] for k in range(3)))
        total = np.zeros_like(patch.S)
        for k in range(3):
            np.add.at(total, patch.F[:, k], N * area[:, None])
        length = np.linalg.norm(total, axis=1, keepdims=True)
        return np.where(length > 0, total / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])


def gap(mesh, surfaces, known):
    """Largest distance between neighbours along borders: those of equal speed are welded, the others are measured."""
    largest = 0.0
    for a, side_a, b, side_b, is_reversed in known.borders.tolist():
        first, second = mesh.V[mesh.side[a][side_a]], mesh.V[mesh.side[b][side_b]]
        if len(first) == len(second):
            largest = max(largest, float(np.abs(first - (second[::-1] if is_reversed else second)).max()))
        else:
            largest = max(largest, _between(first, second))
    usable = ~known.is_collapsed.ravel()
    data = find_borders.sides(surfaces)
    for i, j in find_borders.same_curve(data, usable, find_borders.rows_of(known.borders)):
        if not (i // 4 == j // 4 and known.is_closed[i // 4, i % 4 // 2]):
            largest = max(largest, _between(*(mesh.V[mesh.side[k // 4][k % 4]] for k in (i, j))))
    return largest


def _between(a, b):
    return max(find_borders.to_polyline(a, b), find_borders.to_polyline(b, a))
