"""Values for hidden samples, the last thing done to a map before it is written.

`one_deep` gives the texels beside visible ones the mean of those and all others 0 (EXR maps); `push_pull` fills
everything (exported textures, whose mips read far into the hidden part).  Maps are (h, w, ...), masks (h, w) bool,
True = hidden.
"""

import numpy as np

from lib.maps import texel_kernels as kernels

NEIGHBOURS = [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)]


SIDES = (np.s_[:, 0], np.s_[:, -1], np.s_[0], np.s_[-1])  # u = 0, u = 1, v = 0, v = 1


def one_deep(value, hidden, closed=(False, False), collapsed=(False,) * 4):
    """Return a copy of value whose hidden texels hold the mean of their visible neighbours (of 8), or 0 without one.

    closed : (u, v); along a closed direction the last column or row is a copy of the first and neighbours go round.
    collapsed : of the SIDES, those that are one point: filled, all their texels hold one mean.
    """
    filled = np.where(_like(hidden, value), 0, value)
    if not hidden.any():
        return filled
    total = np.zeros(value.shape, np.float64)
    count = np.zeros(hidden.shape, np.int64)
    around, seen = _ring(filled, closed), _ring(~hidden, closed, outside=False)
    h, w = hidden.shape
    for dj, di in NEIGHBOURS:
        total += around[1 + dj : 1 + dj + h, 1 + di : 1 + di + w]
        count += seen[1 + dj : 1 + dj + h, 1 + di : 1 + di + w]
    edge = hidden & (count > 0)
    filled[edge] = (total[edge] / _like(count[edge], total[edge])).astype(value.dtype)
    for side, line in enumerate(SIDES):
        if collapsed[side] and edge[line].any():
            filled[line] = filled[line][edge[line]].mean(axis=0)
    return filled


def _ring(array, closed, outside=0):
    """Return array with one more row and column on each side: what lies there on closed ones, else outside."""
    array = np.pad(array, [(1, 1), (1, 1)] + [(0, 0)] * (array.ndim - 2), constant_values=outside)
    if closed[0] and array.shape[1] > 4:
        array[:, 0], array[:, -1] = array[:, -3], array[:, 2]
    if closed[1] and array.shape[0] > 4:
        array[0], array[-1] = array[-3], array[2]
    return array


def push_pull(value, hidden):
    """Return a copy of value (h, w, 3) with every hidden texel filled smoothly from the visible ones; 0 where none is.

    Push: halve the map, averaging visible texels, until one texel is left. Pull: fill what is empty from the level
    above, bilinearly. Visible texels keep their bits.  [Gortler et al. 1996, The Lumigraph]
    """
    if not hidden.any():
        return value.copy()
    if hidden.all():
        return np.zeros_like(value)
    filled, weight = np.array(value, np.float64, order="C"), (~hidden).astype(np.float64)
    return _filled(filled, weight).astype(value.dtype)


def _filled(value, weight):
    """Fill texels of weight 0, in place, from a half-size map, recursively. value (h, w, 3); weight (h, w) <= 1."""
    h, w = weight.shape
    if weight.min() == 0 and h * w > 1:
        coarse, coarse_weight = np.empty(((h + 1) // 2, (w + 1) // 2, 3)), np.empty(((h + 1) // 2, (w + 1) // 2))
        kernels.halve(value, weight, coarse, coarse_weight)
        kernels.fill(_filled(coarse, coarse_weight), weight, value)
    return value


def _like(mask, value):
    """Return mask with trailing axes of length 1, so that it broadcasts over value."""
    return mask.reshape(mask.shape + (1,) * (value.ndim - mask.ndim))
