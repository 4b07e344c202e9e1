"""Indirect light at points: one final gather through the coarse solution.

    H_indirect(x) = 1/K sum over K cosine rays of  rho_s [H_indirect(s, u, v) + H_direct(s, u, v)]  at the hit

Two-pass radiosity (Lischinski et al. 1993): H_direct from the fine direct maps, H_indirect from the elements; never
emission; nothing from misses, back faces and surfaces without elements.

A hit nearer than the elements there are wide can not be told from its neighbours by them: near a contact they know
only the mean of what is lit and what is not.  There one more cosine ray stands for H_indirect, and so on while hits
stay near (Jensen 1996, final gathering).
"""

from dataclasses import dataclass

import numpy as np

from lib.elements.grids import POINTS, at_centres
from lib.elements.lattice import OFFSET
from lib.visibility.hemisphere import cosine_direction_each, cosine_directions
from lib.visibility.hidden import is_hidden
from lib.visibility.qmc import fibonacci, path_coordinates

RAYS_AT_ONCE = 16384  # what is gathered stays in the cache
NEAR = 2.0  # hits nearer than this many element widths are followed on
MOST_STEPS = 4  # in a narrow gap
NOISE = 1.35  # measured: standard error of K rays over their standard deviation / K^0.8


@dataclass(frozen=True)
class RadiosityMap:
    """Reflected radiosity of one surface for lookups: value (h, w, C) float32 of all light, direct (h, w, C) of
    direct light alone, weight (h, w), 0 where hidden; rho (C,); width, mean side of its elements in the scene's
    frame."""

    value: np.ndarray
    direct: np.ndarray
    weight: np.ndarray
    rho: np.ndarray
    width: float


def radiosity_map(H_direct, hidden, H_element, points_hidden, is_alone, grid, rho, closed, area):
    """rho (H_direct + H_indirect) on the lattice of a direct map.

    H_direct (h, w, G, 3), hidden (h, w); H_element (n_v n_u, G, 3) indirect, points_hidden (n_v n_u, 16), is_alone
    (n_v n_u,) whether the element is looked up without its neighbours; grid (n_u, n_v), rho (3,), area of the surface
    in the scene's frame.
    """
    h, w, G = H_direct.shape[:3]
    u, v = np.linspace(0, 1, w), np.linspace(0, 1, h)
    H_element, share = H_element.reshape(len(H_element), -1), (~points_hidden).mean(axis=1)
    indirect = at_centres(H_element, share * ~is_alone, *grid, u, v, closed)
    if is_alone.any():
        (j, b), (i, a) = _cells_of(v, grid[1]), _cells_of(u, grid[0])
        element, point = j[:, None] * grid[0] + i, b[:, None] * POINTS + a
        own = np.where(points_hidden[element, point][..., None], 0.0, H_element[element])
        indirect = np.where(is_alone[element][..., None], own, indirect)
    rho = np.tile(rho, G)
    direct = H_direct.reshape(h, w, -1) * rho
    value = direct + indirect * rho
    width = float(np.sqrt(area / (grid[0] * grid[1])))
    return RadiosityMap(value.astype(np.float32), direct.astype(np.float32), (~hidden).astype(np.float32), rho, width)


def _cells_of(t, n):
    """Element and point along one direction at parameters t."""
    cell = np.minimum((t * n * POINTS).astype(int), n * POINTS - 1)
    return cell // POINTS, cell % POINTS


