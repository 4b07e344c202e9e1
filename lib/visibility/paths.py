"""Light at points by random paths: rough, from triangles alone, with nothing known before.

Paths go on by cosine rays from what they meet, and add the light of the lamps at every end (Kajiya 1986, next-event
estimation); a ray to the lamps ends on one of their triangles, chosen by its power, which counts in the disc form of
the form factor, cos cos A / (pi r^2 + A) (Wallace et al. 1989): it stays below 1 however near the lamp is.
"""

import math
from dataclasses import dataclass

import numpy as np

from lib.compiled import compiled
from lib.elements.lattice import OFFSET
from lib.nurbs.facets import normals
from lib.visibility.hemisphere import cosine_direction_each
from lib.visibility.tracer import Tracer

BOUNCES = 4
SHADOW_RAYS = 4  # from every end of a path


@dataclass(frozen=True)
class Lamps:
    """Emitting triangles: corner (k, 3, 3), unit normal (k, 3), area (k,), tint (k, C) of their exitance, its largest
    channel being 1; total power, of that channel; share (k,) of it, summed up."""

    corner: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    tint: np.ndarray
    power: float
    share: np.ndarray


def lamps_of(V, F, face_surface, E, largest=np.inf):
    """The Lamps of triangles F (m, 3) of V (n, 3), of surfaces face_surface (m,) with exitance E (surfaces, C).

    largest : side of a triangle; larger ones are divided.  Nearer than twice its side a triangle gives too little.
    """
    power = E.max(axis=1)
    face = np.flatnonzero(power[face_surface] > 0) if len(F) else np.zeros(0, dtype=np.int64)
    face = face[by_place(V, F[face])]
    corner, surface = _divided(V[F[face]], face_surface[face], largest)
    normal, area = normals(*corner.swapaxes(0, 1))
    tint = E[surface] / power[surface, None]
    emitted = np.cumsum(power[surface] * area)
    total = float(emitted[-1]) if len(emitted) else 0.0
    if not total > 0:
        return Lamps(corner[:0], normal[:0], area[:0], tint[:0], 1.0, emitted[:0])
    return Lamps(corner, normal, area, tint, total, emitted / total)


def _divided(corner, surface, largest):
    """Triangles (k, 3, 3) and their surfaces, those with a side above `largest` in two at the middle of the longest,
    and so on: slivers stay few."""
    while True:
        side = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)
        large = np.flatnonzero(side.max(axis=1, initial=0.0) > largest)
        if not large.size:
            return corner, surface
        first = side[large].argmax(axis=1)
        a, b, c = (corner[large, (first + k) % 3] for k in range(3))
        middle = (a + b) / 2
        halves = [np.stack(half, axis=1) for half in ((a, middle, c), (middle, b, c))]
        kept = np.delete(np.arange(len(corner)), large)
        corner, surface = np.concatenate([corner[kept], *halves]), surface[np.concatenate([kept, large, large])]


def by_place(V, F):
    """Order of triangles by the coordinates of their corners, whatever their numbers."""
    return np.lexsort(V[F].reshape(-1, 9).T)


