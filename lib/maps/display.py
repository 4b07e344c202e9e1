"""From radiosity to what a screen shows: linear light in [0, 1] after exposure; files encode it as sRGB."""

import numpy as np

from lib.maps.fill import push_pull


def light(B, exposure):
    """Linear light of radiosity B [W/m^2], any shape: radiance B / pi times exposure, not clipped."""
    return np.asarray(B, dtype=np.float64) / np.pi * exposure


def picture(value, hidden, E, exposure):
    """Linear light (h, w, 3) of a map: reflected radiosity (h, w, 3), hidden samples filled, plus exitance E (3,)."""
    return light(push_pull(value, hidden) + E, exposure)


def mean_radiosity(maps, area):
    """Mean radiosity (3,) [W/m^2] by area of the visible samples of a MapSet whose surfaces have `area` (m,)."""
    total, weight = np.zeros(3), 0.0
    for k in range(len(maps)):
        seen = ~maps.hidden_map(k)
        if seen.any():
            total += area[k] * maps.map(k)[seen].mean(axis=0, dtype=np.float64)
            weight += area[k]
    return total / weight if weight else total
