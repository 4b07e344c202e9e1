"""Direct light at points: form factor times the visible share of each emitter, by shadow rays to points on it.

For emitter l, points y_k on it, D_k = y_k - x, g_k = cos cos' / r^2, V_k = 1 where not blocked:

    H_l = E_l F_l (sum g_k V_k) / (sum g_k)

The ratio is exact where all V_k = 1.  Points lie on the facets in proportion to their form factors, so w_k = g_k /
density stands for g_k. If the first n0 points agree they decide; otherwise n1 are taken.
"""

from dataclasses import dataclass

import numpy as np

from lib.radiosity import direct_kernels as kernels
from lib.radiosity.form_factors import form_factor_facets
from lib.visibility.qmc import r2
from lib.visibility.tracer import REACH

DIM = 1e-3  # emitters that together add less than this share of the light found at a sample count as unblocked
NOISE = 0.7  # standard error of the visible share over sqrt(V (1 - V)) n^-0.75, for n points of an additive recurrence
BATCH, PAIRS = 4096, 1 << 21  # samples at once, and pairs of these and facets of emitters


@dataclass(frozen=True)
class DirectLight:
    """H (n, G, 3) float32 irradiance; noise (n,) float32 its standard error, > 0 where an emitter is partly blocked;
    pairs (sample, emitter) that needed none: below the horizon, and dim."""

    H: np.ndarray
    noise: np.ndarray
    below_horizon: int
    dim: int
    agreed: int


