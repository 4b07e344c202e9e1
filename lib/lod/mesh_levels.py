"""Levels of detail of triangle meshes: how far they may be thinned for a tolerance or a count.

What collapses cost is found once (`Ladder.known`), before any level is asked for: levels all the way down are measured,
at most ROUGH times apart where distances matter.  Who asks for a tolerance measures some between two of these, TRIALS
at most, to come within NEAR times the triangles that it needs.
"""

from dataclasses import dataclass, replace

import numpy as np

from lib.lod.collapse import History
from lib.lod.thinned import Thinned
from lib.surfaces.pieces import pieces
from lib.surfaces.rows import numbered

STEP = 4.0  # times fewer triangles, from one measured level to the next
ROUGH = 2.0  # as many times more triangles are near enough in the survey
NEAR = 1.1  # times more triangles than needed is near enough
SPARE = 0.005  # of all meshes' triangles: that many more than needed, over all groups, are near enough too ...
ROUGHLY = 8  # ... and as many times that in the survey
FINE, COARSE = 1e-5, 1e-2  # frames; for tolerances beyond, levels are measured when they are asked for
ALIKE = 1.02  # levels whose distances differ by less have none between them
SLIDE = 8.0  # a texture may slide as many tolerances
TRIALS = 6  # levels measured for a tolerance
LEAST = 1e-9  # of what is allowed: levels nearer than that count as this near


@dataclass(frozen=True)
class Known:
    """What takes long to find out about meshes that touch.

    index (n,) ascending int64, their numbers;  history : how they are thinned, all together
    steps (s,) ascending int64, collapses after which they were measured, from none to all
    measured (s, n, 4) largest distance, its mean square, largest slide, triangles
    """

    index: np.ndarray
    history: History
    steps: np.ndarray
    measured: np.ndarray


class Ladder:
    """All levels of meshes that touch, a list of n, in a frame of size about 1.

    known : what was found out about them, found again where it is None
    spare : triangles; that many more than needed are near enough
    tolerance, slide : (n,) limits of each mesh's distance and of its texture's slide, in what follows
    """

    def __init__(self, meshes, known=None, spare=0.0):
        self.meshes, self.spare = meshes, spare
        self._thin = Thinned(meshes, None if known is None else known.history)
        self.counts = self._thin.counts
        self._made, self._measured = {}, {}
        if known is None:
            self._survey()
            self._made.clear()
        else:
            self._measured = dict(zip(known.steps.tolist(), known.measured, strict=True))

    def known(self, index):
        """What is Known of these meshes, whose numbers are `index`."""
        steps = np.array(sorted(self._measured), dtype=np.int64)
        measured = np.array([self._measured[k] for k in steps.tolist()])
        return Known(np.asarray(index, dtype=np.int64), self._thin.history, steps, measured)

    @property
    def smallest(self):
        """Triangles of the smallest level."""
        return int(self.counts[-1])

    def by_count(self, count):
        """A list of ThinPatch of at most `count` triangles, or the smallest level."""
        return self._level(self._thin.step(count))

    def about(self, tolerance, slide):
        """A list of ThinPatch of as many triangles as `predicted` says."""
        return self._level(self._likely(tolerance, slide))

    def predicted(self, tolerance, slide):
        """Triangles (n,) that a level for tolerance (n,) and slide (n,) will have, about."""
        return self._thin.counts_of(self._likely(tolerance, slide))

    def by_tolerance(self, tolerance, slide):
        """A list of ThinPatch whose measured distance is at most tolerance (n,) and slide at most slide (n,)."""
        return self._level(self._within(tolerance, slide))

    def counts_within(self, tolerance, slide):
        """Triangles (n,) of `by_tolerance`."""
        return self._measured[self._within(tolerance, slide)][:, 3].astype(np.int64)

    def _within(self, tolerance, slide):
        """Collapses that keep within the limits."""
        for trial in range(TRIALS):
            fits, fails = self._around(tolerance, slide)
            if fails is None or self._is_near(fits, fails):
                break
            a, b = self.counts[fails], self.counts[fits]
            # Every other time halve the distance: the power law may come near one end alone.
            count = np.sqrt(a * b) if trial % 2 else self._between(fits, fails, tolerance, slide)
            k = self._thin.step(int(np.clip(count, a * NEAR, b / NEAR)))
            if k in self._measured:
                break
            self._measure(k)
        return self._around(tolerance, slide)[0]

    def _likely(self, tolerance, slide):
        """Collapses that will about keep within the limits."""
        fits, fails = self._around(tolerance, slide)
        return fits if fails is None else self._thin.step(int(self._between(fits, fails, tolerance, slide)))

    def _survey(self):
        """Measure levels all the way down, and between those that are far apart."""
        steps, count = [0], self.counts[0] / STEP
        while count > self.smallest * STEP:
            steps.append(self._thin.step(int(count)))
            count /= STEP
        steps = sorted({*steps, len(self.counts) - 1})
        for k in steps:
            self._measure(k)
        pairs = list(zip(steps[:-1], steps[1:], strict=True))
        while pairs:
            i, j = pairs.pop()
            if self._is_near(i, j, ROUGH, ROUGHLY) or self._is_idle(i, j):
                continue
            k = self._thin.step(int(np.sqrt(self.counts[i] * self.counts[j])))
            if k not in self._measured:
                self._measure(k)
                pairs += [(i, k), (k, j)]

    def _is_near(self, i, j, near=NEAR, spares=1):
        """Are the triangles after i collapses few more than after j?"""
        return self.counts[i] <= max(near * self.counts[j], self.counts[j] + spares * self.spare)

    def _is_idle(self, i, j):
        """Is no tolerance likely to ask for a level between those after i and j collapses?"""
        fine, coarse = (self._measured[k][:, [0, 2]] / [1, SLIDE] for k in (i, j))
        return bool((coarse <= np.maximum(ALIKE * fine, FINE)).all() or fine[:, 0].max() > COARSE)

    def _excess(self, k, tolerance, slide):
        """The largest ratio of a level's distances and slides to the allowed ones."""
        distance, _, slides, _ = self._measured[k].T
        return max(LEAST, float((distance / tolerance).max()), float((slides / slide).max()))

    def _around(self, tolerance, slide):
        """(the most collapses measured that keep within the limits, the next measured that do not or None)."""
        fails = None
        for k in sorted(self._measured, reverse=True):
            if self._excess(k, tolerance, slide) <= 1:
                return k, fails
            fails = k
        return 0, fails

    def _between(self, fits, fails, tolerance, slide):
        """Count at which the limits are reached: by a power law between two levels, or, above the finest one measured,
        as distances go with the area of triangles.
        """
        b, high = self.counts[fails], self._excess(fails, tolerance, slide)
        if fits == 0:
            return min(b * high, self.counts[0])
        a, low = self.counts[fits], self._excess(fits, tolerance, slide)
        return a * (b / a) ** (np.log(low) / np.log(low / high))

    def _level(self, k):
        """The list of ThinPatch after k collapses, with their distances."""
        self._measure(k)
        return [
            replace(patch, distance=float(distance), square=float(square), slide=float(slide))
            for patch, (distance, square, slide, _) in zip(self._patches(k), self._measured[k], strict=True)
        ]

    def _measure(self, k):
        if k not in self._measured:
            self._measured[k] = self._thin.measured(k, self._patches(k))

    def _patches(self, k):
        if k not in self._made:
            self._made = {k: self._thin.patches(k)}  # the last one alone: all together they are large
        return self._made[k]


