"""Levels of detail of triangle meshes: thinned by quadrics, with their charts, borders and normals.  The one importer
of fast_simplification.

Meshes that share positions are thinned together, so that they still do afterwards.  The library decides on the order of
collapses (lib.lod.collapse); vertices are then put where the planes of all triangles that went into them, weighted by
area, fit best; corners keep values of the chart that they came from (lib.lod.carry).  Every level is measured
(lib.lod.mesh_distance), and the counts and distances of those seen so far tell what another will cost.
"""

from dataclasses import dataclass, replace

import fast_simplification
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lib.lod import carry, collapse
from lib.lod.mesh_distance import Original
from lib.nurbs.facets import Patch, normals
from lib.surfaces import mesh_pieces
from lib.surfaces.measure import corners
from lib.surfaces.mesh import Mesh
from lib.surfaces.mesh_build import height_ratio, welded

STEP = 4.0  # times fewer triangles, from one measured level to the next
TRIALS = 6  # levels measured for a tolerance, after these
NEAR = 1.05  # times more triangles than needed is near enough
PULL = 1e-2  # of the area: how much vertices are held where the library put them
KEPT = 1e-9  # frames: vertices that would move less stay
TURN = 0.2  # cosine of the angle by which a triangle may turn from what it was: the library's
FLAT = 0.02  # height over longest edge
AGAINST = 0.5  # cosine: normals farther from their triangle's than 60 degrees give way to that
LEAST = 1e-9  # of what is allowed: levels nearer than that count as this near


@dataclass(frozen=True)
class ThinPatch(Patch):
    """A Patch with the unit normals N (k, 3) of its vertices."""

    N: np.ndarray


