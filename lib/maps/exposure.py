"""The one number that takes radiance to the screen's range [0, 1]."""

import numpy as np

from lib.maps import texel_kernels as kernels

SHARE = 0.99  # of the scene's area stays below white


def automatic(maps, area):
    """Exposure that takes the 99th percentile, by area, of the reflected radiance B / pi to 1; 1 in a dark scene.

    maps : MapSet, value (N, 3) reflected radiosity [W/m^2];  area : (m,) of its surfaces, any unit
    The brightest channel decides; hidden samples do not count.
    """
    w, h = maps.sizes()
    value, weight = np.ascontiguousarray(maps.value), np.asarray(area) / (w * h)
    top, share = np.empty(len(value), np.float32), np.zeros(1 << kernels.BUCKET_BITS)
    kernels.brightest(value, value.view(np.int32), maps.hidden, maps.offsets(), weight, top, share)
    below = np.cumsum(share)
    if below[-1] <= 0:
        return 1.0
    # Sort what shares its upper bits with the percentile: a small part of all samples.
    bucket = int(np.searchsorted(below, SHARE * below[-1]))
    some = np.flatnonzero(top.view(np.int32) >> kernels.DROPPED == bucket)
    some = some[np.argsort(top[some], kind="stable")]
    up_to = below[bucket] - share[bucket] + np.cumsum(np.repeat(weight, w * h)[some])
    at = min(int(np.searchsorted(up_to, SHARE * below[-1])), len(some) - 1)
    brightest = float(top[some[at]]) / np.pi
    return float(1 / brightest) if brightest > 0 else 1.0
