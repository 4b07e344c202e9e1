"""From tolerance to rays, elements and thresholds: never less for a finer one, each threshold where it is asked."""

from types import SimpleNamespace

import numpy as np
import pytest

from lib.radiosity.quality import FEW_CELLS, first_level, gather_rays, quality
from lib.radiosity.refine import rays_for
from lib.radiosity.thresholds import own_share, thresholds

TOLERANCES = np.geomspace(0.002, 0.1, 60)
SETTINGS = {"tolerance": 0.01, "tolerances": {}, "t_direct": 0.025, "t_indirect": 0.05, "relative_to": "scene"}


def test_a_finer_tolerance_never_asks_for_less():
    steps = [quality(t) for t in TOLERANCES]
    for coarse, fine in zip(steps[1:], steps[:-1], strict=True):
        assert fine.n_elements >= coarse.n_elements and fine.gather_rays >= coarse.gather_rays
        assert fine.shadow_rays[1] >= coarse.shadow_rays[1] and fine.shadow_rays[0] <= fine.shadow_rays[1]
        assert fine.chart_effort >= coarse.chart_effort
        assert fine.t_direct < coarse.t_direct and fine.t_indirect < coarse.t_indirect


def test_what_the_elements_see_is_the_same_for_all_tolerances():
    """So that a changed tolerance neither samples again nor shoots."""
    first = {(q.rays_per_element, q.first_shadow_rays, q.base_direct) for q in map(quality, TOLERANCES)}
    assert len(first) == 1
    assert len({(q.n_elements, q.rays_per_element) for q in map(quality, TOLERANCES)}) == 1


@pytest.mark.parametrize("tolerance", [0.002, 0.01, 0.1])
@pytest.mark.parametrize("top", [3, 6, 9])
def test_the_numbers_fit_their_stages(tolerance, top):
    q = quality(tolerance, top)
    assert q.top == top and q.gather_rays % 16 == 0 and 16 <= q.gather_rays <= 8192
    assert q.as_dict()["shadow_rays"] == q.shadow_rays


def test_meshes_get_less_above_the_standard_tolerance_alone():
    assert [quality(t).chart_effort for t in (0.002, 0.01, 0.014, 0.1)] == [1, 1, 0.5, 0.5]
    assert [quality(t, mesh_cells=1e6).chart_effort for t in (0.002, 0.01, 0.014, 0.1)] == [1, 1, 0.25, 0.25]


def test_large_meshes_end_coarser_above_the_standard_tolerance_alone():
    """Four times the cells, one level more: what is left is bounded, as far as charts allow."""
    cells = [0, FEW_CELLS, 1.01 * FEW_CELLS, 4 * FEW_CELLS, 4.01 * FEW_CELLS, 1e9]
    assert [quality(0.014, mesh_cells=n).chart_coarser for n in cells] == [0, 0, 1, 1, 2, 2]
    assert [quality(t, mesh_cells=1e9).chart_coarser for t in (0.002, 0.01)] == [0, 0]


def test_rays_for_a_ratio_of_tolerances():
    """Half the tolerance takes at least the 2^1.25 times the rays that errors falling like rays^-0.8 need."""
    assert gather_rays(100, 1.0) == 100
    assert gather_rays(100, 0.5) >= 100 * 2**1.25
    ratios = np.geomspace(0.1, 10, 50)
    assert (np.diff(gather_rays(100, ratios)) < 0).all()


def solution(mean_H=(4.0, 2, 1), H_surface=((8, 0, 0), (0, 0, 0), (0, 2, 1))):
    return SimpleNamespace(mean_H=np.array(mean_H, float), H_surface=np.array(H_surface, float))


def test_thresholds_are_shares_of_the_brightest_channel():
    own = own_share(["a", "b", "c"], SETTINGS)
    assert own.tolist() == [1, 1, 1]
    assert thresholds(solution(), own, "direct", SETTINGS) == pytest.approx({0: 0.1, 1: 0.1, 2: 0.1})
    assert thresholds(solution(), own, "indirect", SETTINGS) == pytest.approx({0: 0.2, 1: 0.2, 2: 0.2})


def test_surfaces_with_a_tolerance_of_their_own():
    settings = SETTINGS | {"tolerances": {"b": 0.02, "nobody": 9}}
    tau = thresholds(solution(), own_share(["a", "b", "c"], settings), "direct", settings)
    assert tau == pytest.approx({0: 0.1, 1: 0.2, 2: 0.1})


def test_thresholds_relative_to_the_surface():
    """A surface without light of its own takes the scene's."""
    settings = SETTINGS | {"relative_to": "surface"}
    tau = thresholds(solution(), own_share(["a", "b", "c"], settings), "direct", settings)
    assert tau == pytest.approx({0: 0.2, 1: 0.1, 2: 0.05})


def test_no_light_divides_nothing():
    tau = thresholds(solution((0, 0, 0), np.zeros((2, 3))), own_share(["a", "b"], SETTINGS), "direct", SETTINGS)
    assert tau == {0: np.inf, 1: np.inf}


def test_rays_grow_with_the_cell_and_with_the_contrast_around():
    K = np.full(20, 256.0)
    cells, contrasts = np.geomspace(1e-3, 1, 20), np.geomspace(1e-3, 10, 20)
    for rays in (rays_for(cells, np.full(20, 0.6), K), rays_for(np.full(20, 0.125), contrasts, K)):
        assert (np.diff(rays) >= 0).all() and rays[0] < rays[-1]
        assert (rays % 16 == 0).all() and rays.min() >= 32 and rays.max() <= 4 * 256
    assert abs(rays_for(np.array([0.125]), np.array([0.6]), np.array([256.0]))[0] - 256) <= 16


def test_cells_too_small_for_the_light_may_get_fewer_than_the_least():
    """By their area to the power 1 / 2.6; cells that are not tiny the same as ever."""
    tiny, K = np.array([1.0, 4.0, 1 / 4, 1 / 16]), np.full(4, 6400.0)
    rays = rays_for(np.full(4, 1e-5), np.full(4, 0.6), K, tiny)
    assert rays[0] == rays[1] == rays_for(np.array([1e-5]), np.array([0.6]), K[:1])[0] >= 640
    assert rays[0] > rays[2] > rays[3] >= 16
    assert rays[3] == pytest.approx(800 * 16 ** (-2 / 2.6), rel=0.3)


def test_a_sample_never_gets_no_ray():
    cells, contrast = np.array([1e-4, 1e-3, 0.1]), np.array([0.01, 0.1, 1.0])
    for K in (16.0, 32.0, 960.0):
        for tiny in (1.0, np.full(3, 1e-3)):
            assert (rays_for(cells, contrast, np.full(3, K), tiny) >= 16).all()


def test_trees_begin_a_level_coarser_for_half_the_side():
    assert first_level([2.0, 0.25, 0.125, 0.0625, 0.03, 1e-6, 0.0], 4).tolist() == [4, 4, 3, 2, 1, 1, 1]
    assert first_level(0.125, 3) == 2
