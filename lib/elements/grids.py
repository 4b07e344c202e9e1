"""Element grids: the coarse uniform uv cells in which the bounced light is solved, and how they lie in one long
list.
"""

from dataclasses import dataclass

import numpy as np

CURVED_LEAST = 8  # cells a side on curved or small surfaces: 2 x 2 costs twice the error in a room with a teapot
FLAT_LEAST = 2
MOST = 64  # cells a side
POINTS = 4  # sample points along each side of an element


@dataclass(frozen=True)
class ElementGrids:
    """Grid of each surface: n_u, n_v (n,) cells, 0 where the surface has no elements; first (n + 1,) offsets.

    Element j n_u + i of surface s, row j, is number first[s] + j n_u[s] + i.
    """

    n_u: np.ndarray
    n_v: np.ndarray
    first: np.ndarray

    @property
    def total(self):
        """Number of elements in the scene."""
        return int(self.first[-1])


def element_grids(area, extent, is_planar, has_elements, n_elements):
    """Grids sized by area to about n_elements in all.

    area (n,), extent (n, 2) mean lengths along u and v, is_planar, has_elements (n,) bool.
    """
    area, extent = np.asarray(area, dtype=np.float64), np.maximum(np.asarray(extent, dtype=np.float64), 1e-12)
    total = max(area[has_elements].sum(), 1e-300)
    wanted = n_elements * area / total
    aspect = np.sqrt(extent[:, 0] / extent[:, 1])
    least = np.where(is_planar, FLAT_LEAST, CURVED_LEAST)
    # A flat surface that is small beside the scene is what stands in it: it needs the finer grid as well.
    least = np.where(is_planar & (wanted < CURVED_LEAST**2), np.minimum(CURVED_LEAST, 2 + np.sqrt(wanted)), least)
    n_u = np.clip(np.round(np.sqrt(wanted) * aspect), least, MOST).astype(np.int64)
    n_v = np.clip(np.round(np.sqrt(wanted) / aspect), least, MOST).astype(np.int64)
    n_u, n_v = np.where(has_elements, n_u, 0), np.where(has_elements, n_v, 0)
    return ElementGrids(n_u, n_v, np.concatenate([[0], np.cumsum(n_u * n_v)]))


def point_parameters(n_u, n_v):
    """u (4 n_u,), v (4 n_v,) of the sample points inside the elements of a grid."""
    return (np.arange(POINTS * n_u) + 0.5) / (POINTS * n_u), (np.arange(POINTS * n_v) + 0.5) / (POINTS * n_v)


def by_element(array):
    """Point values (4 n_v, 4 n_u, ...) as (n_v n_u, 16, ...): the points of each element together."""
    rows, columns = array.shape[:2]
    n_v, n_u = rows // POINTS, columns // POINTS
    split = array.reshape(n_v, POINTS, n_u, POINTS, *array.shape[2:])
    return np.moveaxis(split, 2, 1).reshape(n_v * n_u, POINTS * POINTS, *array.shape[2:])


def at_centres(values, share, n_u, n_v, u, v, closed):
    """Bilinear lookup over cell centres, weights multiplied by the visible share and renormalised.

    values (n_v n_u, C), share (n_v n_u,), on the tensor grid u (w,), v (h,): (h, w, C).  Round the seam where closed.
    """
    C = values.shape[1]
    grid = np.concatenate([values * share[:, None], share[:, None]], axis=1).reshape(n_v, n_u, C + 1)
    rows = _blend(grid, v, n_v, closed[1], axis=0)
    full = _blend(rows, u, n_u, closed[0], axis=1)
    weight = full[..., C:]
    return np.where(weight > 0, full[..., :C] / np.where(weight > 0, weight, 1.0), 0.0)


def _blend(grid, t, n, closed, axis):
    x = np.asarray(t) * n - 0.5
    low = np.floor(x).astype(np.int64)
    f = x - low
    high = low + 1
    if closed:
        low, high = low % n, high % n
    else:
        low, high = np.clip(low, 0, n - 1), np.clip(high, 0, n - 1)
    shape = [1] * grid.ndim
    shape[axis] = len(f)
    f = f.reshape(shape)
    return np.take(grid, low, axis=axis) * (1 - f) + np.take(grid, high, axis=axis) * f
