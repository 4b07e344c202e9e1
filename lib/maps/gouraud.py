"""Light in vertices instead of a texture: Gouraud shading, the cheaper form for flat, evenly lit surfaces.

Source: Moeller 1996, who leaves it as a choice per surface.  A triangle interpolates linearly, a map bilinearly, so the
two agree only where vertices lie on every line of the map's lattice and its cells are not twisted.
"""

import numpy as np

from lib.maps.colour import linear_to_srgb

SEEN = 2 / 255  # a difference of sRGB values that shows


def at(value, UV):
    """The map value (h, w, 3) at parameters UV (k, 2), bilinearly: (k, 3)."""
    h, w = value.shape[:2]
    x, y = UV[:, 0] * (w - 1), UV[:, 1] * (h - 1)
    i, j = np.minimum(x.astype(int), w - 2), np.minimum(y.astype(int), h - 2)
    a, b = (x - i)[:, None], (y - j)[:, None]
    low = value[j, i] * (1 - a) + value[j, i + 1] * a
    high = value[j + 1, i] * (1 - a) + value[j + 1, i + 1] * a
    return low * (1 - b) + high * b


def holds_lattice(UV, w, h):
    """True when vertices with parameters UV (k, 2) lie on every line of the lattice of w x h samples."""
    lines = [np.unique(np.rint(t * 2**24)) for t in UV.T]
    return all(
        np.isin(np.rint(np.linspace(0, 1, n) * 2**24), line).all() for n, line in zip((w, h), lines, strict=True)
    )


def is_untwisted(light):
    """True when no cell of linear light (h, w, 3) shows along which diagonal it was cut into triangles."""
    rising, falling = (light[:-1, :-1] + light[1:, 1:]) / 2, (light[:-1, 1:] + light[1:, :-1]) / 2
    shown = [linear_to_srgb(x) for x in (rising, falling, (rising + falling) / 2)]
    return bool(max(np.abs(x - shown[2]).max() for x in shown[:2]) <= SEEN)
