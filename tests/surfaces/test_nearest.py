"""The nearest point, against all distances."""

import numpy as np
import pytest

from lib.surfaces.nearest import Nearest


def all_distances(points, places):
    return np.argmin(((points[None] - places[:, None]) ** 2).sum(axis=2), axis=1)


@pytest.mark.parametrize("n", [1, 2, 7, 300, 5000])
@pytest.mark.parametrize("kind", ["spread", "a circle", "one corner"])
def test_it_is_that_of_all_distances(n, kind):
    rng = np.random.default_rng(n)
    points = rng.uniform(size=(n, 2))
    if kind == "a circle":
        points = 0.5 + 0.4 * np.stack([np.cos(7 * points[:, 0]), np.sin(7 * points[:, 0])], axis=1)
    if kind == "one corner":
        points = 0.01 * points
    places = np.concatenate([rng.uniform(size=(400, 2)), rng.uniform(-0.2, 1.2, size=(200, 2)), points[:5]])
    assert (Nearest(points)(places) == all_distances(points, places)).all()


def test_of_points_as_near_it_is_the_first():
    points = np.array([[0.75, 0.5], [0.25, 0.5], [0.5, 0.25], [0.25, 0.5]])
    assert Nearest(points)(np.array([[0.5, 0.5], [0.2, 0.5]])).tolist() == [0, 1]
    grid = np.stack(np.meshgrid(np.arange(9) / 8, np.arange(9) / 8), axis=-1).reshape(-1, 2)
    middles = (grid[:-10] + 1 / 16)[np.arange(len(grid) - 10) % 9 < 8]
    assert (Nearest(grid)(middles) == all_distances(grid, middles)).all()
