"""From radiosity to what a screen shows: linear light in [0, 1] after exposure; files encode it as sRGB."""

import numpy as np

from lib.maps.fill import push_pull


def light(B, exposure):
    """Linear light of radiosity B [W/m^2], any shape: radiance B / pi times exposure, not clipped."""
    return np.asarray(B, dtype=np.float64) / np.pi * exposure


def picture(value, hidden, E, exposure):
    """Linear light (h, w, 3) of a map: reflected radiosity (h, w, 3), hidden samples filled, plus exitance E (3,)."""
    return light(push_pull(value, hidden) + E, exposure)


def mean_irradiance(maps, rho_avg, area):
    """Mean irradiance (3,) [W/m^2] by area of the surfaces of a MapSet of B = rho_avg H; 0 where none reflects.

    rho_avg : (m, 3) of the maps' surfaces;  area : (m,)
    """
    total, weight = np.zeros(3), np.zeros(3)
    for k in range(len(maps)):
        seen = ~maps.hidden_map(k)
        if seen.any():
            reflects = rho_avg[k] > 0
            mean = maps.map(k)[seen].mean(axis=0, dtype=np.float64)
            total += area[k] * np.where(reflects, mean / np.where(reflects, rho_avg[k], 1), 0)
            weight += area[k] * reflects
    return total / np.where(weight > 0, weight, 1)