@dataclass(frozen=True)
class Room:
    """What paths travel in.

    V (n, 3) in the scene's frame (its box has the side 1), F (m, 3), front counterclockwise; face_surface (m,)
    rho, back_rho (surfaces, C) reflectance of fronts and of backs, 0 where they swallow light
    """

    V: np.ndarray
    F: np.ndarray
    face_surface: np.ndarray
    rho: np.ndarray
    back_rho: np.ndarray
    lamps: Lamps
    tracer: Tracer

    def irradiance(self, x, N, rng):
        """One estimate of the irradiance at each of x (m, 3), on the side of N (m, 3): (m, C)."""
        return self.direct(x, N, rng) + self.indirect(x, N, rng)

    def direct(self, x, N, rng, n_rays=SHADOW_RAYS):
        """Irradiance (m, C) from the lamps, by n_rays to each point."""
        if not len(self.lamps.share):
            return np.zeros((len(x), self.rho.shape[1]))
        x = x + OFFSET * N
        return sum(self._from_lamps(x, N, rng) for _ in range(n_rays)) / n_rays

    def indirect(self, x, N, rng):
        """Irradiance (m, C) from what reflects, by a path from each point."""
        C = self.rho.shape[1]
        H, weight, path = np.zeros((len(x), C)), np.ones((len(x), C)), np.arange(len(x))
        for _ in range(BOUNCES):
            if not len(path) or not len(self.F):
                break
            D = cosine_direction_each(N, rng.random((len(x), 2)))
            hits = self.tracer.closest((x + OFFSET * N).astype(np.float32), D)
            surface = self.face_surface[hits.face]
            weight = weight * np.where(hits.is_back[:, None], self.back_rho[surface], self.rho[surface])
            goes_on = (hits.face >= 0) & (weight.max(axis=1) > 0)
            hits, path, weight = hits[goes_on], path[goes_on], weight[goes_on]
            corner = self.V[self.F[hits.face]]
            a, b = hits.a[:, None].astype(np.float64), hits.b[:, None].astype(np.float64)
            x = corner[:, 0] + a * (corner[:, 1] - corner[:, 0]) + b * (corner[:, 2] - corner[:, 0])
            N = normals(*corner.swapaxes(0, 1))[0] * np.where(hits.is_back, -1.0, 1.0)[:, None]
            H[path] += weight * self.direct(x, N, rng)
        return H

    def _from_lamps(self, x, N, rng):
        """Irradiance (n, C) at x, lifted, from one point of the lamps, chosen by their power."""
        n, lamps = len(x), self.lamps
        chosen, place = rng.random(n), rng.random((2, n))
        seen, of, arrives = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64), np.empty(n)
        origins, D = np.empty((2, n, 3), dtype=np.float32)
        light = lamps.corner, lamps.normal, lamps.area, lamps.share, lamps.power
        count = _towards_lamps(*light, x, N, chosen, place, seen, of, arrives, origins, D)
        free = np.flatnonzero(~self.tracer.is_blocked(origins[:count], D[:count]))
        H = np.zeros((n, lamps.tint.shape[1]))
        H[seen[free]] = arrives[free, None] * lamps.tint[of[free]]
        return H


@compiled(
    "f8[:,:,:], f8[:,:], f8[:], f8[:], f8, f8[:,:], f8[:,:], f8[:], f8[:,:], i8[:], i8[:], f8[:], f4[:,:], f4[:,:]"
)
def _towards_lamps(corner, normal, area, share, power, x, N, chosen, place, seen, of, H, origins, D):
    """What each of x (m, 3) gets on the side of N (m, 3) from a point of the lamps, if nothing stands between.

    corner, normal, area, share, power : as in Lamps;  chosen (m,), place (2, m) : numbers of [0, 1) that choose the
    triangle and the point of it
    seen (m,), of (m,), H (m,), origins, D (m, 3) : of those that face each other, one after the other, their numbers,
    the triangle, irradiance and ray to the lamp's point; returns how many
    """
    count = 0
    for i in range(len(x)):
        # The first triangle with share > chosen
        k, high = 0, len(share) - 1
        while k < high:
            middle = (k + high) // 2
            if share[middle] > chosen[i]:
                high = middle
            else:
                k = middle + 1
        a, b = place[0, i], place[1, i]
        if a + b > 1:
            a, b = 1 - a, 1 - b
        px, py, pz = corner[k, 0, 0], corner[k, 0, 1], corner[k, 0, 2]
        dx = px + a * (corner[k, 1, 0] - px) + b * (corner[k, 2, 0] - px) - x[i, 0]
        dy = py + a * (corner[k, 1, 1] - py) + b * (corner[k, 2, 1] - py) - x[i, 1]
        dz = pz + a * (corner[k, 1, 2] - pz) + b * (corner[k, 2, 2] - pz) - x[i, 2]
        leaving = N[i, 0] * dx + N[i, 1] * dy + N[i, 2] * dz
        arriving = -(normal[k, 0] * dx + normal[k, 1] * dy + normal[k, 2] * dz)
        if leaving > 0 and arriving > 0:
            r2 = dx * dx + dy * dy + dz * dz
            seen[count], of[count] = i, k
            H[count] = power * (leaving * arriving / r2) / (math.pi * r2 + area[k])
            origins[count, 0], origins[count, 1], origins[count, 2] = x[i, 0], x[i, 1], x[i, 2]
            D[count, 0], D[count, 1], D[count, 2] = dx, dy, dz
            count += 1
    return count