def direct_light(x, N, shift, emitters, n_groups, tracer, face_surface, n0, n1):
    """Irradiance from all emitters at points.

    Parameters
    ----------
    x : (n, 3) ray origins, already lifted off their surface; N (n, 3) unit normals
    shift : (n, 2) Cranley-Patterson rotations
    emitters : Emitters; n_groups : G
    tracer : Tracer; face_surface (m,) surface of each of its faces
    n0, n1 : shadow rays per emitter, first and at most
    """
    n, L = len(x), len(emitters.E)
    H = np.zeros((n, n_groups, 3))
    noise = np.zeros(n)
    counts = np.zeros(3, dtype=np.int64)
    points = r2(n1)
    at_once = min(BATCH, max(1, PAIRS // max(len(emitters.facets.area), 1)))
    x, N, shift = (np.ascontiguousarray(array, dtype=np.float64) for array in (x, N, shift))
    for first in range(0, n if L else 0, at_once):
        part = slice(first, first + at_once)
        probe = _Probe(x[part], N[part], shift[part], emitters, tracer, face_surface)
        H[part], noise[part], spared = _batch(probe, points, emitters, n_groups, n0)
        counts += spared
    return DirectLight(H.astype(np.float32), noise.astype(np.float32), *(int(c) for c in counts))


def _batch(probe, points, emitters, n_groups, n0):
    F_emitter = np.add.reduceat(probe.F, emitters.first[:-1], axis=1)
    m, L = F_emitter.shape
    row = np.arange(m)
    light = F_emitter * emitters.E.sum(axis=1)
    # Take the emitters in falling order of their light at each sample.
    order = np.argsort(-light, axis=1, kind="stable")
    rest = np.cumsum(np.take_along_axis(light, order, axis=1)[:, ::-1], axis=1)[:, ::-1]
    H = np.zeros((m, n_groups, 3))
    found, variance = np.zeros(m), np.zeros(m)
    dim = agreed = 0
    for rank in range(L):
        l = order[:, rank]
        lit = light[row, l] > 0
        if not lit.any():
            break
        V = np.ones(m)
        is_dim = lit & (rest[:, rank] < DIM * found)
        dim += int(is_dim.sum())
        asked = np.flatnonzero(lit & ~is_dim)
        V[asked], partly = _visible_share(probe, asked, l[asked], points, n0)
        largest = emitters.E[l[asked]].max(axis=1) * F_emitter[row[asked], l[asked]]
        variance[asked] += (
            np.where(partly, (NOISE * largest) ** 2 * V[asked] * (1 - V[asked]), 0.0) / len(points) ** 1.5
        )
        agreed += int((~partly).sum())
        V[~lit] = 0.0
        share = F_emitter[row, l] * V
        H[row, emitters.group[l]] += emitters.E[l] * share[:, None]
        found += light[row, l] * V
    return H, np.sqrt(variance), np.array([int((light <= 0).sum()), dim, agreed])


def _visible_share(probe, asked, l, points, n0):
    """Weighted share of emitter l (k,) that each of the samples `asked` (k,) sees, and whether it is partial."""
    seen, total = probe.sums(asked, l, points[:n0])
    partly = (seen > 0) & (seen < total)
    again = np.flatnonzero(partly)
    if again.size and len(points) > n0:
        more = probe.sums(asked[again], l[again], points[n0:])
        seen[again] += more[0]
        total[again] += more[1]
    missed = np.flatnonzero(total <= 0)
    if missed.size:
        seen[missed], total[missed] = probe.sees_highest_corner(asked[missed], l[missed]), 1.0
    return seen / total, partly


class _Probe:
    """Shadow rays from a batch of samples x, N (m, 3), shift (m, 2); F (m, facets) their form factors to the facets of
    all emitters, by which points on them are chosen."""

    def __init__(self, x, N, shift, emitters, tracer, face_surface):
        self._x, self._N, self._shift, self._emitters = x, N, shift, emitters
        self._tracer, self._face_surface = tracer, face_surface
        facets = emitters.facets
        self.F = form_factor_facets(x, N, facets) * facets.weight
        self._choice = self.F, np.cumsum(self.F, axis=1), emitters.first
        lines = (np.ascontiguousarray(a) for a in (facets.origin, facets.e1, facets.e2, facets.normal))
        alike = bool((np.diff(emitters.first) == 1).all())
        self._facets = *lines, facets.is_triangle, facets.area * facets.weight, alike

    def sums(self, asked, l, points):
        """Sums of w_k V_k and of w_k over the points (p, 2), each (k,): seen, total."""
        most = len(asked) * len(points)
        origins, D = np.empty((most, 3), dtype=np.float32), np.empty((most, 3), dtype=np.float32)
        w, pair = np.empty(most), np.empty(most, dtype=np.int64)
        samples = self._x, self._N, self._shift, np.ascontiguousarray(points), asked, l
        n = kernels.shadow_rays(*samples, *self._choice, *self._facets, origins, D, w, pair)
        seen, total = np.zeros(len(asked)), np.zeros(len(asked))
        blocked = self._is_blocked(origins[:n], D[:n], l, pair[:n])
        kernels.seen_and_total(w, pair, blocked, seen, total)
        return seen, total

    def sees_highest_corner(self, asked, l):
        """1 or 0 for samples with so little of their emitter above the horizon that none of the points on it was."""
        D = np.empty((len(asked), 3), dtype=np.float32)
        kernels.to_highest_corners(self._x, self._N, asked, l, *self._choice, self._emitters.facets.corners(), D)
        return ~self._is_blocked(self._x[asked].astype(np.float32), D, l, np.arange(len(asked)))

    def _is_blocked(self, origins, D, l, pair):
        """A curved emitter's own mesh stands before its facets: meeting its lit side first is seeing it."""
        tracer, emitters = self._tracer, self._emitters
        if not emitters.is_curved.any() or not len(self._face_surface):
            return tracer.is_blocked(origins, D)
        l = l[pair]
        curved = emitters.is_curved[l]
        blocked = np.zeros(len(D), dtype=bool)
        blocked[~curved] = tracer.is_blocked(origins[~curved], D[~curved])
        hits = tracer.closest(origins[curved], D[curved], reach=REACH)
        is_own = (self._face_surface[hits.face] == emitters.surface[l[curved]]) & ~hits.is_back
        blocked[curved] = (hits.face >= 0) & ~is_own
        return blocked
