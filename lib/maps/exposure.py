"""The one number that takes radiance to the screen's range [0, 1]."""

import numpy as np

SHARE = 0.99  # of the scene's area stays below white


def automatic(maps, area):
    """Exposure that takes the 99th percentile, by area, of the reflected radiance B / pi to 1; 1 in a dark scene.

    maps : MapSet, value (N, 3) reflected radiosity [W/m^2];  area : (m,) of its surfaces, any unit
    The brightest channel decides; hidden samples do not count.
    """
    w, h = maps.sizes()
    weight = np.repeat(np.asarray(area) / (w * h), w * h)
    seen = ~maps.hidden
    radiance, weight = maps.value[seen].max(axis=1, initial=0.0).astype(np.float64) / np.pi, weight[seen]
    if not radiance.size or weight.sum() <= 0:
        return 1.0
    order = np.argsort(radiance, kind="stable")
    below = np.cumsum(weight[order])
    brightest = radiance[order][min(int(np.searchsorted(below, SHARE * below[-1])), radiance.size - 1)]
    return float(1 / brightest) if brightest > 0 else 1.0
