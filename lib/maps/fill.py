"""Values for hidden samples, the last thing done to a map before it is written.

`one_deep` gives the texels beside visible ones the mean of those and all others 0 (EXR maps); `push_pull` fills
everything (exported textures, whose mips read far into the hidden part).  Maps are (h, w, ...), masks (h, w) bool,
True = hidden.
"""

import numpy as np

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
    """Return a copy of value with every hidden texel filled smoothly from the visible ones; 0 where none is visible.

    Push: halve the map, averaging visible texels, until one texel is left. Pull: fill what is empty from the level
    above, bilinearly. Visible texels keep their bits.  [Gortler et al. 1996, The Lumigraph]
    """
    if not hidden.any():
        return value.copy()
    if hidden.all():
        return np.zeros_like(value)
    weight = (~hidden).astype(np.float64)
    filled = _pull_up(np.where(_like(hidden, value), 0, value).astype(np.float64), weight)
    return np.where(_like(hidden, value), filled, value).astype(value.dtype)


def _pull_up(value, weight):
    """Fill texels of weight 0 from a half-size map, recursively. value (h, w, ...), weight (h, w) in [0, 1]."""
    h, w = weight.shape
    if weight.min() > 0 or h * w == 1:
        return value
    coarse_weight = _quarter(weight)
    coarse = _quarter(value * _like(weight, value))
    full = coarse_weight > 0
    coarse[full] /= _like(coarse_weight[full], coarse[full])
    above = _pull_up(coarse, np.minimum(coarse_weight, 1))
    rows, columns = (np.arange(n) / 2 - 0.25 for n in (h, w))  # fine texel centres in coarse texels
    up = _linear(_linear(above, rows, 0), columns, 1)
    return np.where(_like(weight > 0, value), value, up)


def _quarter(array):
    """Return sums over 2 x 2 blocks; an odd last row or column stands alone."""
    h, w = array.shape[:2]
    array = np.pad(array, [(0, h % 2), (0, w % 2)] + [(0, 0)] * (array.ndim - 2))
    return array[0::2, 0::2] + array[1::2, 0::2] + array[0::2, 1::2] + array[1::2, 1::2]


def _linear(array, at, axis):
    """Interpolate linearly along axis at fractional indices `at`, clamped to the array."""
    n = array.shape[axis]
    at = np.clip(at, 0, n - 1)
    low = np.minimum(at.astype(int), max(n - 2, 0))
    t = (at - low).reshape([-1 if k == axis else 1 for k in range(array.ndim)])
    return np.take(array, low, axis) * (1 - t) + np.take(array, np.minimum(low + 1, n - 1), axis) * t


def _like(mask, value):
    """Return mask with trailing axes of length 1, so that it broadcasts over value."""
    return mask.reshape(mask.shape + (1,) * (value.ndim - mask.ndim))
