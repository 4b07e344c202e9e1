"""The uniform lattice of samples on a surface's (u, v): crossings of lines, borders included.

A surface has roots n_u x n_v; level l has n_u 2^l + 1 by n_v 2^l + 1 crossings.  Arrays are indexed [j, i], row j is
v = j / (h - 1).
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs.evaluate import frame, frame_grid
from lib.surfaces import frames

MOST_ROOTS = 8
INSIDE = 0.002  # border samples are evaluated this far inside: on an edge shared by walls half the hemisphere is wall
OFFSET = 7e-5  # in units of the scene's largest side: beyond float32 rounding of a ray's origin
POLE_DIRECTIONS = (np.arange(8) + 0.5) / 8


def roots_of(extent):
    """Root cells (n_u, n_v): 1 along the shorter side, the rounded aspect ratio, at most 8, along the longer.

    >>> roots_of((6.0, 2.9)), roots_of((1.0, 100.0)), roots_of((0.0, 1.0))
    ((2, 1), (1, 8), (1, 8))
    """
    u, v = extent
    if u >= v:
        return (int(min(MOST_ROOTS, max(1, round(u / v)))) if v > 0 else MOST_ROOTS), 1
    return 1, (int(min(MOST_ROOTS, max(1, round(v / u)))) if u > 0 else MOST_ROOTS)


@dataclass(frozen=True)
class Lattice:
    """Topology of one surface's lattice: roots (n_u, n_v), closed (u, v), collapsed sides (u=0, u=1, v=0, v=1)."""

    roots: tuple
    closed: tuple = (False, False)
    collapsed: tuple = (False, False, False, False)

    def shape(self, level):
        """(h, w) of the lattice at a level."""
        return self.roots[1] * 2**level + 1, self.roots[0] * 2**level + 1

    def cells(self, level):
        """(rows, columns) of cells at a level."""
        return self.roots[1] * 2**level, self.roots[0] * 2**level

    def is_own(self, level):
        """(h, w) bool: crossings that are samples of their own, not copies across a seam or along a collapsed side."""
        shape = self.shape(level)
        own = np.ones(shape, dtype=bool)
        if self._repeats:
            own[self._copies(shape)[0]] = False
        return own

    def copy_own(self, array):
        """Copy samples to the crossings that repeat them, in place; returns array (h, w, ...)."""
        if self._repeats:
            copy, source = self._copies(array.shape[:2])
            array[copy] = array[source]
        return array

    def share_own(self, flags):
        """Crossings that repeat each other are flagged (h, w) together, in place, if one of them is; returns flags."""
        if self._repeats:
            copy, source = self._copies(flags.shape)
            np.logical_or.at(flags, source, flags[copy])
            flags[copy] = flags[source]
        return flags

    @property
    def _repeats(self):
        return any(self.closed) or any(self.collapsed)

    def _copies(self, shape):
        """Crossings that repeat another, and which: two (j, i).  Of all crossings at one point the first in the array
        counts.
        """
        source = np.arange(shape[0] * shape[1]).reshape(shape)
        sides = source[:, 0], source[:, -1], source[0], source[-1]
        for _ in range(3):  # seams and poles that meet in corners hand the first on from side to side
            for is_closed, (first, last) in zip(self.closed, (sides[:2], sides[2:]), strict=True):
                if is_closed:
                    first[:] = last[:] = np.minimum(first, last)
            for is_collapsed, side in zip(self.collapsed, sides, strict=True):
                if is_collapsed:
                    side[:] = side.min()
        copy = np.nonzero(source != np.arange(source.size).reshape(shape))
        return copy, np.divmod(source[copy], shape[1])


def receivers(surface, flip, lift, lattice, level, j, i, domain=None):
    """Ray origins and normals of lattice crossings.

    j, i (m,) crossings of `level`.  lift: distance between the surface and its mesh, OFFSET is added.
    domain : Domain of a surface that does not fill its map: crossings outside are taken at the nearest place inside.
    Returns x (m, 3) float64 lifted off along N, N (m, 3) float64 unit, on the side that receives.
    """
    h, w = lattice.shape(level)
    j, i = np.asarray(j), np.asarray(i)
    u, v, pole = _parameters(lattice, j, i, h, w)
    nurbs = frames.whole(surface)
    if domain is not None:
        places = domain.locate(np.stack([u, v], axis=1))
        pole &= places.is_inside
        S, N = frames.frame(surface, places.uv, places.face)
    elif len(j) * 4 >= h * w and not any(lattice.collapsed):
        # Most of the lattice: evaluate it as a tensor grid.
        S, N = _grid(nurbs, lattice, h, w)
        S, N = S[j, i], N[j, i]
    else:
        S, N = frame(nurbs, u, v)
    for k in np.flatnonzero(pole):
        N[k] = _pole_normal(nurbs, lattice, u[k], v[k])
    N = -N if flip else N
    return S + N * (lift + OFFSET), N


def _grid(surface, lattice, h, w):
    middle_j, middle_i = np.full(w, h // 2), np.full(h, w // 2)
    u = _parameters(lattice, middle_j, np.arange(w), h, w)[0]
    v = _parameters(lattice, np.arange(h), middle_i, h, w)[1]
    return frame_grid(surface, u, v)


def _parameters(lattice, j, i, h, w):
    """u, v of crossings, a little inside open borders, and which of them are poles of closed surfaces."""
    u, v = i / (w - 1), j / (h - 1)
    on = (i == 0, i == w - 1, j == 0, j == h - 1)
    collapsed = [on[k] & lattice.collapsed[k] for k in range(4)]
    pole = np.zeros(np.shape(u), dtype=bool)
    if lattice.closed[1]:
        pole |= collapsed[0] | collapsed[1]
    if lattice.closed[0]:
        pole |= collapsed[2] | collapsed[3]
    # A collapsed side of an open surface (a triangle's corner) is seen from the middle of the side.
    u = np.where((collapsed[2] | collapsed[3]) & ~pole, 0.5, u)
    v = np.where((collapsed[0] | collapsed[1]) & ~pole, 0.5, v)
    if not lattice.closed[0]:
        u = np.where(pole, u, np.clip(u, INSIDE, 1 - INSIDE))
    if not lattice.closed[1]:
        v = np.where(pole, v, np.clip(v, INSIDE, 1 - INSIDE))
    return u, v, pole


def _pole_normal(surface, lattice, u, v):
    """Mean of the limits around the pole: the axis of a cone, the normal of a smooth cap."""
    around_u = POLE_DIRECTIONS if lattice.closed[0] else np.full(8, u)
    around_v = POLE_DIRECTIONS if lattice.closed[1] else np.full(8, v)
    N = frame(surface, around_u, around_v)[1].sum(axis=0)
    length = np.linalg.norm(N)
    return N / length if length > 1e-6 else frame(surface, np.array([u]), np.array([v]))[1][0]
