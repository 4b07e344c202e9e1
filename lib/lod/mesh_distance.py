"""How far a thinned mesh is from the mesh it came from, and how far its texture slides.

Distances are taken both ways, from vertices and from places inside of triangles to the closest point of the other mesh.
Slide is the distance between the places that a pair (u, v) has on both.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lib.lod.carry import closest_weights
from lib.nurbs.facets import normals
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
        """(points (k, 3), weight (k,) in the mean square): corners, and places in the largest triangles."""
        V, F = self.mesh.V, self.mesh.F
        used, some = np.unique(F), _largest(V, F)
        inside = within(V[some])
        if len(some) == len(F):
            weight = np.concatenate([np.zeros(len(used)), np.repeat(_areas(V, some), len(inside) // len(some))])
        else:
            around = np.bincount(F.ravel(), np.repeat(_areas(V, F), 3), len(V))
            weight = np.concatenate([around[used], np.zeros(len(inside))])
        return np.concatenate([V[used], inside]), weight / max(weight.sum(), 1e-300)

    def measure(self, V, UV, F):
        """The Measured of triangles F (m, 3) with vertices V (k, 3), UV (k, 2)."""
        points, share = self._samples
        off = _nearest(closest.prepare(V, F), points)[0]
        some = _largest(V, F)
        P, uv = np.concatenate([V, within(V[some])]), np.concatenate([UV, within(UV[some])])
        off_made = _nearest(self._shape, P)[0]
        distance = float(max(off.max(), off_made.max()))
        slide = 0.0 if self.mesh.uv is None else float(np.linalg.norm(self.at(uv) - P, axis=1).max())
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


def _nearest(mesh, points):
    """Distance (n,), face (n,) and weights (n, 3) of the closest places; of the face that float32 found, exactly."""
    face = closest.closest(mesh, points)[1]
    corner = [mesh.V[mesh.F[face, k]] for k in range(3)]
    weight = closest_weights(*corner, points)
    at = sum(weight[:, k, None] * corner[k] for k in range(3))
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
