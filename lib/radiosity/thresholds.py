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
    mean = float(np.max(solution.mean_H))
    means = np.full(len(own), mean)
    if settings["relative_to"] == "surface":
        local = solution.H_surface.max(axis=1)
        means = np.where(local > 0, local, mean)
    tau = t * own * means
    return {s: (value if value > 0 else np.inf) for s, value in enumerate(tau)}
