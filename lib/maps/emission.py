"""Surfaces that shine by a picture: their average exitance, the few parts direct light sees, and every texel's.

A picture multiplies the emission of its surface as a base texture multiplies its reflectance, and lies on it in the
same way (lib.maps.base_texture).  Seen from elsewhere it is a handful of even parts: a quadtree over the map's (u, v)
with at most SIDE x SIDE cells, merged where the picture is even.  Every part has the mean of what it stands for,
weighted by area, so the power is that of the picture whatever the number of parts.  What is finer than a cell is seen
in the picture, not in the light it throws.
"""

import numpy as np

from lib.maps import base_texture
from lib.maps.glow import Glow

SIDE = 8  # cells along u and v, a power of two
EVEN = 0.02  # of the surface's mean exitance, its brightest channel: cells that differ by less become one


def average(surface, picture, repeat=(1, 1)):
    """Return the mean (3,) float64 of an emission picture, weighted by area.

    surface, repeat : as base_texture.rho_average takes them;  picture : (H, W, 3) linear RGB >= 0
    """
    peak = _peak(picture)
    return peak * base_texture.rho_average(surface, picture / peak, repeat)


def on_map(surface, picture, repeat, w, h):
    """Return the picture at the crossings of the w x h map of its surface, and outside, as base_texture.on_map does."""
    peak = _peak(picture)
    value, outside = base_texture.on_map(surface, picture / peak, repeat, w, h)
    return value * peak, outside


def _peak(picture):
    """What a picture is divided by to lie in [0, 1]: 1 unless it is brighter."""
    return np.float32(max(1.0, float(picture.max())))


def glow(surface, picture, repeat=(1, 1)):
    """Return the Glow of a surface, None where the picture is as good as even.

    surface : NurbsSurface, TrimmedSurface, or Mesh with T and charts;  picture : (H, W, 3) linear RGB >= 0
    """
    mean, area = base_texture.means_over(surface, picture, repeat, SIDE)
    whole = np.einsum("jic,ji->c", mean, area) / area.sum()
    box, colour = merged(mean, area, EVEN * whole.max())
    if len(box) == 1:
        return None
    return Glow(box, np.divide(colour, whole, out=np.zeros_like(colour), where=whole > 0))


def merged(mean, area, tolerance):
    """The quadtree of n x n cells: boxes (L, 4) and their colours (L, 3); n is a power of two.

    mean (n, n, 3), area (n, n), row 0 at v = 0.  Four cells become one where their colours differ by `tolerance` at
    most; cells without an area have none.

    >>> box, colour = merged(np.array([[[1.0], [1.0]], [[1.0], [0.0]]]), np.ones((2, 2)), 0.1)
    >>> len(box), len(merged(np.ones((2, 2, 1)), np.ones((2, 2)), 0.1)[0])
    (4, 1)
    """
    is_leaf, found = np.ones(area.shape, dtype=bool), []
    while True:
        n = len(area)
        can_merge = np.zeros((n // 2, n // 2), dtype=bool)
        if n > 1:
            low, high = (_blocks(np.where(area[..., None] > 0, mean, empty)) for empty in (np.inf, -np.inf))
            spread = (high.max(axis=2) - low.min(axis=2)).max(axis=-1)
            can_merge = (spread <= tolerance) & _blocks(is_leaf[..., None]).all(axis=(2, 3))
        stays = is_leaf & ~np.kron(can_merge, np.ones((2, 2), dtype=bool)) if n > 1 else is_leaf
        j, i = np.nonzero(stays)
        found.append((np.stack([i, i + 1, j, j + 1], axis=1) / n, mean[j, i]))
        if n == 1 or not can_merge.any():
            break
        total, area = _blocks(mean * area[..., None]).sum(axis=2), _blocks(area[..., None]).sum(axis=2)
        mean = np.divide(total, area, out=np.zeros_like(total), where=area > 0)
        area, is_leaf = area[..., 0], can_merge
    return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))


def _blocks(cells):
    """Cells (n, n, k) in fours: (n / 2, n / 2, 4, k)."""
    n, k = len(cells) // 2, cells.shape[2]
    return cells.reshape(n, 2, n, 2, k).swapaxes(1, 2).reshape(n, n, 4, k)
