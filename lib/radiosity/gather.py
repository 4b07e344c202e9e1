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
from lib.radiosity import gather_kernels as kernels
from lib.visibility.hemisphere import rays_about
from lib.visibility.hidden import is_hidden
from lib.visibility.qmc import fibonacci, path_steps

RAYS_AT_ONCE = 65536  # 5 MB; fewer stay in the cache, but their calls cost more
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
        places = np.tile([0, 2, 2], (n_surfaces, 1))  # texels 0 to 3: a map of nothing
        nothing = np.zeros((4, channels // 3 * 4), dtype=np.float32)
        total, blocks, direct = 4, [nothing], [nothing]
        rho, near = np.zeros((n_surfaces, channels), dtype=np.float32), np.zeros(n_surfaces, dtype=np.float32)
        for s, m in sorted(maps.items()):
            h, w = m.weight.shape
            places[s] = total, w, h
            blocks.append(_weighted(m.value, m.weight))
            direct.append(_weighted(m.direct, m.weight))
            rho[s], near[s] = m.rho, NEAR * m.width
            total += h * w
        self._all, self._direct = np.concatenate(blocks), np.concatenate(direct)
        self._places = mesh.texel_coordinates(places[:, 1], places[:, 2]), mesh.face_surface, places
        self._rho, self._near, self.normal = rho, near, mesh.normal

    def see(self, hits, follows):
        """Radiosity seen by each ray, (n, C) float32, 0 for misses and back faces; and which rays (m,) hit fronts
        nearer than the elements there are wide: of those nothing is known yet if follows, otherwise there are none.
        """
        seen = np.empty((len(hits.face), self._rho.shape[1]), dtype=np.float32)
        chosen = np.empty(len(hits.face), dtype=np.int64)
        rays = hits.face, hits.a, hits.b, hits.t, hits.is_back
        n = kernels.see(*self._places, self._all, self._near, *rays, follows, seen, chosen)
        return seen, chosen[:n]

    def reflect(self, hits, near, H, seen):
        """Put into seen[near] what is reflected there: direct light by its maps, and other irradiance H (m, C)."""
        kernels.reflect(*self._places, self._direct, self._rho, near, hits.face, hits.a, hits.b, H, seen)


def _weighted(value, weight):
    """Texels of a map (h, w, 3 G) and its weight (h, w): (h w, 4 G), for each group weight times value, and weight."""
    h, w, channels = value.shape
    texels = np.empty((h, w, channels // 3, 4), dtype=np.float32)
    texels[..., :3] = value.reshape(h, w, -1, 3) * weight[..., None, None]
    texels[..., 3] = weight[..., None]
    return texels.reshape(h * w, -1)


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
        origins, D = rays_about(x[part], N[part], points, shift[part] / (K, 1))
        hits = tracer.closest(origins, D)
        seen = _follow(origins, D, hits, np.arange(len(D)), K, shift[part], tracer, table)
        kernels.summed(seen, hits.t, K, H[part], noise[part], reach[part])
        hidden[part] = is_hidden(hits, mesh.in_shell, K)
    return IndirectLight(H, hidden, NOISE * noise / np.float32(K**0.8), reach)


def _follow(origins, D, hits, ray, K, shift, tracer, table, step=0):
    """Radiosity along rays; near hits are followed by one ray each, at most MOST_STEPS deep.

    ray (n,) : number of each, K to a sample, whose shifts (samples, 2) they share.
    """
    seen, near = table.see(hits, step < MOST_STEPS)
    if len(near):
        x, onward, ray_on = np.empty((len(near), 3), np.float32), np.empty((len(near), 3), np.float32), ray[near]
        ends = near, hits.face, hits.t, table.normal, origins, D
        kernels.onward(*ends, ray, K, shift, *path_steps(step + 1), x, onward, ray_on)
        beyond = tracer.closest(x, onward)
        H = _follow(x, onward, beyond, ray_on, K, shift, tracer, table, step + 1)
        table.reflect(hits, near, H, seen)
    return seen
