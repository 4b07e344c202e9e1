"""Rows of pixels, constant squares side by side, read anywhere: means over intervals and linear interpolation.

Positions are in pixels along one axis of an array: pixel k covers [k, k + 1], its centre is at k + 0.5.
"""

import numpy as np

MAX_TAPS = 16  # pixels under one box up to which adding them up is quicker than running sums


def lerp(array, at, wrap, axis):
    """Interpolate pixel centres (index + 0.5) linearly at `at` [pixels]; periodic, or clamped at the first and last."""
    n = array.shape[axis]
    at = at - 0.5
    low = np.floor(at).astype(int)
    t = _along((at - low).astype(array.dtype), array, axis)
    if wrap:
        low, high = low % n, (low + 1) % n
    else:
        low, high = np.clip(low, 0, n - 1), np.clip(low + 1, 0, n - 1)
    first = np.take(array, low, axis)
    step = np.take(array, high, axis)
    step -= first
    step *= t
    return np.add(first, step, out=step)


def _along(t, array, axis):
    """Numbers t (n,) along an axis, repeated over the axes of the array behind it: long rows are multiplied at once."""
    behind = array.shape[axis + 1 :]
    return np.repeat(t, int(np.prod(behind))).reshape(-1, *behind)


def bilinear(picture, x, y, wrap=(True, True)):
    """Interpolate the pixel centres of a picture (h, w, 3) at x, y (n,) [pixels]: (n, 3); periodic, or clamped."""
    (low_x, high_x, a), (low_y, high_y, b) = (
        _neighbours(at, n, goes_round) for at, n, goes_round in zip((x, y), picture.shape[1::-1], wrap, strict=True)
    )
    a, b = (t.astype(picture.dtype)[:, None] for t in (a, b))
    low, high = picture[low_y, low_x], picture[high_y, low_x]
    low, high = low + a * (picture[low_y, high_x] - low), high + a * (picture[high_y, high_x] - high)
    return low + b * (high - low)


def _neighbours(at, n, wrap):
    """Pixels before and after `at` (m,) of a row of n, and where it lies between their centres."""
    at = at - 0.5
    low = np.floor(at).astype(np.int64)
    high, t = low + 1, at - low
    return (low % n, high % n, t) if wrap else (np.clip(low, 0, n - 1), np.clip(high, 0, n - 1), t)


def box_means(array, low, high, axis):
    """Return means over the intervals [low, high] [pixels] of a picture of constant squares, periodic."""
    first = np.floor(low).astype(int)
    n_taps = int((np.ceil(high) - first).max())
    return _by_taps(array, low, high, first, n_taps, axis) if n_taps <= MAX_TAPS else _by_sums(array, low, high, axis)


def _by_taps(array, low, high, first, n_taps, axis):
    """Add up the pixels an interval touches, each by its share; float32 stays float32."""
    total = 0
    for k in (first + tap for tap in range(n_taps)):
        share = np.maximum(np.minimum(high, k + 1) - np.maximum(low, k), 0) / (high - low)
        part = np.take(array, k % array.shape[axis], axis)
        part *= _along(share.astype(array.dtype), array, axis)
        total += part
    return total


def _by_sums(array, low, high, axis):
    """Subtract running sums (float64): the cost does not grow with the length of the intervals."""
    array = np.moveaxis(array, axis, 0)
    columns = (-1,) + (1,) * (array.ndim - 1)
    total = np.zeros((len(array) + 1, *array.shape[1:]))
    np.cumsum(array, axis=0, dtype=np.float64, out=total[1:])

    def integral(x):
        whole = np.floor(x).astype(int)
        turns, k = np.divmod(whole, len(array))
        return total[k] + turns.reshape(columns) * total[-1] + (x - whole).reshape(columns) * array[k]

    return np.moveaxis((integral(high) - integral(low)) / (high - low).reshape(columns), 0, axis)
