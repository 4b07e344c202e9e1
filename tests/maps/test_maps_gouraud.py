"""Light in vertices, and the numbers between radiosity and screen."""

import numpy as np
import pytest

from lib.maps import display, exposure, gouraud, mapset


def test_values_at_vertices_are_bilinear():
    v, u = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 7), indexing="ij")
    value = np.stack([1 + 2 * u, 3 - v, u * 0 + 5], axis=2)
    UV = np.array([[0, 0], [1, 1], [0.5, 1 / 3], [0.123, 0.777]])
    assert np.allclose(gouraud.at(value, UV), np.stack([1 + 2 * UV[:, 0], 3 - UV[:, 1], UV[:, 0] * 0 + 5], axis=1))


def test_vertices_must_lie_on_every_line_of_the_lattice():
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    middle = np.array([[1 / 3, 0], [2 / 3, 1]])
    assert gouraud.holds_lattice(corners, 2, 2)
    assert not gouraud.holds_lattice(corners, 4, 2)
    assert gouraud.holds_lattice(np.concatenate([corners, middle]), 4, 2)
    assert not gouraud.holds_lattice(np.concatenate([corners, middle]), 2, 3)


def test_a_twisted_cell_shows_its_diagonal():
    flat = np.array([[0.2, 0.4], [0.3, 0.5]])[..., None].repeat(3, axis=2)
    assert gouraud.is_untwisted(flat)
    twisted = flat.copy()
    twisted[1, 1, 1] += 0.05  # 0.0125 off in the middle: 2.6 of 255 there
    assert not gouraud.is_untwisted(twisted)


def test_mean_irradiance_is_weighted_by_area_and_leaves_out_what_does_not_reflect():
    maps = mapset.pack(
        [0, 1, 2],
        [[1, 1]] * 3,
        [0, 0, 0],
        [np.full((2, 2, 3), 1.0), np.full((2, 2, 3), 4.0), np.zeros((2, 2, 3))],
        [np.zeros((2, 2), bool), np.array([[True, False], [False, False]]), np.zeros((2, 2), bool)],
    )
    rho = np.array([[0.5, 0.5, 0.5], [0.5, 1.0, 0.25], [0.0, 0.0, 0.0]])
    H = display.mean_irradiance(maps, rho, np.array([3.0, 1.0, 9.0]))
    assert H == pytest.approx([(3 * 2 + 8) / 4, (3 * 2 + 4) / 4, (3 * 2 + 16) / 4])


def test_light_is_radiance_times_exposure():
    assert display.light([np.pi, 2 * np.pi], 0.25).tolist() == [0.25, 0.5]
    hidden = np.array([[False, True], [False, False]])
    value = np.full((2, 2, 3), np.pi, np.float32)
    value[0, 1] = 0
    assert np.allclose(display.picture(value, hidden, np.array([np.pi, 0, 0]), 0.25), [0.5, 0.25, 0.25])


def test_exposure_weighs_samples_by_area():
    """99 of 100 parts of the area shine with pi, the rest is brighter: white is where the rest begins."""
    maps = mapset.pack([0, 1], [[1, 1]] * 2, [2, 0], [np.full((5, 5, 3), np.pi), np.full((2, 2, 3), 8 * np.pi)])
    assert exposure.automatic(maps, np.array([99.5, 0.5])) == pytest.approx(1.0)
    assert exposure.automatic(maps, np.array([98.0, 2.0])) == pytest.approx(1 / 8)
