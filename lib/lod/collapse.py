"""The order in which a mesh loses its vertices, and what is left of it after any number of steps.

fast_simplification collapses edges in the order of their quadric errors (Garland, Heckbert 1997) and says which
vertex went into which.  Run once to the end, every coarser mesh is a prefix of that list, and each of its triangles
descends from a given one, from which the library turns it by less than 80 degrees.  Three kinds of triangles are added
before, and make it keep what it knows nothing of:

- skirts: along every seam and border, a triangle perpendicular to the surface, so that vertices stay on the line;
- locks: where seams meet or end, two triangles that hold the vertex in all directions;
- tags: at every vertex a triangle of its own that touches nothing else.  Its edges have one user, so the vertex counts
  as a border vertex, and merged vertices go to one of the two places or halfway between.  Otherwise the library takes
  the place where the quadric is least, by determinants without any tolerance: on a plane that is not parallel to the
  axes these are rounding errors (version 0.2.0: a plane of 7200 triangles keeps 2800, however few are asked for).

Their far corners collapse into the vertex at no cost, the planes remain in its quadric.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lib.lod import collapse_kernels as kernels

FAR = 10.0  # frames, to the corners of added triangles: the way to them costs more than any collapse
TILT = 1e-5  # of a tag against the surface, so that its far corner is not as good a place as the vertex
SCALE = 1000.0  # units a frame: the library's thresholds are then distances of 3e-6 to 3 frames
AGGRESSIVENESS = 8.0  # thresholds grow like that power of the round, of which there are 100
SKIRTS = 3  # at each side of an edge; with 1 or 8 textures slide farther on the teapot at 2 % of its triangles


@dataclass(frozen=True)
class Added:
    """A mesh with its added triangles: P (p, 3) positions, those of the mesh first; T (t, 3) int32, likewise."""

    P: np.ndarray
    T: np.ndarray


@dataclass(frozen=True)
class History:
    """c collapses of a mesh of n vertices, m triangles.

    pair (c, 2) the vertex that stays, and the one that goes into it; at (c, 3) where the vertex is then, in the unit of
    the mesh; death (m,) the step in which each triangle vanishes, c if never
    """

    n: int
    pair: np.ndarray
    at: np.ndarray
    death: np.ndarray

    @cached_property
    def _gone(self):
        """(time (n,), into (n,)): the step in which a vertex goes, c if never, and where it goes."""
        return _gone(self.n, self.pair)

    def counts(self):
        """(c + 1,) triangles left after k steps."""
        return len(self.death) - np.searchsorted(np.sort(self.death), np.arange(len(self.pair) + 1))

    def roots(self, k):
        """(n,) the vertex that each has gone into after k steps."""
        time, into = self._gone
        root = np.where(time < k, into, np.arange(self.n))
        while True:
            further = root[root]
            if (further == root).all():
                return root
            root = further

    def places(self, V, k):
        """(n, 3) positions after k steps of a mesh with the positions V (n, 3); only roots count."""
        last = np.full(self.n, -1)
        last[self.pair[:k, 0]] = np.arange(k)  # of a repeated index the last value stays
        out = V.copy()
        moved = last >= 0
        out[moved] = self.at[last[moved]]
        return out


def with_added(V, F, seam, seam_face, locked):
    """The Added of V (n, 3) of size about 1, F (m, 3).

    seam (s, 2) : edges that vertices shall stay on, seam_face (s,) the triangle on the side it is seen from
    locked (l,) : vertices that shall stay
    """
    n = len(V)
    e, g = V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]
    face = _unit(np.cross(e, g))
    N = np.zeros_like(V)
    kernels.sum_at_corners(F.astype(np.int32), face, N)
    N = _unit(N)
    a = _unit(np.cross(N, np.eye(3)[np.abs(N).argmin(axis=1)]))
    b = np.cross(N, a)
    numbers = np.arange(n)
    P, T, count = [V], [F], n
    for vertices, x, y in (
        (numbers, a + TILT * N, b),
        (locked, N[locked], a[locked]),
        (locked, N[locked], b[locked]),
    ):
        far = count + np.arange(2 * len(vertices)).reshape(2, -1)
        P += [V[vertices] + FAR * x, V[vertices] + FAR * y]
        T.append(np.stack([vertices, far[0], far[1]], axis=1))
        count += far.size
    P.append(V[seam].mean(axis=1) + FAR * face[seam_face])
    T += SKIRTS * [np.concatenate([seam, count + np.arange(len(seam))[:, None]], axis=1)]
    return Added(np.concatenate(P) * SCALE, np.concatenate(T).astype(np.int32))


def history(V, F, added, pair):
    """The History of the collapses `pair` (c, 2) of an Added of V (n, 3), F (m, 3), of the mesh's own vertices alone.

    It ends before the first step that would take a vertex of the mesh to a far corner.
    """
    pair = np.ascontiguousarray(pair, dtype=np.int64).reshape(-1, 2)
    own, at, is_sound = _replayed(V, added, pair)
    is_kept = is_sound.cumprod(dtype=bool) & (own >= 0).all(axis=1)
    own, at = own[is_kept], at[is_kept]
    return History(len(V), own, at, _deaths(F, *_gone(len(V), own), len(own)))


def _gone(n, pair):
    time, into = np.full(n, len(pair)), np.arange(n)
    time[pair[:, 1]], into[pair[:, 1]] = np.arange(len(pair)), pair[:, 0]
    return time, into


def _deaths(F, time, into, c):
    """(m,) the step in which two corners of a triangle first are one vertex."""
    death = np.full(len(F), c)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, b, left = F[:, i].astype(np.int64), F[:, j].astype(np.int64), np.arange(len(F))
        # Follow the end that goes first until both are the same.
        while left.size:
            step = np.minimum(time[a[left]], time[b[left]])
            left, step = left[step < c], step[step < c]
            goes = time[a[left]] == step
            a[left[goes]], b[left[~goes]] = into[a[left[goes]]], into[b[left[~goes]]]
            met = a[left] == b[left]
            death[left[met]] = np.minimum(death[left[met]], step[met])
            left = left[~met]
    return death


def _replayed(V, added, pair):
    """(own (c, 2), at (c, 3) in the unit of V, is_sound (c,)): the mesh's own vertices that each collapse joins, -1
    for none, and where the library puts the vertex.

    It does not say, and its own replay_simplification takes 40 s for 331 k triangles; what it does is
    `calculate_error` of its Simplify.h for two border vertices: the best of the two ends and the middle.
    """
    Q, X = _quadrics(added), added.P.copy()
    Y = np.zeros_like(X)
    Y[: len(V)] = V
    stands = np.where(np.arange(len(X)) < len(V), np.arange(len(X)), -1)  # for which of the mesh's own
    own, at, is_sound = np.empty_like(pair), np.empty((len(pair), 3)), np.empty(len(pair), dtype=bool)
    kernels.replay(pair, Q, X, Y, stands, own, at, is_sound)
    return own, at, is_sound


def _quadrics(added):
    """(p, 10) sums of the planes of the triangles around each vertex, every triangle with weight 1."""
    A, B, C = (added.P[added.T[:, k]] for k in range(3))
    n = np.cross(B - A, C - A)
    n /= np.sqrt((n * n) @ np.ones(3))[:, None]
    (a, b, c), d = n.T, -(n * A).sum(axis=1)
    planes = np.stack([a * a, a * b, a * c, a * d, b * b, b * c, b * d, c * c, c * d, d * d], axis=1)
    Q = np.zeros((len(added.P), 10))
    kernels.sum_at_corners(added.T, planes, Q)
    return Q


def _unit(vectors):
    """Unit vectors (k, 3); x where there is no direction."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 0, vectors / np.maximum(length, 1e-300), [1.0, 0.0, 0.0])
