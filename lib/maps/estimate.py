"""Light on surfaces that have no map: the lamps without their shadows, and the mean radiosity of all that is lit.

Such a surface only casts shadows in the bake, and its light is no part of it; drawn in one colour it would look like a
cut-out.  The lamps' form factors are those of discs (Wallace et al. 1989), F = A cos_x cos_y / (pi r^2 + A).
"""

import numpy as np

AT_ONCE = 1 << 20  # pairs of vertex and lamp facet


def irradiance(x, N, A, B, C, E, mean_B):
    """Estimated irradiance H (k, 3) [W/m^2] at points x (k, 3) with unit normals N.

    A, B, C (f, 3) corners of the lamps' facets, shining along their geometric normal; E (f, 3) exitance
    mean_B (3,) mean radiosity of the surroundings, whose irradiance it is
    """
    cross = np.cross(B - A, C - A)
    area = np.linalg.norm(cross, axis=1) / 2
    normal, centre = cross / (2 * area)[:, None], (A + B + C) / 3
    H = np.empty((len(x), 3))
    step = max(1, AT_ONCE // max(1, len(A)))
    for first in range(0, len(x), step):
        part = slice(first, first + step)
        away = centre - x[part, None]
        square = (away**2).sum(axis=2)
        r = np.maximum(np.sqrt(square), 1e-300)
        cos_x = np.maximum((away * N[part, None]).sum(axis=2) / r, 0)
        cos_y = np.maximum(-(away * normal).sum(axis=2) / r, 0)
        H[part] = (area * cos_x * cos_y / (np.pi * square + area)) @ E
    return H + mean_B
