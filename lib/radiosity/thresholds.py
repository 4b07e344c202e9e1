"""The refinement threshold of each surface: tau = t x mean irradiance, of the scene or of the surface itself."""

import numpy as np


def thresholds(solution, tolerance, half, settings):
    """{surface: tau [W/m^2]}.

    solution : has H_indirect, share, n_u, n_v, first, mean_H and H_surface (n, 3), the surfaces' own mean irradiance
    tolerance : (n,) overrides, nan where the scene's holds; half "direct" or "indirect"
    settings : tolerance, t_direct, t_indirect, relative_to ("scene" or "surface")

    A mean of 0 (no light) gives a threshold that nothing exceeds.
    """
    t = settings["t_direct"] if half == "direct" else settings["t_indirect"]
    own = np.nan_to_num(np.asarray(tolerance, dtype=np.float64) / settings["tolerance"], nan=1.0)
    mean = float(np.max(solution.mean_H))
    means = np.full(len(own), mean)
    if settings["relative_to"] == "surface":
        local = solution.H_surface.max(axis=1)
        means = np.where(local > 0, local, mean)
    tau = t * own * means
    return {s: (value if value > 0 else np.inf) for s, value in enumerate(tau)}
