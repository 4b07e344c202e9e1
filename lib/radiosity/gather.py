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

from lib.radiosity import gather_kernels as kernels
from lib.radiosity.radiosity_maps import offsets
from lib.visibility.hemisphere import rays_about
from lib.visibility.hidden import is_hidden
from lib.visibility.qmc import fibonacci, path_steps

RAYS_AT_ONCE = 65536  # 5 MB; fewer stay in the cache, but their calls cost more
NEAR = 2.0  # hits nearer than this many element widths are followed on
MOST_STEPS = 4  # in a narrow gap
NOISE = 1.35  # measured: standard error of K rays over their standard deviation / K^0.8


class LookupTable:
    """All radiosity maps in one array of texels, and where each face of the mesh lies in it."""

    def __init__(self, maps, mesh, rho, width):
        """maps : several RadiosityMaps; surfaces without one reflect nothing.  rho (n, 3 G) and width (n,), mean side
        of the elements in the scene's frame, of all surfaces."""
        surface, shape = (np.concatenate([getattr(m, field) for m in maps]) for field in ("surface", "shape"))
        nothing = np.zeros((4, rho.shape[1] // 3 * 4), dtype=np.float32)  # texels 0 to 3: a map of nothing
        self._all = np.concatenate([nothing, *(m.value for m in maps)])
        self._direct = np.concatenate([nothing, *(m.direct for m in maps)])
        places = np.tile([0, 2, 2], (len(rho), 1))
        places[surface, 0] = 4 + offsets(shape)[:-1]
        places[surface, 1:] = shape[:, ::-1]
        self._near = np.zeros(len(rho), dtype=np.float32)
        self._near[surface] = NEAR * width[surface]
        self._places = mesh.texel_coordinates(places[:, 1], places[:, 2]), mesh.face_surface, places
        self._rho, self.normal = rho.astype(np.float32), mesh.normal

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
