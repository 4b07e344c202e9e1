"""The refinement threshold of each surface: tau = t x mean irradiance, of the scene or of the surface itself."""

import numpy as np


def own_share(names, settings):
    """(n,) tolerance of each surface over the scene's: 1 but where settings["tolerances"] names the surface."""
    own = settings["tolerances"]
    return np.array([own.get(name, settings["tolerance"]) for name in names], dtype=np.float64) / settings["tolerance"]


def thresholds(solution, own, half, settings):
    """{surface: tau [W/m^2]}.

    solution : has mean_H (3,) and H_surface (n, 3), the scene's and the surfaces' own mean irradiance
    own : (n,) of own_share; half "direct" or "indirect"
    settings : tolerance, t_direct, t_indirect, relative_to ("scene" or "surface")

    A mean of 0 (no light) gives a threshold that nothing exceeds.
    """
    t = settings["t_direct"] if half == "direct" else settings["t_indirect"]
    tau = t * own * own_light(solution, settings) * float(np.max(solution.mean_H))
    return {s: (value if value > 0 else np.inf) for s, value in enumerate(tau)}


def own_light(solution, settings):
    """(n,) mean irradiance that the tolerance of each surface is relative to, over the scene's: 1 but where
    relative_to is "surface" and the surface has light."""
    share = np.ones(len(solution.H_surface))
    if settings["relative_to"] == "surface":
        local, mean = solution.H_surface.max(axis=1), float(np.max(solution.mean_H))
        lit = (local > 0) & (mean > 0)
        share[lit] = local[lit] / mean
    return share
