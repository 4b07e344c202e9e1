"""Direct light at points: form factor times the visible share of each emitter, by shadow rays to points on it.

For emitter l, points y_k on it, D_k = y_k - x, g_k = cos cos' / r^2, V_k = 1 where not blocked:

    H_l = E_l F_l (sum g_k V_k) / (sum g_k)

The ratio is exact where all V_k = 1.  Points lie on the facets in proportion to their form factors, so w_k = g_k /
density stands for g_k. If the first n0 points agree they decide; otherwise n1 are taken.
"""

from dataclasses import dataclass

import numpy as np

from lib.radiosity.form_factors import form_factor_facets
from lib.visibility.qmc import r2

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
    for first in range(0, n if L else 0, at_once):
        part = slice(first, first + at_once)
        H[part], noise[part], spared = _batch(
            x[part], N[part], shift[part], points, emitters, n_groups, tracer, face_surface, n0
        )
        counts += spared
    return DirectLight(H.astype(np.float32), noise.astype(np.float32), *(int(c) for c in counts))


def _batch(x, N, shift, points, emitters, n_groups, tracer, face_surface, n0):
    m, L = len(x), len(emitters.E)
    row = np.arange(m)
    F = form_factor_facets(np.asarray(x, dtype=np.float64), N, emitters.facets) * emitters.facets.weight
    F_emitter = np.add.reduceat(F, emitters.first[:-1], axis=1)
    light = F_emitter * emitters.E.sum(axis=1)
    # Take the emitters in falling order of their light at each sample.
    order = np.argsort(-light, axis=1, kind="stable")
    rest = np.cumsum(np.take_along_axis(light, order, axis=1)[:, ::-1], axis=1)[:, ::-1]
    walk = _FacetChoice(F, F_emitter, emitters)
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
        V[asked], partly = _visible_share(
            x[asked], N[asked], shift[asked], l[asked], asked, points, n0, walk, emitters, tracer, face_surface
        )
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


def _visible_share(x, N, shift, l, row, points, n0, walk, emitters, tracer, face_surface):
    """Weighted share of emitter l (k,) that each point sees, and whether it is partial."""
    seen, total = _probe(x, N, shift, l, row, points[:n0], walk, emitters, tracer, face_surface)
    partly = (seen > 0) & (seen < total)
    again = np.flatnonzero(partly)
    if again.size and len(points) > n0:
        more = _probe(
            x[again], N[again], shift[again], l[again], row[again], points[n0:], walk, emitters, tracer, face_surface
        )
        seen[again] += more[0]
        total[again] += more[1]
    missed = np.flatnonzero(total <= 0)
    if missed.size:
        rest = row[missed], l[missed], walk, emitters, tracer, face_surface
        seen[missed], total[missed] = _sees_highest_corner(x[missed], N[missed], *rest), 1.0
    return seen / total, partly


def _sees_highest_corner(x, N, row, l, walk, emitters, tracer, face_surface):
    """1 or 0 for points with so little of their emitter above the horizon that none of the points on it was."""
    facet = walk.choose(row, l, np.full((len(x), 1), 0.5))[0][:, 0]
    corners = emitters.facets.corners()[facet] - x[:, None]
    highest = np.einsum("kpc,kc->kp", corners, N).argmax(axis=1)
    D = corners[np.arange(len(x)), highest].astype(np.float32)
    return ~_is_blocked(np.ascontiguousarray(x, dtype=np.float32), D, l, emitters, tracer, face_surface)