class Ladder:
    """All levels of meshes, a list of n, in a frame of size about 1.

    tolerance, slide : (n,) limits of each mesh's distance and of its texture's slide, in what follows
    """

    def __init__(self, meshes):
        self.meshes = meshes
        self._originals = [Original(mesh) for mesh in meshes]
        start = np.cumsum([0, *(len(mesh.V) for mesh in meshes)])
        F = np.concatenate([mesh.F + first for mesh, first in zip(meshes, start, strict=False)])
        V, F = welded(np.concatenate([mesh.V for mesh in meshes]) + 0.0, F)
        self.part = np.repeat(np.arange(len(meshes)), [len(mesh.F) for mesh in meshes])
        self.V, self.F = V, F
        self.uv = carry.wedges(V, F, self.part, np.concatenate([_uv(mesh) for mesh in meshes]))
        self.N = carry.wedges(V, F, self.part, np.concatenate([mesh.N for mesh in meshes]))
        seam, seam_face = self.F.ravel()[self.uv.seam], self.uv.seam[:, 0] // 3
        edges = np.unique(np.sort(seam, axis=1), axis=0)
        degree = np.bincount(edges.ravel(), minlength=len(V))
        self.locked = np.flatnonzero((degree != 0) & (degree != 2))
        middle, size = (V.min(axis=0) + V.max(axis=0)) / 2, float(np.ptp(V, axis=0).max())
        added = collapse.with_added((V - middle) / size, F, seam, seam_face, self.locked)
        collapses = fast_simplification.simplify(
            added.P, added.T, target_count=1, agg=collapse.AGGRESSIVENESS, return_collapses=True
        )[2]
        self.history = collapse.history(V, F, added, collapses)
        last = np.zeros(len(meshes), dtype=np.int64)
        np.maximum.at(last, self.part, self.history.death)
        self._last = last  # collapses that leave a mesh a triangle; after them it keeps one as it was
        self.counts = self.history.counts() + np.searchsorted(np.sort(last), np.arange(len(self.history.pair) + 1))
        self._normal = normals(*(V[F[:, k]] for k in range(3)))[0]
        self._planes = _planes(V, F, seam, seam_face)
        self._made, self._is_surveyed = {}, False

    @property
    def smallest(self):
        """Triangles of the smallest level."""
        return int(self.counts[-1])

    def by_count(self, count):
        """A list of ThinPatch of at most `count` triangles, or the smallest level."""
        return self._level(self._step(count))

    def about(self, tolerance, slide):
        """A list of ThinPatch of as many triangles as `predicted` says."""
        return self._level(self._likely(tolerance, slide))

    def _step(self, count):
        """The fewest collapses after which at most `count` triangles are left; all, where more are."""
        return min(int(np.searchsorted(-self.counts, -count)), len(self.counts) - 1)

    def by_tolerance(self, tolerance, slide):
        """A list of ThinPatch whose measured distance is at most tolerance (n,) and slide at most slide (n,)."""
        self._survey()
        for trial in range(TRIALS):
            fits, fails = self._around(tolerance, slide)
            if fails is None or self.counts[fits] <= NEAR * self.counts[fails]:
                break
            a, b = self.counts[fails], self.counts[fits]
            # Every other time halve the distance: the power law may come near one end alone.
            count = np.sqrt(a * b) if trial % 2 else self._between(fits, fails, tolerance, slide)
            k = self._step(int(np.clip(count, a * NEAR, b / NEAR)))
            if k in (fits, fails):
                break
            self._level(k)
        return self._level(self._around(tolerance, slide)[0])

    def predicted(self, tolerance, slide):
        """Triangles (n,) that a level for tolerance (n,) and slide (n,) will have, about."""
        k = self._likely(tolerance, slide)
        return np.bincount(self.part[self.history.death >= k], minlength=len(self.meshes)) + (self._last < k)

    def _likely(self, tolerance, slide):
        """Collapses that will about keep within the limits."""
        self._survey()
        fits, fails = self._around(tolerance, slide)
        return fits if fails is None else self._step(int(self._between(fits, fails, tolerance, slide)))

    def _survey(self):
        """Measure levels all the way down, far apart."""
        if not self._is_surveyed:
            self._is_surveyed = True
            self._level(0)
            count = self.counts[0] / STEP
            while count > self.smallest * STEP:
                self._level(self._step(int(count)))
                count /= STEP
            self._level(len(self.counts) - 1)

    def _excess(self, k, tolerance, slide):
        """The largest ratio of a level's distances and slides to the allowed ones."""
        of_all = [max(p.distance / t, p.slide / s) for p, t, s in zip(self._made[k], tolerance, slide, strict=True)]
        return max(LEAST, *of_all)

    def _around(self, tolerance, slide):
        """(the most collapses seen that keep within the limits, the next that do not or None)."""
        fits, fails = 0, None
        for k in sorted(self._made):
            if self._excess(k, tolerance, slide) <= 1:
                fits = k
            else:
                fails = k
                break
        return fits, fails

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
        if k not in self._made:
            self._made[k] = self._thinned(k) if k else [_patch(mesh) for mesh in self.meshes]
        return self._made[k]

    def _thinned(self, k):
        """The list of ThinPatch after k collapses."""
        root, base = self.history.roots(k)[: len(self.V)], self.history.places(self.V, k)
        alive = np.flatnonzero(self.history.death >= k)
        F = root[self.F[alive]]
        X = self._placed(root, base, F, self._normal[alive])
        face, area = normals(*(X[F[:, j]] for j in range(3)))
        has_area = area > 0
        alive, F, face = alive[has_area], F[has_area], face[has_area]
        uv = carry.carried(self.uv, root, alive, X)
        N = carry.carried(self.N, root, alive, X)
        N = _facing(N, face)
        out = []
        for s, original in enumerate(self._originals):
            own = self.part[alive] == s
            mesh = Mesh(X, F[own], N[own], uv=uv[own]) if own.any() else _largest(self.meshes[s])
            patch = _patch(mesh)
            found = original.measure(patch.S, patch.UV, patch.F)
            out.append(replace(patch, distance=found.distance, square=found.square, slide=found.slide))
        return out

    def _placed(self, root, base, F, given):
        """Positions by root: where the planes of the triangles that went into a vertex fit best, if no triangle of F
        becomes flat or turns too far from what it was given as (a, 3); in base, none has.
        """
        n = len(base)
        A, c, area = (np.stack([np.bincount(root, x, n) for x in each.T], axis=1) for each in self._planes)
        used = np.unique(F)
        A, c, hold = A[used].reshape(-1, 3, 3), c[used], PULL * area[used]
        step = -np.linalg.solve(
            A + hold[:, :, None] * np.eye(3), (np.einsum("nij,nj->ni", A, base[used]) + c)[..., None]
        )
        step[np.linalg.norm(step[..., 0], axis=1) < KEPT] = 0.0
        step[np.isin(used, root[self.locked])] = 0.0
        X = base.copy()
        X[used] += step[..., 0]
        while True:
            N = normals(*(X[F[:, k]] for k in range(3)))[0]
            bad = (np.einsum("ij,ij->i", N, given) < TURN) | (height_ratio(X, F) < FLAT)
            bad &= (X[F] != base[F]).any(axis=(1, 2))
            if not bad.any():
                return X
            X[F[bad].ravel()] = base[F[bad].ravel()]


