"""From the tolerance asked to what the stages do: rays, elements, thresholds, levels.

Model: the relative RMS error of a map is the root of the sum of squares of

    gather         0.55 % (720 / K)^0.8
    direct light   0.45 % (t_direct / 0.025)^0.5, noise of shadow rays in penumbrae included
    interpolation  0.35 % (t_indirect / 0.05)^0.5 of the indirect light
    elements       0.12 % (8000 / n_elements)^0.3

as measured against path traced references.  Above 1 % rays and thresholds give way faster than the tolerance, since
what stays fixed (elements, base lattices) is better than asked; below 0.4 % thresholds fall faster, since their square
roots do not follow.
"""

from dataclasses import asdict, dataclass

import numpy as np

ELEMENTS = 8000  # lookups then bound the error near 0.2 % in a room with a teapot; `elements` asks for more
ROUGH = 0.01  # tolerance above which meshes get less: there the width of their cells decides, not the noise in them
CHART_EFFORT = 0.5  # measured in a room of 330,000 triangles: 0.2 % more error for two thirds of the rays
FEW_CELLS = 2e5  # of all meshes: of more, a preview leaves the finest out, so that it takes about as long
MOST_COARSER = 2  # levels: farther up, charts begin to share cells
LOOKUPS = 1.2e-3  # of the scene's mean light: error that the elements leave in bounced light, measured
GATHER_RAYS = 720  # at a tolerance of 1 %
LARGE = 0.25  # root cells from this side on, in the scene's largest side, start their trees in full


@dataclass(frozen=True)
class Quality:
    """n_elements in the scene and rays_per_element for their rows; gather_rays K; shadow_rays (n0, n1), the same for
    every tolerance at first_shadow_rays, which the elements see;
    thresholds t_direct, t_indirect in units of the scene's mean irradiance; levels of the two trees (base, top), and
    the smallest_cell that they divide, in units of the scene's largest side; chart_effort, the share of shadow rays
    that samples on meshes get (below 1 they are not doubted, see lib.radiosity.refine), of gather rays the root of it;
    chart_coarser, levels by which the maps of meshes end above the finest cells of their atlas."""

    n_elements: int
    rays_per_element: int
    gather_rays: int
    shadow_rays: tuple
    first_shadow_rays: tuple
    t_direct: float
    t_indirect: float
    base_direct: int
    base_indirect: int
    top: int
    smallest_cell: float
    chart_effort: float
    chart_coarser: int

    def as_dict(self):
        """Plain dict for JSON."""
        return asdict(self)


def quality(tolerance, max_level=8, mesh_cells=0):
    """Quality for a relative RMS error `tolerance` (0.002 .. 0.1) with trees at most `max_level` deep, in a scene whose
    meshes have `mesh_cells` finest cells in all.

    Elements, their rows and their first shadow rays are the same for every tolerance: a changed one leaves the solved
    light as it is.
    """
    ratio = tolerance / 0.01
    rays = _multiple_of_16(gather_rays(GATHER_RAYS, ratio), 16, 8192)
    coarser = int(np.clip(np.ceil(np.log(max(mesh_cells, 1) / FEW_CELLS) / np.log(4)), 0, MOST_COARSER))
    n1 = 32 if tolerance >= 0.015 else 64 if tolerance >= 0.0075 else 256
    return Quality(
        n_elements=ELEMENTS,
        rays_per_element=64,
        gather_rays=rays,
        shadow_rays=(16, n1),
        first_shadow_rays=(16, 64),
        t_direct=0.025 * _threshold(ratio),
        t_indirect=0.05 * _threshold(ratio),
        base_direct=4,
        base_indirect=3,
        top=max_level,
        smallest_cell=1e-3 * min(1.0, max(0.5, ratio / 0.8)),
        chart_effort=1.0 if tolerance <= ROUGH else CHART_EFFORT if not coarser else CHART_EFFORT / 2,
        chart_coarser=0 if tolerance <= ROUGH else coarser,
    )


def first_level(side, level):
    """Level at which the tree of a flat surface begins, whose root cells have this side in the scene's largest: `level`
    for large ones, at least 1; numbers or arrays.
    """
    return np.clip(level + np.round(np.log2(np.maximum(side, 1e-9) / LARGE)), 1, level).astype(np.int64)


def _threshold(ratio):
    return ratio * max(1.0, ratio) ** 0.5 * min(1.0, ratio / 0.4)


def gather_rays(rays, ratio):
    """Rays for a tolerance `ratio` times the one that `rays` are for; numbers or arrays.

    Errors fall like rays^-0.8, and the gather gives and takes more than its share: what is fixed does not.
    """
    ratio = np.asarray(ratio, dtype=np.float64)
    return rays * ratio ** np.where(ratio < 1, -1.6, -2.0)


def _multiple_of_16(x, low, high):
    return int(min(high, max(low, 16 * round(x / 16))))
