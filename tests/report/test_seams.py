"""Steps between two maps along a shared border, by hand."""

import numpy as np
import pytest

from lib.maps.mapset import pack
from lib.report import seams


def ramp(n, low, high):
    return np.repeat(np.linspace(low, high, n)[:, None], 3, axis=1)


def test_a_ramp_read_at_two_resolutions_has_no_step():
    seen = [np.zeros(n, bool) for n in (5, 9)]
    assert seams.step((ramp(5, 0, 1), seen[0]), (ramp(9, 0, 1), seen[1]), False) == pytest.approx((0, 0), abs=1e-12)
    assert seams.step((ramp(5, 0, 1), seen[0]), (ramp(9, 1, 0), seen[1]), True) == pytest.approx((0, 0), abs=1e-12)
    assert seams.step((ramp(5, 0, 1), seen[0]), (ramp(9, 1, 0), seen[1]), False) == pytest.approx(
        (1, np.sqrt((np.linspace(-1, 1, 9) ** 2).mean()))
    )


def test_hidden_samples_are_left_out():
    hidden = np.array([False, False, False, False, True])
    second = ramp(5, 0, 1)
    second[4] = 100
    assert seams.step((ramp(5, 0, 1), hidden), (second, np.zeros(5, bool)), False) == (0, 0)
    assert np.isnan(seams.step((second, np.ones(5, bool)), (second, np.zeros(5, bool)), False)).all()


def test_sides_of_a_map_are_its_first_and_last_rows_and_columns():
    value = np.arange(6.0).reshape(2, 3, 1)  # rows v = 0: 0 1 2, v = 1: 3 4 5
    hidden = np.zeros((2, 3), bool)
    assert [seams.line(value, hidden, s)[0].ravel().tolist() for s in range(4)] == [
        [0, 3],
        [2, 5],
        [0, 1, 2],
        [3, 4, 5],
    ]
    assert [np.unique(seams.border_uv(s)[s // 2]).tolist() for s in range(4)] == [[0], [1], [0], [1]]


def test_smooth_means_within_ten_degrees():
    up = np.array([[0.0, 0, 1]] * 3)
    for degrees, expected in ((9, True), (11, False)):
        a = np.radians(degrees)
        assert seams.is_smooth(up, np.array([[0, np.sin(a), np.cos(a)]] * 3)) is expected


def test_exported_radiosity_is_divided_by_its_reflectance_and_textured_maps_are_left_out():
    B = [np.full((2, 2, 3), 3.0), np.full((2, 2, 3), 5.0)]
    maps = pack([4, 7], [[1, 1]] * 2, [0, 0], B)
    H = seams.exported_irradiance(maps, np.array([[0.5, 1, 0], [1, 1, 1]]), np.array([False, True]))
    assert H.surface.tolist() == [4]
    assert H.map(0)[0, 0].tolist() == [[6, 3, 0]]
