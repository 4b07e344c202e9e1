"""What the final gather reads: the light that each surface reflects, on the lattice of its direct map.

Fine direct light by its own trees, and the coarse solution of the elements for the rest (Lischinski et al. 1993).
"""

from dataclasses import dataclass

import numpy as np

from lib.elements.grids import POINTS, at_centres
from lib.maps.resample import resample


@dataclass(frozen=True)
class RadiosityMaps:
    """Reflected radiosity of k surfaces, N texels in all.

    surface (k,) int32, ascending; shape (k, 2) int32, rows and columns of each map
    value (N, 4 G) float32 : maps one after the other, row-major; for each light group weight times radiosity [W/m^2],
    and the weight, 0 where hidden; direct (N, 4 G): the same of direct light alone
    """

    surface: np.ndarray
    shape: np.ndarray
    value: np.ndarray
    direct: np.ndarray


def offsets(shape):
    """Where maps of shape (k, 2) begin in packed texels: (k + 1,) int64."""
    return np.concatenate([[0], np.cumsum(shape.prod(axis=1, dtype=np.int64))])


def radiosity_maps(world, direct, solution):
    """RadiosityMaps of those of the surfaces of `direct` that reflect.

    direct : {surface: Quadtree} of direct light
    solution : has H_indirect (n, G, 3), is_hidden (n, 16), is_alone (n,), n_u, n_v, first, rho (surfaces, 3)
    """
    surfaces = [s for s in sorted(direct) if world.reflects[s] and solution.n_u[s] > 0]
    shapes = np.array([direct[s].known.shape for s in surfaces], dtype=np.int32).reshape(-1, 2)
    first = offsets(shapes)
    value, direct_value = (np.empty((first[-1], 4 * world.n_groups), dtype=np.float32) for _ in range(2))
    for k, s in enumerate(surfaces):
        tree = direct[s]
        H_direct, hidden = resample(tree.value.reshape(*tree.known.shape, -1, 3), tree.known, tree.hidden)
        part = slice(solution.first[s], solution.first[s + 1])
        elements = (array[part] for array in (solution.H_indirect, solution.is_hidden, solution.is_alone))
        grid = int(solution.n_u[s]), int(solution.n_v[s])
        H_indirect = on_lattice(*elements, grid, hidden.shape, world.lattices[s].closed)
        texels = slice(first[k], first[k + 1])
        B_direct = solution.rho[s] * H_direct
        direct_value[texels] = weighted(B_direct, hidden)
        value[texels] = weighted(B_direct + solution.rho[s] * H_indirect, hidden)
    return RadiosityMaps(np.array(surfaces, dtype=np.int32), shapes, value, direct_value)


def on_lattice(H, points_hidden, is_alone, grid, shape, closed):
    """The light of a surface's elements on a lattice of `shape` (h, w): (h, w, G, 3).

    H (n_v n_u, G, 3), points_hidden (n_v n_u, 16), is_alone (n_v n_u,) whether the element is looked up without its
    neighbours; grid (n_u, n_v); closed along (u, v).
    """
    (h, w), (n, G) = shape, H.shape[:2]
    u, v = np.linspace(0, 1, w), np.linspace(0, 1, h)
    H, share = H.reshape(n, -1), (~points_hidden).mean(axis=1)
    out = at_centres(H, share * ~is_alone, *grid, u, v, closed)
    if is_alone.any():
        (j, b), (i, a) = _cells_of(v, grid[1]), _cells_of(u, grid[0])
        element, point = j[:, None] * grid[0] + i, b[:, None] * POINTS + a
        own = np.where(points_hidden[element, point][..., None], 0.0, H[element])
        out = np.where(is_alone[element][..., None], own, out)
    return out.reshape(h, w, G, 3)


def _cells_of(t, n):
    """Element and point along one direction at parameters t."""
    cell = np.minimum((t * n * POINTS).astype(int), n * POINTS - 1)
    return cell // POINTS, cell % POINTS


def weighted(value, hidden):
    """A map (h, w, G, 3) with hidden (h, w) as texels (h w, 4 G)."""
    texels = np.zeros((*value.shape[:3], 4), dtype=np.float32)
    seen = ~hidden[..., None]
    texels[..., :3] = np.where(seen[..., None], value, 0.0)
    texels[..., 3] = seen
    return texels.reshape(hidden.size, -1)
