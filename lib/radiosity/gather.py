"""Indirect light at points: one final gather through the coarse solution.

    H_indirect(x) = 1/K sum over K cosine rays of  rho_s [H_indirect(s, u, v) + H_direct(s, u, v)]  at the hit

Two-pass radiosity (Lischinski et al. 1993): H_direct from the fine direct maps, H_indirect from the elements; never emission; nothing from
misses, back faces and surfaces without elements.
"""

from dataclasses import dataclass

import numpy as np

from lib.elements.grids import at_centres
from lib.visibility.hemisphere import cosine_directions
from lib.visibility.hidden import is_hidden
from lib.visibility.qmc import r2

RAYS_AT_ONCE = 16384  # what is gathered stays in the cache


@dataclass(frozen=True)
class RadiosityMap:
    """Reflected radiosity of one surface for lookups: value (h, w, C) float32 and weight (h, w), 0 where hidden."""

    value: np.ndarray
    weight: np.ndarray


def radiosity_map(H_direct, hidden, H_element, share, grid, rho, closed):
    """rho (H_direct + H_indirect) on the lattice of a direct map.

    H_direct (h, w, G, 3), hidden (h, w); H_element (n_v n_u, G, 3) indirect, share (n_v n_u,) visible share, grid (n_u, n_v), rho (3,).
    """
    h, w, G = H_direct.shape[:3]
    u, v = np.linspace(0, 1, w), np.linspace(0, 1, h)
    indirect = at_centres(H_element.reshape(len(H_element), -1), share, *grid, u, v, closed)
    value = (H_direct.reshape(h, w, -1) + indirect) * np.tile(rho, G)
    return RadiosityMap(value.astype(np.float32), (~hidden).astype(np.float32))


class LookupTable:
    """All radiosity maps in one array of texels, and where each face of the mesh lies in it."""

    def __init__(self, maps, mesh, n_surfaces, channels):
        """maps : {surface: RadiosityMap}; surfaces without one reflect nothing."""
        width, height = np.full(n_surfaces, 2), np.full(n_surfaces, 2)
        offset = np.zeros(n_surfaces + 1, dtype=np.int64)  # texel 0..3: a map of nothing
        blocks, total = [np.zeros((4, channels + 1), dtype=np.float32)], 4
        blocks[0][:, -1] = 1.0
        for s, m in sorted(maps.items()):
            h, w = m.weight.shape
            width[s], height[s], offset[s] = w, h, total
            blocks.append(np.concatenate([m.value * m.weight[..., None], m.weight[..., None]], axis=2).reshape(h * w, -1))
            total += h * w
        self._texels = np.concatenate(blocks)
        self._faces = mesh.texel_coordinates(width, height)
        surface = np.append(mesh.face_surface, n_surfaces)
        width, height = np.append(width, 2), np.append(height, 2)
        self._offset, self._width = offset[surface].astype(np.int64), width[surface].astype(np.int64)
        self._last_i = (width[surface] - 2).astype(np.float32)
        self._last_j = (height[surface] - 2).astype(np.float32)

    def __call__(self, hits):
        """Radiosity seen by each ray, (n, C) float32: 0 for misses and back faces."""
        face = np.where(hits.is_back | (hits.face < 0), len(self._offset) - 1, hits.face)
        place = self._faces[face]
        s = place[:, 0] + hits.a * place[:, 2] + hits.b * place[:, 4]
        t = place[:, 1] + hits.a * place[:, 3] + hits.b * place[:, 5]
        i = np.minimum(np.maximum(np.floor(s), 0), self._last_i[face])
        j = np.minimum(np.maximum(np.floor(t), 0), self._last_j[face])
        fs, ft = (s - i)[:, None], (t - j)[:, None]
        width = self._width[face]
        corner = self._offset[face] + j.astype(np.int64) * width + i.astype(np.int64)
        low = self._texels[corner] * (1 - fs) + self._texels[corner + 1] * fs
        corner += width
        high = self._texels[corner] * (1 - fs) + self._texels[corner + 1] * fs
        texel = low * (1 - ft) + high * ft
        weight = texel[:, -1:]
        return texel[:, :-1] / np.where(weight > 0, weight, 1.0)


@dataclass(frozen=True)
class IndirectLight:
    """H (n, C) float32, hidden (n,) bool, noise (n,) float32: standard error from two half-sets of rays, largest channel."""

    H: np.ndarray
    hidden: np.ndarray
    noise: np.ndarray


def indirect_light(x, N, shift, K, tracer, mesh, table, channels):
    """Gather at points x (n, 3), lifted, with normals N (n, 3), by K rays each."""
    n = len(x)
    points = r2(K)
    H = np.zeros((n, channels), dtype=np.float32)
    hidden, noise = np.zeros(n, dtype=bool), np.zeros(n, dtype=np.float32)
    step = max(1, RAYS_AT_ONCE // K)
    for first in range(0, n, step):
        part = slice(first, first + step)
        k = len(x[part])
        D = cosine_directions(N[part], points, shift[part])
        origins = np.repeat(x[part].astype(np.float32), K, axis=0)
        hits = tracer.closest(origins, D.reshape(-1, 3))
        seen = table(hits).reshape(k, K, channels)
        half = seen[:, : K // 2 * 2].reshape(k, K // 2, 2, channels).mean(axis=1)
        H[part] = seen.mean(axis=1)
        noise[part] = np.abs(half[:, 0] - half[:, 1]).max(axis=1) / 2
        back = hits.is_back.reshape(k, K)
        hidden[part] = is_hidden(back, mesh.is_shell(hits.face).reshape(k, K)) if back.any() else False
    return IndirectLight(H, hidden, noise)
