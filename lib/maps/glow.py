"""How a surface shines that shines unevenly, as direct light sees it: a few even parts."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Glow:
    """Parts of a surface that shines unevenly: the leaves of a quadtree that fills its map.

    box (L, 4) float64 u0, u1, v0, v1 in [0, 1];  colour (L, 3) float64 exitance over that of the whole, >= 0
    """

    box: np.ndarray
    colour: np.ndarray
