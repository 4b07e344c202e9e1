"""Which open sheets get light on both sides: a small path tracing from places on them.

From each place of each side, on arrival and after every reflection, some points of the lamps are asked for their light
(next-event estimation).  A point stands for its triangle in the disc form of the form factor, cos cos A / (pi r^2 + A)
(Wallace et al. 1989), which stays below 1 however near the lamp is.  The estimate is coarse; the question is only
whether a side is dark.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from lib import forks
from lib.compiled import compiled
from lib.elements.lattice import OFFSET
from lib.visibility.hemisphere import cosine_direction_each
from lib.visibility.tracer import Tracer

PLACES = 256  # of a side: light that enters a crack along the border reaches too few to count
BOUNCES = 4
SHADOW_RAYS = 4  # from a place and from every point of a path
AT_ONCE = 32  # surfaces, whose paths share their random numbers
FEW = 2  # such parts that are not worth another process
DARK = 0.01


def side_light(V, F, face_surface, E, rho, candidates, seed=0):
    """Estimate the mean irradiance of both sides of some surfaces.

    Parameters
    ----------
    V, F : (k, 3) positions in the scene's frame (its box has the side 1), (m, 3) triangles, front counterclockwise
    face_surface : (m,) int, surface of each triangle
    E : (n, 3) float64 exitance of surfaces, >= 0, of their front sides [W/m^2];  rho : (n,) reflectance, <= 1
    candidates : indices of surfaces that may be lit on both sides.  Their backs reflect like their fronts; the backs
        of all others swallow light

    Returns
    -------
    (n, 2) float64 irradiance [W/m^2] of front and back, of the largest channel of E; 0 for surfaces that are no
    candidates or have no triangles.

    The order of surfaces does not matter, of triangles only that of each candidate's own.
    """
    V, F, face_surface = np.asarray(V, dtype=np.float64), np.asarray(F), np.asarray(face_surface)
    power, candidates = np.asarray(E, dtype=np.float64).max(axis=1), np.asarray(candidates, dtype=np.int64)
    light = np.zeros((len(power), 2))
    order, sheets = _sheets(V, F, face_surface, candidates)
    lamps = _lamps(V, F, face_surface, power)
    if not len(order) or not len(lamps.share):
        return light

    is_candidate = np.zeros(len(power), dtype=bool)
    is_candidate[candidates] = True

    @cache
    def room():  # of each process: a tracer that a fork has from its parent can not be used
        return _Room(V, F, face_surface, np.asarray(rho, dtype=np.float64), is_candidate, lamps, Tracer(V, F))

    def means(first):
        n, rng = len(order[first : first + AT_ONCE]), np.random.default_rng([seed, first])
        place, N = _places(V, F, sheets, first, n, rng)
        # Send as many paths from the front as from the back.
        H = room().irradiance(np.concatenate([place, place]), np.concatenate([N, -N]), rng)
        return H.reshape(2, n, PLACES).mean(axis=2).T

    light[order] = np.concatenate(forks.mapped(means, range(0, len(order), AT_ONCE), few=FEW))
    return light


def is_two_sided(light, least=DARK):
    """(n,) bool: surfaces with light on both sides, of `light` (n, 2) by side_light."""
    return is_lit(light, least).all(axis=1)


def is_lit(light, least=DARK):
    """(n, 2) bool: the sides that have light, of `light` (n, 2) by side_light.

    A side counts as dark if it gets less than `least` of what the other side gets, and also less than `least` of what
    sheets usually get: the median of the brighter sides.  So a sheet in a dim room keeps both sides beside a bright
    scene, and a lampshade keeps its outside.
    """
    light = np.asarray(light, dtype=np.float64)
    bright = np.max(light, axis=1, keepdims=True)
    usual = np.median(bright[bright > 0]) if (bright > 0).any() else 0.0
    return (light > 0) & (light >= least * np.minimum(bright, usual))


@dataclass(frozen=True)
class _Lamps:
    """Emitting triangles: corner (k, 3, 3), unit normal (k, 3), area (k,), total power; share (k,) of it, summed up."""

    corner: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    power: float
    share: np.ndarray


def _lamps(V, F, face_surface, power):
    face = np.flatnonzero(power[face_surface] > 0) if len(F) else np.zeros(0, dtype=np.int64)
    face = face[_by_place(V, F[face])]
    corner = V[F[face]]
    normal, area = _normals(corner)
    emitted = np.cumsum(power[face_surface[face]] * area)
    total = float(emitted[-1]) if len(emitted) else 0.0
    if not total > 0:
        face, corner, normal, area, emitted, total = face[:0], corner[:0], normal[:0], area[:0], emitted[:0], 1.0
    return _Lamps(corner, normal, area, total, emitted / total)


def _by_place(V, F):
    """Order of triangles by the coordinates of their corners, whatever their numbers."""
    return np.lexsort(V[F].reshape(-1, 9).T)


def _normals(corner):
    """Unit normals (k, 3), zero without an area, and areas (k,) of triangles with corners (k, 3, 3)."""
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, 1e-300)[:, None], length / 2


def _sheets(V, F, face_surface, candidates):
    """Candidates with an area in the order of their places (c,), and their faces (k,) with areas summed up, each
    candidate's to 1: candidate i owns (i, i + 1].
    """
    face = np.flatnonzero(np.isin(face_surface, candidates))
    area = _normals(V[F[face]])[1]
    face, area = face[area > 0], area[area > 0]
    surface, first, row = np.unique(face_surface[face], return_index=True, return_inverse=True)
    order = _by_place(V, F[face[first]])
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    rank = rank[row.ravel()]
    by_rank = np.argsort(rank, kind="stable")
    face, area, rank = face[by_rank], area[by_rank], rank[by_rank]
    share = area / np.bincount(rank, area, len(order))[rank] if len(rank) else area
    return surface[order], (face, np.cumsum(share))


def _places(V, F, sheets, first, n, rng):
    """Points (n PLACES, 3) on candidates first to first + n, evenly by area, and their triangles' unit normals."""
    face, share = sheets
    t = np.arange(first, first + n)[:, None] + (np.arange(PLACES) + rng.random((n, PLACES))) / PLACES
    corner = V[F[face[np.minimum(np.searchsorted(share, t.ravel()), len(face) - 1)]]]
    return _points(corner, rng), _normals(corner)[0]


