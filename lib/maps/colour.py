"""Transfer between sRGB encoded values and linear light (IEC 61966-2-1, the exact two-piece curve)."""

import numpy as np


def srgb_to_linear(encoded):
    """Return linear light of sRGB encoded values in [0, 1]; any shape, float64 unless float32 is given."""
    encoded = _floating(encoded)
    low = encoded <= 0.04045
    return np.where(low, encoded / 12.92, ((np.where(low, 1, encoded) + 0.055) / 1.055) ** 2.4).astype(encoded.dtype)


def linear_to_srgb(linear):
    """Return the sRGB encoding of linear light in [0, 1]; values outside are clipped to it first."""
    linear = np.clip(_floating(linear), 0, 1)
    low = linear <= 0.0031308
    # 1.055 x^(1/2.4) - 0.055, written so that 1 stays 1
    return np.where(low, linear * 12.92, 1 + 1.055 * (np.where(low, 1, linear) ** (1 / 2.4) - 1)).astype(linear.dtype)


def _floating(values):
    values = np.asarray(values)
    return values if values.dtype in (np.float32, np.float64) else values.astype(np.float64)
