"""A triangle mesh as a surface: welded positions, and what its triangles' corners carry."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Mesh:
    """m triangles with an area, of one material.

    V : (n, 3) float64 positions, each once;  F : (m, 3) int32 wound so that the geometric normal is the lit side
    N : (m, 3, 3) float64 unit normals at the corners of each triangle
    T : (m, 3, 2) float64 texture coordinates at the corners, (0, 0) the picture's lower left, or None
    uv : (m, 3, 2) float64 place of the corners in the map's [0, 1] x [0, 1], or None before charts are made
    chart : (m,) int32 number of the chart of each triangle, or None
    level : the atlas has 2^level cells a side; charts lie at least PADDING of these apart and from the border; or None
    """

    V: np.ndarray
    F: np.ndarray
    N: np.ndarray
    T: np.ndarray | None = None
    uv: np.ndarray | None = None
    chart: np.ndarray | None = None
    level: int | None = None


class Flat(ValueError):
    """None of the triangles that a mesh was to be made of has an area."""
