"""A trimmed NURBS surface: the part of a surface inside closed loops of its (u, v).

Border points are shared by value: both faces along an edge hold the same positions, bit for bit, and the same
significances, so that each picks the same points for a level of detail without knowing the other.
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs.surface import NurbsSurface


@dataclass(frozen=True, eq=False)
class TrimmedSurface:
    """The part of `base` inside its loops.

    base : NurbsSurface over the box of the loops: its domain [0, 1] x [0, 1] is that box
    box : (4,) float64 u0, u1, v0, v1 of the box in the whole surface's [0, 1] x [0, 1]
    uv : (k, 2) float64 border points in [0, 1] x [0, 1] of base, loop after loop; the last of a loop is not the first
        again.  The outer loop comes first and runs counterclockwise, holes clockwise: the inside is on the left
    loop_start : (m + 1,) int64
    S : (k, 3) float64 positions of the border points: those of the edge, and not quite base(uv)
    significance : (k,) float64, unit of S: a border cut to the chord tolerance t keeps the points with significance
        > t; inf at corners, where edges end
    """

    base: NurbsSurface
    box: np.ndarray
    uv: np.ndarray
    loop_start: np.ndarray
    S: np.ndarray
    significance: np.ndarray
