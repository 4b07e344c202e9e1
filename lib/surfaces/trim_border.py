"""The borders of many trimmed surfaces: which points are one, which edges they make, which a tolerance keeps.

A decision about a point is kept by position, never by face, so that all faces that share an edge keep the same points.
"""

from dataclasses import dataclass

import numpy as np

from lib.surfaces.loops import following
from lib.surfaces.rows import numbered

SHAPE = 0.15  # of an edge's length: points that stand out by more are kept, so that arcs and rings stay recognisable

LESS, LOWER = 0.9, (0.2, 0.7)  # of the share of its tolerance that an edge needs, and what is taken at once


@dataclass(frozen=True)
class Borders:
    """Border points of n trimmed surfaces, packed surface after surface.

    start (n + 1,) int64 : surface s owns the rows start[s] to start[s + 1]
    place (k,) int64     : number of the position; points equal bit for bit have the same
    edge (k,) int64      : number of the edge the point is on or begins; each face's use of an edge has its own
    after (k,) int64     : row of the next point round the loop
    significance (k,)    : as the surfaces have it
    cap (places,)        : tolerance above which none is applied to a position
    """

    start: np.ndarray
    place: np.ndarray
    edge: np.ndarray
    after: np.ndarray
    significance: np.ndarray
    cap: np.ndarray

    def tolerances(self, tolerance):
        """The tolerance of every position (places,): the least of the surfaces (n,) that have it, and its cap."""
        out = self.cap.copy()
        np.minimum.at(out, self.place, np.repeat(tolerance, np.diff(self.start)))
        return out

    def kept(self, at_place):
        """(k,) bool: the points kept with the tolerances of the positions (places,)."""
        return self.significance > at_place[self.place]

    def lowered(self, at_place, unfit):
        """The tolerances (places,) with those of the inner points of edges lowered; unfit : pairs of edges (e,) and
        the share of the tolerance they need, of which a little less than most is taken.
        """
        factor = np.ones(len(at_place))
        inner = np.isfinite(self.significance)
        for edges, share in unfit:
            rows = np.isin(self.edge, edges) & inner
            np.minimum.at(factor, self.place[rows], np.clip(LESS * share, *LOWER))
        return at_place * factor


def borders(surfaces):
    """The Borders of TrimmedSurfaces, whose corners have significance inf."""
    S = np.concatenate([s.S for s in surfaces])
    start = np.concatenate([[0], np.cumsum([len(s.S) for s in surfaces])]).astype(np.int64)
    loops = np.concatenate([s.loop_start[:-1] + first for s, first in zip(surfaces, start, strict=False)])
    after = following(np.append(loops, start[-1]))
    significance = np.concatenate([s.significance for s in surfaces])
    place, _ = numbered(S)
    edge = _edges(significance, loops, len(S))
    length = np.bincount(edge, np.linalg.norm(S[after] - S, axis=1))
    cap = np.full(place.max(initial=-1) + 1, np.inf)
    np.minimum.at(cap, place, SHAPE * length[edge])
    return Borders(start, place, edge, after, significance, cap)


def _edges(significance, loops, n):
    """The edge (n,) that each point begins or lies on: those between two corners, round the loops that start there."""
    corner = np.isinf(significance)
    edge = np.cumsum(corner | np.isin(np.arange(n), loops)) - 1
    for first, end in zip(loops, [*loops[1:], n], strict=True):
        own = np.flatnonzero(corner[first:end])
        if own.size and own[0] > 0:  # what comes before the first corner belongs to the last edge
            edge[first : first + own[0]] = edge[end - 1]
    return np.unique(edge, return_inverse=True)[1].ravel()
