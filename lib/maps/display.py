"""From radiosity to what a screen shows: linear light in [0, 1] after exposure; files encode it as sRGB."""

import numpy as np

from lib.maps.fill import push_pull


def light(B, exposure):
    """Linear light of radiosity B [W/m^2], any shape: radiance B / pi times exposure, not clipped."""
    return np.asarray(B, dtype=np.float64) / np.pi * exposure


def picture(value, hidden, E, exposure):
    """Linear light (h, w, 3) of a map: reflected radiosity (h, w, 3), hidden samples filled, plus exitance E (3,)."""
    shown = push_pull(value, hidden) + np.asarray(E, dtype=np.float64)
    shown /= np.pi  # as `light` has it, in place: maps are large
    shown *= exposure
    return shown


def mean_radiosity(maps, area):
    """Mean radiosity (3,) [W/m^2] by area of the visible samples of a MapSet whose surfaces have `area` (m,)."""
    total, weight = np.zeros(3), 0.0
    for k in range(len(maps)):
        hidden = maps.hidden_map(k)
        if not hidden.all():
            seen = maps.map(k)[~hidden] if hidden.any() else maps.map(k).reshape(-1, 3)
            total += area[k] * seen.mean(axis=0, dtype=np.float64)
            weight += area[k]
    return total / weight if weight else total
