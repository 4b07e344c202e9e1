"""Levels of detail of a scene: each is cut anew from the exact surfaces, by chord tolerance or by triangle count.

A level needs one number, the tolerance; how many triangles it will cost is known (of trimmed surfaces about) from the
plan (lib.nurbs.lines) and the border points without cutting anything, so a count is met by bisection over the tolerance
of all surfaces together: triangles go where the largest distances are.  Meshes have nothing exact but their triangles:
they are thinned by quadrics, to the same tolerance (lib.lod.mesh_levels).

For other surfaces that was measured too, on the teapot, a sphere and a head thinned without regard to seams: at 30 %
to 1 % of the triangles its largest distance is 1.5 to 5 times that of a level cut here, the root mean square 0.7 to 4.6
times.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from lib.nurbs import facets
from lib.surfaces import tessellate
from lib.surfaces.gaps import gap
from lib.surfaces.mesh import Mesh

DEVIATION = 1e-4  # of the frame: the finest level, where none is named
SLIDE = 8  # a texture may slide as many tolerances, or tessellate.SLIDE of the surface's size if that is more
COARSEST, FINEST = 10.0, 1e-9  # tolerances searched, in frames
MESH_SHARE = 0.03  # of the side of a square of a mesh's area: thinned farther, boxes lose corners and parts vanish
LEAST_COUNT = 1.02  # times the least count there is, which is as good as that
ATTEMPTS = 8  # of asking for fewer triangles where more came out than were predicted
LESSONS = 1  # times a level by count is cut again after measuring finer what came out far off
MOST = 4_000_000  # triangles of one level


class TooFine(ValueError):
    """The level asked for has more triangles than MOST."""


@dataclass(frozen=True)
class Level:
    """One level in the frame of its surfaces.

    mesh : lib.surfaces.tessellate.SceneMesh
    N : (n_v, 3) float64 unit normals of the exact surfaces, along S_u x S_v
    tolerance : float    chord tolerance it was cut for
    gap : float          largest distance between two surfaces along a border they share
    asked : int or None  triangles asked for
    is_smallest : bool   the asked count was below what these surfaces need
    """

    mesh: tessellate.SceneMesh
    N: np.ndarray
    tolerance: float
    gap: float
    asked: int | None
    is_smallest: bool


class Scene:
    """Surfaces (n,) in their frame, with what `tessellate.shapes` knows of them; levels are cut from it.

    lattice : {surface: (u, v)} interior parameters that have a line in every level, for light stored in vertices
    copies : (n,) int, times each surface's triangles count (2 where both its sides are seen)
    found : what was found out about the meshes before (lib.lod.mesh_levels.MeshLevels); ValueError if about others
    """

    def __init__(self, surfaces, known, lattice=None, copies=None, found=None):
        self.surfaces, self.known = surfaces, known
        self.copies = np.ones(len(surfaces), dtype=np.int64) if copies is None else np.asarray(copies)
        kinds = dict(tessellate.KINDS)
        if any(isinstance(s, Mesh) for s in surfaces):
            from lib.lod.mesh_levels import MeshLevels  # here: it takes longer to load than most scenes to cut

            kinds[Mesh] = partial(MeshLevels, found=found)
        self.pieces = tessellate.Pieces(surfaces, known, lattice, kinds)
        self.size = known.extent.max(axis=1)
        is_mesh = np.array([isinstance(s, Mesh) for s in surfaces], dtype=bool)
        self.most = np.where(is_mesh, MESH_SHARE * np.sqrt(known.area), np.inf)

    def asked_of(self, tolerance):
        """(tolerance (n,), allowed slide (n,)) of the surfaces at a chord tolerance; a mesh keeps its shape even where
        nobody asks for it.
        """
        whole = np.minimum(float(tolerance), self.most)
        return whole, np.maximum(SLIDE * tolerance, tessellate.SLIDE * self.size)

    def predicted(self, tolerance, pieces=None):
        """Triangles a chord tolerance will cost, before measuring."""
        return int((pieces or self.pieces).n_triangles(*self.asked_of(tolerance)) @ self.copies)

    def by_deviation(self, tolerance):
        """The Level whose measured distance is at most `tolerance` (> 0)."""
        self._affordable(self.predicted(tolerance))
        return self._level(self.pieces.cut_within(*self.asked_of(tolerance)), tolerance, None, False)

    def n_within(self, tolerance):
        """Triangles of `by_deviation`; meshes are counted without being made."""
        self._affordable(self.predicted(tolerance))
        tolerance, slide = self.asked_of(tolerance)
        count = np.zeros(len(self.surfaces), dtype=np.int64)
        for index, part in self.pieces.parts:
            if hasattr(part, "n_within"):
                count[index] = part.n_within(tolerance[index], slide[index])
            else:
                patches, own = part.cut_within(tolerance[index], slide[index]), tessellate.part(self.known, index)
                mesh = tessellate.assemble(patches, [self.surfaces[s] for s in index], own)
                count[index] = np.diff(mesh.face_start)
        return int(count @ self.copies)

    def by_count(self, asked):
        """The Level of at most `asked` triangles, or the smallest there is."""
        self._affordable(asked)
        pieces = self.pieces
        for _ in range(1 + LESSONS):
            tolerance, patches = self._cut(asked, pieces)
            better = pieces.learned(patches, *self.asked_of(tolerance))
            if better is None:
                break
            pieces = better
        return self._level(patches, tolerance, asked, self.count(patches) > asked)

    def _cut(self, asked, pieces):
        """(tolerance, patches) of at most `asked` triangles where that can be: what was cut may differ from what was
        predicted, then less is asked for.
        """
        ask = asked
        for _ in range(ATTEMPTS):
            tolerance = self.tolerance_for(ask, pieces)
            patches = pieces.cut(*self.asked_of(tolerance))
            count = self.count(patches)
            if count <= asked or ask <= self.predicted(COARSEST, pieces):
                break
            ask = min(int(ask * asked / count), ask - 1)
        return tolerance, patches

    def tolerance_for(self, asked, pieces=None):
        """The smallest tolerance found by bisection whose count is at most `asked`, or hardly above the least there is.

        A mesh of many pieces can not be thinned below some count: there nothing is won by a coarser tolerance.
        """
        low, high = np.log(FINEST), np.log(COARSEST)
        asked = max(asked, int(LEAST_COUNT * self.predicted(COARSEST, pieces)))
        for _ in range(40):
            middle = (low + high) / 2
            if self.predicted(np.exp(middle), pieces) <= asked:
                high = middle
            else:
                low = middle
        return float(np.exp(high))

    def _affordable(self, count):
        if count > MOST:
            raise TooFine(f"needs {count} triangles, at most {MOST} are allowed")

    def _level(self, patches, tolerance, asked, is_smallest):
        mesh = tessellate.assemble(patches, self.surfaces, self.known)
        N = np.concatenate([self._normals(s, patch) for s, patch in enumerate(patches)])
        between = gap(mesh, self.surfaces, self.known)
        return Level(mesh, N, float(tolerance), between, asked, is_smallest)

    def _normals(self, s, patch):
        """Unit normals (k, 3) of the exact surface at a patch's vertices; of its triangles where it has none."""
        try:
            return self.pieces.normals(s, patch)
        except ValueError:
            N, area = facets.normals(*(patch.S[patch.F[:, k]] for k in range(3)))
            total = np.zeros_like(patch.S)
            for k in range(3):
                np.add.at(total, patch.F[:, k], N * area[:, None])
            length = np.linalg.norm(total, axis=1, keepdims=True)
            return np.where(length > 0, total / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])

    def count(self, patches):
        """Triangles of what was cut, one patch a surface."""
        return int(np.array([len(p.F) for p in patches]) @ self.copies)
