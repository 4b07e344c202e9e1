"""Thumbnails are upright, and overlaid trees are counted by hand."""

import numpy as np

from lib.report.thumbnails import automatic_exposure, overlay_count, thumbnail


def test_v_runs_up_and_hidden_samples_are_marked():
    value = np.zeros((3, 3, 3))
    value[2, 0] = [1, 0, 0]  # v = 1, u = 0: upper left
    hidden = np.zeros((3, 3), bool)
    hidden[0, 2] = True
    codes = thumbnail(value, hidden, 1.0)
    assert codes[0, 0].tolist() == [255, 0, 0] and codes[2, 2].tolist() == [70, 40, 90] and codes.shape == (3, 3, 3)


def test_large_maps_are_thinned_on_their_crossings():
    value = np.zeros((257, 513, 3))
    value[256, 512] = 1
    codes = thumbnail(value, np.zeros((257, 513), bool), 1.0)
    assert codes.shape == (65, 129, 3) and codes[0, -1].tolist() == [255] * 3


def test_exposure_of_even_and_of_dark_maps():
    assert automatic_exposure(np.full((9, 3), 0.25)) == 4
    assert automatic_exposure(np.zeros((9, 3))) == 1


def test_overlay_of_two_corner_refinements():
    # One tree divides the lower left quarter, the other the upper right: 2 x 4 small and 2 large leaves.
    lower = ([1, 1, 1, 2, 2, 2, 2], [1, 0, 1, 0, 1, 0, 1], [0, 1, 1, 0, 0, 1, 1])
    upper = ([1, 1, 1, 2, 2, 2, 2], [0, 1, 0, 2, 3, 2, 3], [0, 0, 1, 2, 2, 3, 3])
    assert overlay_count([lower, upper], (1, 1)) == 10
    assert overlay_count([lower, lower], (1, 1)) == 7
