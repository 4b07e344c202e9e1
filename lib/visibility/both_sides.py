"""Which open sheets get light on both sides: a small path tracing from places on them.

The estimate (lib.visibility.paths) is coarse; the question is only whether a side is dark.
"""

from functools import cache

import numpy as np

from lib import forks
from lib.nurbs.facets import normals
from lib.visibility.paths import Room, by_place, lamps_of
from lib.visibility.tracer import Tracer

PLACES = 256  # of a side: light that enters a crack along the border reaches too few to count
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
    power = np.asarray(E, dtype=np.float64).max(axis=1, keepdims=True)
    rho, candidates = np.asarray(rho, dtype=np.float64)[:, None], np.asarray(candidates, dtype=np.int64)
    light = np.zeros((len(power), 2))
    order, sheets = _sheets(V, F, face_surface, candidates)
    lamps = lamps_of(V, F, face_surface, power)
    if not len(order) or not len(lamps.share):
        return light

    back_rho = np.zeros_like(rho)
    back_rho[candidates] = rho[candidates]

    @cache
    def room():  # of each process: a tracer that a fork has from its parent can not be used
        return Room(V, F, face_surface, rho, back_rho, lamps, Tracer(V, F))

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


def _sheets(V, F, face_surface, candidates):
    """Candidates with an area in the order of their places (c,), and their faces (k,) with areas summed up, each
    candidate's to 1: candidate i owns (i, i + 1].
    """
    face = np.flatnonzero(np.isin(face_surface, candidates))
    area = normals(*V[F[face]].swapaxes(0, 1))[1]
    face, area = face[area > 0], area[area > 0]
    surface, first, row = np.unique(face_surface[face], return_index=True, return_inverse=True)
    order = by_place(V, F[face[first]])
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
    return _points(corner, rng), normals(*corner.swapaxes(0, 1))[0]


def _points(corner, rng):
    """A uniform point (k, 3) of each triangle (k, 3, 3)."""
    a, b = rng.random((2, len(corner)))
    over = a + b > 1
    a, b = np.where(over, 1 - a, a)[:, None], np.where(over, 1 - b, b)[:, None]
    return corner[:, 0] + a * (corner[:, 1] - corner[:, 0]) + b * (corner[:, 2] - corner[:, 0])
