"""Significance of points: what is kept for a tolerance stays within it, whichever way the line is run."""

import numpy as np

from lib.surfaces.significance import significance


def test_significance_is_the_tolerance_up_to_which_a_point_stays():
    rng = np.random.default_rng(5)
    S = np.cumsum(rng.normal(size=(500, 3)), axis=0)
    value = significance(S)
    assert np.array_equal(significance(S[::-1].copy())[::-1], value)
    assert np.isinf(value[[0, -1]]).all() and np.isfinite(value[1:-1]).all()
    for t in (0.0, 0.5, 3.0, 30.0):
        kept = np.flatnonzero(value > t)
        off = 0.0
        for a, b in zip(kept, kept[1:], strict=False):
            along = S[b] - S[a]
            s = np.clip((S[a : b + 1] - S[a]) @ along / (along @ along), 0, 1)
            off = max(off, np.linalg.norm(S[a : b + 1] - S[a] - s[:, None] * along, axis=1).max())
        assert off <= t * (1 + 1e-12) + 1e-12


def test_significance_of_a_closed_line_does_not_depend_on_the_direction():
    t = np.linspace(0, 2 * np.pi, 101)
    S = np.column_stack([np.cos(t), np.sin(t), 0 * t])
    S[-1] = S[0]
    value = significance(S)
    assert np.array_equal(significance(S[::-1])[::-1], value)
    assert np.sort(value[1:-1])[-1] == 2.0  # the point across
    assert significance(S[:2]).tolist() == [np.inf, np.inf] and significance(S[:1]).tolist() == [np.inf]
