"""How far a thinned mesh is from the mesh it came from, and how far its texture slides.

Distances are taken both ways, from vertices and from places inside of triangles to the closest point of the other mesh.
Slide is the distance between the places that a pair (u, v) has on both.  Vertices and triangles that both meshes have
are off by 0; nothing is searched for them.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lib.lod.closest_kernels import closest_weights
from lib.nurbs.facets import normals
from lib.surfaces.rows import Rows
from lib.visibility import closest

PLACES = 10_000  # inside of triangles, about: in the largest, where there are more
MOST_STEPS = 8  # along an edge


@dataclass(frozen=True)
class Measured:
    """distance : largest, both ways;  square : mean square from the first mesh's area;  slide : largest"""

    distance: float
    square: float
    slide: float


class Original:
    """A Mesh that others are measured against."""

    def __init__(self, mesh):
        self.mesh = mesh

    @cached_property
    def _shape(self):
        return closest.prepare(self.mesh.V, self.mesh.F)

    @cached_property
    def _map(self):
        flat = np.concatenate([self.mesh.uv.reshape(-1, 2), np.zeros((3 * len(self.mesh.F), 1))], axis=1)
        return closest.prepare(flat, np.arange(len(flat)).reshape(-1, 3))

    @cached_property
    def _samples(self):
        """(corners (a, 3), triangles (t, 3) the largest ones, weight of the corners and of places in these in the mean
        square).
        """
        V, F = self.mesh.V, self.mesh.F
        used, some = np.unique(F), _largest(V, F)
        n = len(within(V[some]))
        if len(some) == len(F):
            weight = np.concatenate([np.zeros(len(used)), np.repeat(_areas(V, some), n // len(some))])
        else:
            around = np.bincount(F.ravel(), np.repeat(_areas(V, F), 3), len(V))
            weight = np.concatenate([around[used], np.zeros(n)])
        return V[used], some, weight / max(weight.sum(), 1e-300)

    @cached_property
    def _known(self):
        """Rows of what made meshes may have too: positions, positions with uv, triangles, triangles with uv."""
        V, F = self.mesh.V, self.mesh.F
        uv = np.zeros((len(F), 3, 2)) if self.mesh.uv is None else self.mesh.uv
        carried = np.concatenate([V[F], uv], axis=2)
        return Rows(V), Rows(carried.reshape(-1, 5)), Rows(V[F].reshape(-1, 9)), Rows(carried.reshape(-1, 15))

    def measure(self, V, UV, F):
        """The Measured of triangles F (m, 3) with vertices V (k, 3), all used, and UV (k, 2)."""
        (corners, largest, share), (places, pairs, triangles, maps) = self._samples, self._known
        sides = self.mesh.V[largest]
        has_sides = Rows(V[F].reshape(-1, 9)).holds(sides.reshape(-1, 9))
        off = _off(closest.prepare(V, F), corners, Rows(V).holds(corners), sides, has_sides)
        some = _largest(V, F)
        off_made = _off(self._shape, V, places.holds(V), V[some], triangles.holds(V[some].reshape(-1, 9)))
        distance, slide = float(max(off.max(), off_made.max())), 0.0
        if self.mesh.uv is not None:
            both = np.concatenate([V, UV], axis=1)
            both, _ = _far(both, pairs.holds(both), both[some], maps.holds(both[some].reshape(-1, 15)))
            slide = float(np.linalg.norm(self.at(both[:, 3:]) - both[:, :3], axis=1).max(initial=0.0))
        return Measured(distance, float(share @ off**2), max(slide, distance))

    def at(self, uv):
        """Places (n, 3) of uv (n, 2), or of the closest pairs in a chart."""
        _, face, weight = _nearest(self._map, np.concatenate([uv, np.zeros((len(uv), 1))], axis=1))
        return np.einsum("nk,nkc->nc", weight, self.mesh.V[self.mesh.F[face]])


def _areas(V, F):
    return normals(*(V[F[:, k]] for k in range(3)))[1]


def _largest(V, F):
    """PLACES triangles of F, those of the largest areas; all, where there are fewer."""
    return F[np.argsort(-_areas(V, F), kind="stable")[:PLACES]]


def _off(mesh, corners, has_corner, triangles, has_triangle):
    """Distances from a prepared mesh of corners (a, 3), then of places in triangles (t, 3, 3); 0 of those it has."""
    points, is_far = _far(corners, has_corner, triangles, has_triangle)
    off = np.zeros(len(is_far))
    off[is_far] = _nearest(mesh, points)[0]
    return off


def _far(corners, has_corner, triangles, has_triangle):
    """(points (f, c), is_far (n,)) of corners (a, c) and of places in triangles (t, 3, c): those a mesh has not."""
    inside = within(triangles)
    is_far = ~np.concatenate([has_corner, np.repeat(has_triangle, len(inside) // len(triangles))])
    return np.concatenate([corners, inside])[is_far], is_far


def _nearest(mesh, points):
    """Distance (n,), face (n,) and weights (n, 3) of the closest places; of the face that float32 found, exactly."""
    face = closest.closest(mesh, points)[1] if len(points) else np.zeros(0, dtype=np.int64)
    corner, weight = mesh.V[mesh.F[face]], np.empty((len(points), 3))
    closest_weights(corner, np.ascontiguousarray(points), weight)
    at = np.einsum("nk,nkc->nc", weight, corner)
    return np.linalg.norm(at - points, axis=1), face, weight


def within(corner):
    """Values (m k, c) at k places of each triangle but its corners, triangle after triangle, from corner (m, 3, c)."""
    steps = int(np.clip(np.sqrt(2 * PLACES / max(len(corner), 1)), 1, MOST_STEPS))
    i, j = np.divmod(np.arange((steps + 1) ** 2), steps + 1)
    weight = np.stack([i, j, steps - i - j], axis=1)[i + j <= steps] / steps
    weight = weight[weight.max(axis=1) < 1]
    if steps < 3:  # no place is inside
        weight = np.concatenate([weight, np.full((1, 3), 1 / 3)])
    return np.einsum("kj,mjc->mkc", weight, corner).reshape(-1, corner.shape[2])
