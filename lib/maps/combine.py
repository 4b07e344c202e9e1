"""One illumination map from the two halves of the light."""

import numpy as np

from lib.maps.resample import drop_levels, resample, upsample


def combine(direct, indirect, tolerance):
    """H = H_direct + H_indirect on the finer of their lattices, levels that say nothing dropped.

    direct, indirect : (value (h, w, G, 3), known, hidden, level) on lattices of the same roots; indirect may be None.
    tolerance : a level is dropped when all its samples lie this close to their prediction [W/m^2].
    Returns (H (h, w, G, 3) float32, hidden (h, w), level).
    """
    *samples, level = direct
    value, hidden = resample(*samples)
    if indirect is not None:
        *samples, other_level = indirect
        other, other_hidden = resample(*samples)
        top = max(level, other_level)
        value, hidden = upsample(value, hidden, top - level)
        other, other_hidden = upsample(other, other_hidden, top - other_level)
        value, hidden, level = value + other, hidden | other_hidden, top
    value = np.where(hidden[..., None, None], 0, value)
    value, hidden, level = drop_levels(value, hidden, level, tolerance)
    return np.ascontiguousarray(value, dtype=np.float32), np.ascontiguousarray(hidden), level
