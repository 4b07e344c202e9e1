"""Points and figures of the comparison with much finer bakes, on shapes that can be drawn."""

import numpy as np
import pytest

from benchmarks import own_reference
from lib.maps.mapset import pack
from lib.surfaces.frames import frame
from tests.rooms import casters_of, scene_of
from tests.shapes import rectangle, sphere
from tests.tolerances import STANDARD_ERRORS


def test_points_are_even_over_area_and_lie_on_the_surface():
    wide = rectangle([0, 0, 0], [3, 0, 0], [0, 1, 0])
    c = casters_of(scene_of({"a": (wide, {}), "b": (sphere(1.0), {})}))
    n = 20000
    surface, uv = own_reference.spread(c.V, c.UV, c.F, c.face_surface, n, np.random.default_rng(1))
    share = 3 / (3 + 4 * np.pi)
    assert abs((surface == 0).mean() - share) < STANDARD_ERRORS * np.sqrt(share * (1 - share) / n) + 0.005  # facets
    assert uv.min() >= 0 and uv.max() <= 1
    on_wide = uv[surface == 0]
    assert np.abs(on_wide.mean(axis=0) - 0.5).max() < STANDARD_ERRORS * np.sqrt(1 / 12 / len(on_wide))
    # A ball's area is even over its height: half of it is within 30 degrees of the equator.
    z = frame(sphere(1.0), uv[surface == 1])[0][:, 2]
    assert abs((np.abs(z) < 0.5).mean() - 0.5) < 0.02


def test_hidden_is_what_the_nearest_texel_is():
    hidden = np.zeros((3, 5), dtype=bool)
    hidden[2, 1] = True
    maps = pack([4], [(2, 1)], [1], [np.zeros((3, 5, 3), np.float32)], [hidden])
    uv = np.array([[0.25, 1.0], [0.36, 0.8], [0.39, 1.0], [0.25, 0.7]])
    found = own_reference.are_hidden(maps, np.full(4, 4), uv)
    assert found.tolist() == [True, True, False, False]


def test_errors_by_surface_add_up_and_the_noise_of_the_truth_is_taken_off():
    rng = np.random.default_rng(1)
    n, noise = 50000, 0.2
    light = np.full((n, 3), 2.0)
    E, se = own_reference.truth([light + noise * rng.normal(size=light.shape) for _ in range(2)])
    names = np.where(np.arange(n) % 4 == 0, "a", "b").astype(object)
    H = light + np.where(names == "a", 0.3, 0.1)[:, None]
    rows = {row["surface"]: row for row in own_reference.by_surface(H, E, se, names)}
    assert rows["a"]["rmse"] == pytest.approx(0.15, rel=0.02) and rows["b"]["rmse"] == pytest.approx(0.05, rel=0.05)
    assert rows["a"]["error"] == pytest.approx(0.25 * 0.09 / (0.25 * 0.09 + 0.75 * 0.01), rel=0.02)
    assert own_reference.score.errors(H, E, se)["rmse"] == pytest.approx(
        np.sqrt(0.25 * 0.09 + 0.75 * 0.01) / 2, rel=0.02
    )


@pytest.mark.parametrize("rmse, holds", [(0.0066, False), (0.0067, True), (0.015, True), (0.0151, False)])
def test_an_error_is_missed_on_either_side(rmse, holds):
    assert own_reference.is_within({"tolerance": 0.01, "rmse": rmse}) == holds