class MeshLevels:
    """n Meshes in the frame of a scene, thinned; the class of this kind that lib.surfaces.tessellate.Pieces asks for.

    Meshes that share positions are thinned together.  A mesh has no lines to put: `lattice` is ignored, its light
    stays in its texture.
    """

    def __init__(self, surfaces, known, lattice=None):
        self.n = len(surfaces)
        self._ladders = [(index, Ladder([surfaces[s] for s in index])) for index in touching(surfaces)]

    def n_triangles(self, tolerance, slide):
        """Triangles (n,) that `cut` will make."""
        out = np.zeros(self.n, dtype=np.int64)
        for index, ladder in self._ladders:
            out[index] = ladder.predicted(tolerance[index], slide[index])
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
    V = np.concatenate([mesh.V for mesh in meshes]) + 0.0
    place = len(meshes) + np.unique(np.ascontiguousarray(V).view("V24").ravel(), return_inverse=True)[1]
    size = int(place.max()) + 1
    graph = coo_array((np.ones(len(owner), dtype=np.int8), (owner, place)), shape=(size, size))
    group = connected_components(graph, directed=False)[1][: len(meshes)]
    return [np.flatnonzero(group == k) for k in np.unique(group)]


def _planes(V, F, seam, seam_face):
    """(A (n, 9), c (n, 3), area (n, 1)): sums over the triangles around each vertex of a third of their area times
    n n', d n and 1, for planes n x + d = 0; of seams likewise with the square of their length, for planes along them.
    """
    N, area = normals(*(V[F[:, k]] for k in range(3)))
    along = V[seam[:, 1]] - V[seam[:, 0]]
    across, _ = normals(np.zeros_like(along), along, N[seam_face])
    each = [(F[:, k], N, area / 3) for k in range(3)]
    each += [(seam[:, k], across, (along**2).sum(axis=1) / 2) for k in (0, 1)]
    A, c, total = np.zeros((len(V), 9)), np.zeros((len(V), 3)), np.zeros((len(V), 1))
    for vertex, n, weight in each:
        d = -np.einsum("ij,ij->i", n, V[vertex])
        np.add.at(A, vertex, weight[:, None] * (n[:, :, None] * n[:, None, :]).reshape(-1, 9))
        np.add.at(c, vertex, (weight * d)[:, None] * n)
        np.add.at(total, vertex, weight[:, None])
    return A, c, total


def _largest(mesh):
    """A mesh of the largest triangle of a mesh."""
    k = [int(normals(*corners(mesh))[1].argmax())]
    return replace(mesh, F=mesh.F[k], N=mesh.N[k], uv=_uv(mesh)[k])


def _uv(mesh):
    return np.zeros((len(mesh.F), 3, 2)) if mesh.uv is None else mesh.uv


def _facing(N, face):
    """Unit normals at corners (a, 3, 3): those given, or the triangle's (a, 3) where they are far from it."""
    length = np.linalg.norm(N, axis=2, keepdims=True)
    N = N / np.maximum(length, 1e-300)
    far = (np.einsum("nkc,nc->nk", N, face) < AGAINST) | (length[..., 0] == 0)
    return np.where(far[..., None], face[:, None], N)


def _patch(mesh):
    patch, N = mesh_pieces.as_patch(mesh)
    return ThinPatch(**vars(patch), N=N)