class LookupTable:
    """All radiosity maps in one array of texels, and where each face of the mesh lies in it."""

    def __init__(self, maps, mesh, n_surfaces, channels):
        """maps : {surface: RadiosityMap}; surfaces without one reflect nothing."""
        width, height = np.full(n_surfaces, 2), np.full(n_surfaces, 2)
        offset = np.zeros(n_surfaces + 1, dtype=np.int64)  # texel 0..3: a map of nothing
        nothing = np.zeros((4, channels + 1), dtype=np.float32)
        nothing[:, -1] = 1.0
        total, blocks, direct = 4, [nothing], [nothing]
        rho, near = np.zeros((n_surfaces + 1, channels), dtype=np.float32), np.zeros(n_surfaces + 1, dtype=np.float32)
        for s, m in sorted(maps.items()):
            h, w = m.weight.shape
            width[s], height[s], offset[s] = w, h, total
            blocks.append(_weighted(m.value, m.weight))
            direct.append(_weighted(m.direct, m.weight))
            rho[s], near[s] = m.rho, NEAR * m.width
            total += h * w
        self._all, self._direct = np.concatenate(blocks), np.concatenate(direct)
        self._faces = mesh.texel_coordinates(width, height)
        surface = np.append(mesh.face_surface, n_surfaces)
        width, height = np.append(width, 2), np.append(height, 2)
        self._offset, self._width = offset[surface].astype(np.int64), width[surface].astype(np.int64)
        last = np.stack([width[surface] - 2, height[surface] - 2], axis=1).astype(np.float32)
        self._faces = np.concatenate([self._faces, last], axis=1)
        self._rho, self._near = rho[surface], near[surface]

    def all_light(self, hits):
        """Radiosity seen by each ray, (n, C) float32: 0 for misses and back faces."""
        return self._look_up(self._all, hits)

    def direct_light(self, hits):
        """The same of direct light alone."""
        return self._look_up(self._direct, hits)

    def rho(self, hits):
        """Reflectance at front hits, (n, C)."""
        return self._rho[hits.face]

    def is_near(self, hits):
        """(n,) bool: front hits nearer than the elements there are wide."""
        return ~hits.is_back & (hits.t < self._near[hits.face]) & (hits.face >= 0)

    def _look_up(self, texels, hits):
        # np.take and work in place: half the time of plain indexing, and this is where the time goes.
        face = np.where(hits.is_back | (hits.face < 0), len(self._offset) - 1, hits.face)
        place = np.take(self._faces, face, axis=0)
        s = place[:, 0] + hits.a * place[:, 2] + hits.b * place[:, 4]
        t = place[:, 1] + hits.a * place[:, 3] + hits.b * place[:, 5]
        i = np.minimum(np.maximum(np.floor(s), 0), place[:, 6])
        j = np.minimum(np.maximum(np.floor(t), 0), place[:, 7])
        s -= i
        t -= j
        width = np.take(self._width, face)
        corner = j.astype(np.int64)
        corner *= width
        corner += i.astype(np.int64)
        corner += np.take(self._offset, face)
        low = self._along(texels, corner, s[:, None])
        corner += width
        texel = self._along(texels, corner, s[:, None])
        texel -= low
        texel *= t[:, None]
        texel += low
        weight = texel[:, -1:]
        return texel[:, :-1] / np.where(weight > 0, weight, np.float32(1))

    @staticmethod
    def _along(texels, corner, f):
        first = np.take(texels, corner, axis=0)
        second = np.take(texels, corner + 1, axis=0)
        second -= first
        second *= f
        second += first
        return second


def _weighted(value, weight):
    return np.concatenate([value * weight[..., None], weight[..., None]], axis=2).reshape(weight.size, -1)


@dataclass(frozen=True)
class IndirectLight:
    """H (n, C) float32, hidden (n,) bool, noise (n,) float32: standard error, largest channel;
    reach (n,) float32: harmonic mean distance of what is around, in the scene's frame."""

    H: np.ndarray
    hidden: np.ndarray
    noise: np.ndarray
    reach: np.ndarray


def indirect_light(x, N, shift, K, tracer, mesh, table, channels):
    """Gather at points x (n, 3), lifted, with normals N (n, 3), by K rays each."""
    n = len(x)
    points = fibonacci(K)
    H = np.zeros((n, channels), dtype=np.float32)
    hidden, noise, reach = np.zeros(n, dtype=bool), np.zeros(n, dtype=np.float32), np.zeros(n, dtype=np.float32)
    step = max(1, RAYS_AT_ONCE // K)
    for first in range(0, n, step):
        part = slice(first, first + step)
        k = len(x[part])
        D = cosine_directions(N[part], points, shift[part] / (K, 1)).reshape(-1, 3)
        origins = np.repeat(x[part].astype(np.float32), K, axis=0)
        hits = tracer.closest(origins, D)
        ray = np.arange(k * K)
        seen = _follow(origins, D, hits, ray, K, shift[part], tracer, mesh, table).reshape(k, K, channels)
        H[part] = seen.mean(axis=1)
        all_groups = seen if channels <= 3 else seen.reshape(k, K, -1, 3).sum(axis=2)
        noise[part] = NOISE * all_groups.std(axis=1).max(axis=1) / K**0.8
        back = hits.is_back.reshape(k, K)
        hidden[part] = is_hidden(back, mesh.is_shell(hits.face).reshape(k, K)) if back.any() else False
        reach[part] = K / (1 / np.maximum(hits.t, 1e-6)).reshape(k, K).sum(axis=1)
    return IndirectLight(H, hidden, noise, reach)


def _follow(origins, D, hits, ray, K, shift, tracer, mesh, table, step=0):
    """Radiosity along rays; near hits are followed by one ray each, at most MOST_STEPS deep.

    ray (n,) : number of each, K to a sample, whose shifts (samples, 2) they share.
    """
    seen = table.all_light(hits)
    near = np.flatnonzero(table.is_near(hits)) if step < MOST_STEPS else ()
    if len(near):
        there, ray = hits[near], ray[near]
        N = mesh.normal[there.face]
        x = (origins[near] + there.t[:, None] * D[near] + N * OFFSET).astype(np.float32)
        onward = cosine_direction_each(N, path_coordinates(ray % K, shift[ray // K], step + 1))
        beyond = tracer.closest(x, onward)
        H = _follow(x, onward, beyond, ray, K, shift, tracer, mesh, table, step + 1)
        seen[near] = table.direct_light(there) + table.rho(there) * H
    return seen
