"""How wrong irradiance is at the reference points.

    RMSE = sqrt(mean over points and channels of (H - E)^2 - se^2) / mean E     95 % = that percentile of |H - E| / E

E is the path traced irradiance, se its standard error.  The noise of E is taken off the RMSE, not off the percentile.
"""

import numpy as np


def errors(H, E, se):
    """Figures of estimates H (k, 3), NaN where there is none: dict rmse, p95, bias (all relative), points, left_out."""
    seen = np.isfinite(H).all(axis=1)
    wrong, E, se = (H - E)[seen], E[seen], se[seen]
    mean = E.mean()
    return {
        "rmse": float(np.sqrt(max((wrong**2 - se**2).mean(), 0)) / mean),
        "p95": float(np.percentile(np.abs(wrong) / np.maximum(E, 1e-9 * mean), 95)),
        "bias": float(wrong.mean() / mean),
        "points": int(seen.sum()),
        "left_out": int((~seen).sum()),
    }


def rmse_by_area(H, E, se, share):
    """The RMSE with points weighted by the area they stand for, share (k,): what a bake can estimate of itself."""
    seen = np.isfinite(H).all(axis=1)
    share = share[seen] / share[seen].sum()
    square = (((H - E)[seen] ** 2 - se[seen] ** 2).mean(axis=1) * share).sum()
    return float(np.sqrt(max(square, 0)) / (E[seen].mean(axis=1) * share).sum())


def bilinear(texels, s, t):
    """Texels (h, w, C) at texel coordinates s, t (k,), texel (j, i) standing at s = i, t = j; clamped to the border."""
    h, w = texels.shape[:2]
    s, t = np.clip(s, 0, w - 1), np.clip(t, 0, h - 1)
    i, j = np.minimum(s.astype(int), max(w - 2, 0)), np.minimum(t.astype(int), max(h - 2, 0))
    right, up = np.minimum(i + 1, w - 1), np.minimum(j + 1, h - 1)
    a, b = (s - i)[:, None], (t - j)[:, None]
    low = texels[j, i] * (1 - a) + texels[j, right] * a
    high = texels[up, i] * (1 - a) + texels[up, right] * a
    return low * (1 - b) + high * b


def front(curve):
    """The rows of a curve [(cpu, error), ...] that no other beats in both, by rising cpu."""
    best, kept = np.inf, []
    for cpu, error in sorted(curve):
        if error < best:
            best = error
            kept.append((cpu, error))
    return kept


def cpu_at(curve, rmse):
    """CPU seconds at which a curve [(cpu, rmse), ...] reaches an error, straight lines in logarithms; None outside it.

    >>> round(cpu_at([(1, 0.04), (4, 0.01), (5, 0.02)], 0.02), 6)
    2.0
    """
    cpus, found = (np.log(column) for column in zip(*front(curve), strict=True))
    if not found[-1] <= np.log(rmse) <= found[0]:
        return None
    return float(np.exp(np.interp(-np.log(rmse), -found, cpus)))