def _probe(x, N, shift, l, row, points, walk, emitters, tracer, face_surface):
    """Sums of w_k V_k and of w_k over the points, each (k,)."""
    facets = emitters.facets
    p = points[None] + shift[:, None]
    p -= p >= 1
    facet, a = walk.choose(row, l, p[..., 0])
    b = p[..., 1]
    over = facets.is_triangle[facet] & (a + b > 1)
    a, b = np.where(over, 1 - a, a)[..., None], np.where(over, 1 - b, b)[..., None]
    D = (facets.origin[facet] - x[:, None] + a * facets.e1[facet] + b * facets.e2[facet]).astype(np.float32)
    r2_ = np.einsum("kpc,kpc->kp", D, D)
    cos_x = np.einsum("kpc,kc->kp", D, N.astype(np.float32))
    cos_y = -np.einsum("kpc,kpc->kp", D, facets.normal.astype(np.float32)[facet])
    w = np.where((cos_x > 0) & (cos_y > 0), cos_x * cos_y / np.maximum(r2_ * r2_, 1e-30), 0.0) * walk.inverse_density(
        row, l, facet
    )
    cast = w > 0
    blocked = np.zeros(w.shape, dtype=bool)
    origins = np.repeat(np.ascontiguousarray(x, dtype=np.float32), len(points), axis=0)[cast.ravel()]
    blocked[cast] = _is_blocked(
        origins, D[cast], np.broadcast_to(l[:, None], w.shape)[cast], emitters, tracer, face_surface
    )
    return np.where(blocked, 0.0, w).sum(axis=1), w.sum(axis=1)


def _is_blocked(origins, D, l, emitters, tracer, face_surface):
    """A curved emitter's own mesh stands before its facets: meeting its lit side first is seeing it."""
    curved = emitters.is_curved[l]
    if not curved.any() or not len(face_surface):
        return tracer.is_blocked(origins, D)
    blocked = np.zeros(len(D), dtype=bool)
    blocked[~curved] = tracer.is_blocked(origins[~curved], D[~curved])
    hits = tracer.closest(origins[curved], D[curved], reach=0.9995)
    is_own = (face_surface[hits.face] == emitters.surface[l[curved]]) & ~hits.is_back
    blocked[curved] = (hits.face >= 0) & ~is_own
    return blocked


class _FacetChoice:
    """Chooses facets of an emitter with probability F_facet / F_emitter, reusing the rest of the random number."""

    def __init__(self, F, F_emitter, emitters):
        self._F, self._F_emitter, self._first = F, F_emitter, emitters.first
        self._area = emitters.facets.area * emitters.facets.weight
        self._is_single = bool((np.diff(emitters.first) == 1).all())
        if not self._is_single:
            # Every row's running sum, scaled to [0, 1] and shifted by the row's number: one sorted list to search in.
            running = np.cumsum(F, axis=1)
            self._total = np.maximum(running[:, -1:], 1e-300)
            self._before = (running - F) / self._total
            self._sorted = (running / self._total + 2 * np.arange(len(F))[:, None]).ravel()

    def choose(self, row, l, p):
        """Facet (k, n) and the number left over (k, n), from numbers p (k, n) in [0, 1)."""
        if self._is_single:
            return np.broadcast_to(self._first[l][:, None], p.shape), p
        low = self._before[row, self._first[l]][:, None]
        target = low + p * (self._F_emitter[row, l][:, None] / self._total[row])
        n_facets = self._F.shape[1]
        facet = np.searchsorted(self._sorted, target + 2 * row[:, None], side="right") - row[:, None] * n_facets
        facet = np.clip(facet, self._first[l][:, None], self._first[l + 1][:, None] - 1)
        width = self._F[row[:, None], facet] / self._total[row]
        left = np.where(width > 0, (target - self._before[row[:, None], facet]) / np.where(width > 0, width, 1.0), 0.5)
        return facet, np.clip(left, 0.0, 1 - 1e-9)

    def inverse_density(self, row, l, facet):
        """Area of the facet over the probability of choosing it: what turns g into w; 1 for single facets (it
        cancels).
        """
        if self._is_single:
            return 1.0
        F = self._F[row[:, None], facet]
        return np.where(F > 0, self._area[facet] * self._F_emitter[row, l][:, None] / np.where(F > 0, F, 1.0), 0.0)
