"""Light in vertices, and the numbers between radiosity and screen."""

import numpy as np
import pytest

from lib.maps import display, estimate, exposure, gouraud, mapset


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


def test_mean_radiosity_is_weighted_by_area_and_leaves_hidden_samples_out():
    hidden = [np.zeros((2, 2), bool), np.array([[True, False], [False, False]])]
    four = np.full((2, 2, 3), 4.0)
    four[0, 0] = 0
    maps = mapset.pack([0, 1], [[1, 1]] * 2, [0, 0], [np.full((2, 2, 3), 1.0), four], hidden)
    assert display.mean_radiosity(maps, np.array([3.0, 1.0])) == pytest.approx([7 / 4] * 3)


def test_estimated_light_is_the_lamps_and_the_mean():
    """A small lamp of area 0.01 at height 2: H = E A cos cos / (pi r^2); nothing from behind, nor behind the lamp."""
    A, B, C = np.array([[[0, 0, 2.0]], [[0, 0.1, 2]], [[0.2, 0, 2]]])  # shines down
    x = np.array([[0, 0, 0], [0, 0, 0], [2, 0, 0], [0, 0, 4.0]])
    N = np.array([[0, 0, 1], [0, 0, -1], [0, 0, 1], [0, 0, -1.0]])
    H = estimate.irradiance(x, N, A, B, C, np.array([[100.0, 50, 0]]), np.array([0.1, 0.2, 0.3]))
    below, aside = 0.01 / (np.pi * 4), 0.01 * 0.25 / (np.pi * (2**2 + 2**2)) * 2  # cos^2 = 1/2
    assert H[0] == pytest.approx([100 * below + 0.1, 50 * below + 0.2, 0.3], rel=0.02)
    assert H[1] == pytest.approx([0.1, 0.2, 0.3]) and H[3] == pytest.approx([0.1, 0.2, 0.3])
    assert H[2, 0] - 0.1 == pytest.approx(100 * aside, rel=0.1)
    assert (
        estimate.irradiance(x, N, A[:0], B[:0], C[:0], np.empty((0, 3)), np.ones(3)).tolist()
        == np.ones((4, 3)).tolist()
    )


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


def test_exposure_is_that_of_all_samples_in_order():
    rng = np.random.default_rng(8)
    maps = mapset.pack([0, 1], [[3, 2], [1, 1]], [4, 5], [rng.random((33, 49, 3)), 2 * rng.random((33, 33, 3))])
    weight = np.repeat([3.0 / 33 / 49, 1.0 / 33 / 33], [33 * 49, 33 * 33])
    top = maps.value.max(axis=1)
    order = np.argsort(top)
    at = np.searchsorted(np.cumsum(weight[order]), 0.99 * weight.sum())
    assert exposure.automatic(maps, np.array([3.0, 1.0])) == pytest.approx(np.pi / top[order[at]], rel=1e-12)