class MeshLevels:
    """n Meshes in the frame of a scene, thinned; the class of this kind that lib.surfaces.tessellate.Pieces asks for.

    Meshes that share positions are thinned together.  A mesh has no lines to put: `lattice` is ignored, its light
    stays in its texture.
    found : a list of Known, of all meshes, as `found` gives it; or None, then it is found out now.  ValueError where it
    is of other meshes.
    """

    def __init__(self, surfaces, known, lattice=None, found=None):
        self.n = len(surfaces)
        groups = touching(surfaces) if found is None else [each.index for each in found]
        if not np.array_equal(np.sort(np.concatenate(groups)), np.arange(self.n)):
            raise ValueError(f"not of these {self.n} meshes")
        found = [None] * len(groups) if found is None else found
        spare = SPARE * sum(len(mesh.F) for mesh in surfaces) / len(groups)
        self._ladders = [
            (index, Ladder([surfaces[s] for s in index], each, spare))
            for index, each in zip(groups, found, strict=True)
        ]

    def found(self):
        """A list of Known, which spares finding it again."""
        return [ladder.known(index) for index, ladder in self._ladders]

    def n_triangles(self, tolerance, slide):
        """Triangles (n,) that `cut` will make."""
        return self._counted(lambda ladder, index: ladder.predicted(tolerance[index], slide[index]))

    def n_within(self, tolerance, slide):
        """Triangles (n,) that `cut_within` will make."""
        return self._counted(lambda ladder, index: ladder.counts_within(tolerance[index], slide[index]))

    def _counted(self, count):
        out = np.zeros(self.n, dtype=np.int64)
        for index, ladder in self._ladders:
            out[index] = count(ladder, index)
        return out

    def cut(self, tolerance, slide):
        """A list of ThinPatch whose distances are about the tolerance (n,) and whose slides about slide (n,)."""
        return self._each(lambda ladder, index: ladder.about(tolerance[index], slide[index]))

    def cut_within(self, tolerance, slide):
        """A list of ThinPatch within tolerance (n,) and slide (n,)."""
        return self._each(lambda ladder, index: ladder.by_tolerance(tolerance[index], slide[index]))

    def _each(self, level):
        out = [None] * self.n
        for index, ladder in self._ladders:
            for s, patch in zip(index, level(ladder, index), strict=True):
                out[s] = patch
        return out

    def learned(self, patches, tolerance, slide):
        """None: what was measured is known already."""
        return None

    def normals(self, s, patch):
        """Unit normals (k, 3) at the vertices of a patch."""
        return patch.N


def touching(meshes):
    """Groups of meshes that share positions bit for bit, directly or by others: a list of (k,) ascending numbers."""
    owner = np.repeat(np.arange(len(meshes)), [len(mesh.V) for mesh in meshes])
    place, first = numbered(np.concatenate([mesh.V for mesh in meshes]))
    group = pieces(len(meshes) + len(first), owner, len(meshes) + place)[: len(meshes)]
    return [np.flatnonzero(group == k) for k in np.unique(group)]