def _points(corner, rng):
    """A uniform point (k, 3) of each triangle (k, 3, 3)."""
    a, b = rng.random((2, len(corner)))
    over = a + b > 1
    a, b = np.where(over, 1 - a, a)[:, None], np.where(over, 1 - b, b)[:, None]
    return corner[:, 0] + a * (corner[:, 1] - corner[:, 0]) + b * (corner[:, 2] - corner[:, 0])


@dataclass(frozen=True)
class _Room:
    """What paths travel in."""

    V: np.ndarray
    F: np.ndarray
    face_surface: np.ndarray
    rho: np.ndarray
    is_candidate: np.ndarray
    lamps: _Lamps
    tracer: Tracer

    def irradiance(self, x, N, rng):
        """One estimate of the irradiance at each of x (m, 3), on the side of N (m, 3): (m,)."""
        H, weight, path = np.zeros(len(x)), np.ones(len(x)), np.arange(len(x))
        for bounce in range(BOUNCES + 1):
            # Add the lamps' light at the path's end.
            x = x + OFFSET * N
            for _ in range(SHADOW_RAYS):
                H[path] += weight * self._direct(x, N, rng) / SHADOW_RAYS
            if bounce == BOUNCES or not len(path):
                break

            # Go on to what the path's end sees.
            D = cosine_direction_each(N, rng.random((len(x), 2)))
            hits = self.tracer.closest(x.astype(np.float32), D)
            surface = self.face_surface[hits.face]
            weight = weight * self.rho[surface]
            goes_on = (hits.face >= 0) & (~hits.is_back | self.is_candidate[surface]) & (weight > 0)
            hits, path, weight = hits[goes_on], path[goes_on], weight[goes_on]
            corner = self.V[self.F[hits.face]]
            a, b = hits.a[:, None].astype(np.float64), hits.b[:, None].astype(np.float64)
            x = corner[:, 0] + a * (corner[:, 1] - corner[:, 0]) + b * (corner[:, 2] - corner[:, 0])
            N = _normals(corner)[0] * np.where(hits.is_back, -1.0, 1.0)[:, None]
        return H

    def _direct(self, x, N, rng):
        """Irradiance at x from one point of the lamps, chosen by their power."""
        n, lamps = len(x), self.lamps
        chosen, place = rng.random(n), rng.random((2, n))
        seen, arrives = np.empty(n, dtype=np.int64), np.empty(n)
        origins, D = np.empty((2, n, 3), dtype=np.float32)
        lamps = lamps.corner, lamps.normal, lamps.area, lamps.share, lamps.power
        count = _towards_lamps(*lamps, x, N, chosen, place, seen, arrives, origins, D)
        free = ~self.tracer.is_blocked(origins[:count], D[:count])
        H = np.zeros(n)
        H[seen[:count][free]] = arrives[:count][free]
        return H


@compiled("f8[:,:,:], f8[:,:], f8[:], f8[:], f8, f8[:,:], f8[:,:], f8[:], f8[:,:], i8[:], f8[:], f4[:,:], f4[:,:]")
def _towards_lamps(corner, normal, area, share, power, x, N, chosen, place, seen, H, origins, D):
    """What each of x (m, 3) gets on the side of N (m, 3) from a point of the lamps, if nothing stands between.

    corner, normal, area, share, power : as in _Lamps;  chosen (m,), place (2, m) : numbers of [0, 1) that choose the
    triangle and the point of it
    seen (m,), H (m,), origins, D (m, 3) : of those that face each other, one after the other, their numbers, irradiance
    and ray to the lamp's point; returns how many
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
            seen[count], H[count] = i, power * (leaving * arriving / r2) / (math.pi * r2 + area[k])
            origins[count, 0], origins[count, 1], origins[count, 2] = x[i, 0], x[i, 1], x[i, 2]
            D[count, 0], D[count, 1], D[count, 2] = dx, dy, dz
            count += 1
    return count
