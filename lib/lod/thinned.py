"""Triangle meshes after any number of collapses: thinned by quadrics, with their charts, borders and normals.  The one
importer of fast_simplification.

Meshes that share positions are thinned together, so that they still do afterwards.  The library decides on the order of
collapses (lib.lod.collapse); vertices are then put where the planes of all triangles that went into them, weighted by
area, fit best; corners keep values of the chart that they came from (lib.lod.carry).  Every level can be measured
(lib.lod.mesh_distance).
"""

from dataclasses import dataclass, replace

import fast_simplification
import numpy as np

from lib.lod import carry, collapse
from lib.lod import collapse_kernels as kernels
from lib.lod.mesh_distance import Original
from lib.nurbs.facets import Patch, normals
from lib.surfaces import mesh_pieces
from lib.surfaces.measure import corners
from lib.surfaces.mesh import Mesh
from lib.surfaces.mesh_build import height_ratio, welded

PULL = 1e-2  # of the area: how much vertices are held where the library put them
KEPT = 1e-9  # frames: vertices that would move less stay
TURN = 0.2  # cosine of the angle by which a triangle may turn from what it was: the library's
FLAT = 0.02  # height over longest edge
AGAINST = 0.5  # cosine: normals farther from their triangle's than 60 degrees give way to that


@dataclass(frozen=True)
class ThinPatch(Patch):
    """A Patch with the unit normals N (k, 3) of its vertices."""

    N: np.ndarray


class Thinned:
    """Meshes, a list of n, in a frame of size about 1, after any number of collapses.

    history : the lib.lod.collapse.History of all of them, found here where it is None
    counts (c + 1,) : triangles left after k collapses, or a few more than that: those without an area go
    part (m,) : the mesh of each triangle
    """

    def __init__(self, meshes, history=None):
        self.meshes = meshes
        self._originals = [Original(mesh) for mesh in meshes]
        start = np.cumsum([0, *(len(mesh.V) for mesh in meshes)])
        F = np.concatenate([mesh.F + first for mesh, first in zip(meshes, start, strict=False)])
        V, F = welded(np.concatenate([mesh.V for mesh in meshes]) + 0.0, F)
        self.part = np.repeat(np.arange(len(meshes)), [len(mesh.F) for mesh in meshes])
        if history is not None and (history.n, len(history.death)) != (len(V), len(F)):
            raise ValueError(f"collapses of {len(history.death)} triangles, these meshes have {len(F)}")
        self.V, self.F = V, F
        self.uv = carry.wedges(V, F, self.part, np.concatenate([_uv(mesh) for mesh in meshes]))
        self.N = carry.wedges(V, F, self.part, np.concatenate([mesh.N for mesh in meshes]))
        seam, seam_face = self.F.ravel()[self.uv.seam], self.uv.seam[:, 0] // 3
        edges = np.unique(np.sort(seam, axis=1), axis=0)
        degree = np.bincount(edges.ravel(), minlength=len(V))
        self.locked = np.flatnonzero((degree != 0) & (degree != 2))
        self.history = self._collapsed(seam, seam_face) if history is None else history
        last = np.zeros(len(meshes), dtype=np.int64)
        np.maximum.at(last, self.part, self.history.death)
        self._last = last  # collapses that leave a mesh a triangle; after them it keeps one as it was
        self.counts = self.history.counts() + np.searchsorted(np.sort(last), np.arange(len(self.history.pair) + 1))
        self._normal = normals(*(V[F[:, k]] for k in range(3)))[0]
        self._planes = _planes(V, F, seam, seam_face)

    def _collapsed(self, seam, seam_face):
        V = self.V
        middle, size = (V.min(axis=0) + V.max(axis=0)) / 2, float(np.ptp(V, axis=0).max())
        added = collapse.with_added((V - middle) / size, self.F, seam, seam_face, self.locked)
        collapses = fast_simplification.simplify(
            added.P, added.T, target_count=1, agg=collapse.AGGRESSIVENESS, return_collapses=True
        )[2]
        return collapse.history(V, self.F, added, collapses)

    def step(self, count):
        """The fewest collapses after which at most `count` triangles are left; all, where more are."""
        return min(int(np.searchsorted(-self.counts, -count)), len(self.counts) - 1)

    def counts_of(self, k):
        """Triangles (n,) of each mesh after k collapses, or a few less."""
        return np.bincount(self.part[self.history.death >= k], minlength=len(self.meshes)) + (self._last < k)

    def patches(self, k):
        """A list of ThinPatch after k collapses, their distances not measured yet."""
        if not k:
            return [_patch(mesh) for mesh in self.meshes]
        root, base = self.history.roots(k), self.history.places(self.V, k)
        alive = np.flatnonzero(self.history.death >= k)
        F = root[self.F[alive]]
        X = self._placed(root, base, F, self._normal[alive])
        face, area = normals(*(X[F[:, j]] for j in range(3)))
        has_area = area > 0
        alive, F, face = alive[has_area], F[has_area], face[has_area]
        uv = carry.carried(self.uv, root, alive, X)
        N = _facing(carry.carried(self.N, root, alive, X), face)
        owns = [self.part[alive] == s for s in range(len(self.meshes))]
        return [
            _patch(Mesh(X, F[own], N[own], uv=uv[own]) if own.any() else _largest(mesh))
            for own, mesh in zip(owns, self.meshes, strict=True)
        ]

    def measured(self, k, patches):
        """(n, 4): largest distance, its mean square, largest slide and triangles of the patches after k collapses."""
        counts = [len(patch.F) for patch in patches]
        if not k:
            return np.array([(0.0, 0.0, 0.0, count) for count in counts])
        found = [m.measure(p.S, p.UV, p.F) for m, p in zip(self._originals, patches, strict=True)]
        return np.array([(m.distance, m.square, m.slide, count) for m, count in zip(found, counts, strict=True)])

    def _placed(self, root, base, F, given):
        """Positions by root: where the planes of the triangles that went into a vertex fit best, if no triangle of F
        becomes flat or turns too far from what it was given as (a, 3); in base, none has.
        """
        n = len(base)
        A, c, area = (np.zeros((n, each.shape[1])) for each in self._planes)
        for each, total in zip(self._planes, (A, c, area), strict=True):
            kernels.sum_rows(root, each, total)
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
        vertex = np.ascontiguousarray(vertex)
        kernels.sum_rows(vertex, weight[:, None] * (n[:, :, None] * n[:, None, :]).reshape(-1, 9), A)
        kernels.sum_rows(vertex, (weight * d)[:, None] * n, c)
        kernels.sum_rows(vertex, weight[:, None].copy(), total)
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
