"""Stage balance_resample, and what holds of the maps it ends the radiosity with: invariances, exact zeros, sums."""

from pathlib import Path

import numpy as np
import pytest

from lib.formats import light_maps, trees
from lib.maps.resample import resample
from lib.nurbs.shape import transformed
from tests.rooms import Baked, baked, cube, scene_of
from tests.shapes import cylinder, rectangle, sphere
from tests.tolerances import LINEAR, MOVED, SCALED

RHO = {"ball": [0.8, 0.5, 0.2], "floor": 0.5, "wall": [0.2, 0.6, 0.7]}


def still_life(E=(3.0, 2.0, 1.0), M=None, window=None):
    """A ball over a floor before a wall, a lamp above; everything mapped by M (4, 4); a second lamp of a group."""
    ball = np.diag([0.15, 0.15, 0.15, 1.0])
    ball[:3, 3] = 0.5, 0.5, 0.3
    x = {
        "ball": (transformed(sphere(), ball), {}),
        "floor": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {}),
        "lamp": (rectangle([0.4, 0.6, 1], [0.2, 0, 0], [0, -0.2, 0]), {"E": E, "is_black": True}),
        "wall": (rectangle([0, 0, 0], [0, 1, 0], [0, 0, 1]), {}),
    }
    if window is not None:
        x["window"] = rectangle([0.3, 1, 0.3], [0.4, 0, 0], [0, 0, 0.4]), {"E": 2.0, "group": window, "is_black": True}
    if M is not None:
        x = {name: (transformed(surface, M), facts) for name, (surface, facts) in x.items()}
    return x


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    bake = Baked(tmp_path_factory.mktemp("one"), scene_of(still_life()), RHO).all()
    return bake, bake.maps()


def assert_same_maps(found, expected, tolerance):
    """RMS difference of each map, in units of the scene's mean: a ray that grazes an edge may fall on either side."""
    mean = np.concatenate([H.reshape(-1) for H, _ in expected.values()]).mean()
    assert sorted(found) == sorted(expected)
    for name, (H, hidden) in expected.items():
        assert found[name][0].shape == H.shape
        assert np.sqrt(((found[name][0] - H) ** 2).mean()) <= tolerance * mean
        assert (found[name][1] == hidden).all()


def test_every_surface_that_receives_has_a_map(one):
    bake, maps = one
    assert sorted(maps) == ["ball", "floor", "wall"]
    for H, hidden in maps.values():
        assert H.dtype == np.float32 and (H >= 0).all() and H.max() > 0 and not hidden.any()
    x = light_maps.load(bake.path("maps", 0))
    w, h = x.maps.sizes()
    assert (w == x.maps.roots[:, 0] * 2**x.maps.level + 1).all() and (h > 1).all()


def test_maps_are_the_sum_of_both_resampled_trees(one):
    """At the samples that both trees measured: direct + indirect, to rounding."""
    bake, maps = one
    direct, indirect = (trees.load(bake.path(half, 0), half)[0] for half in ("direct", "indirect"))
    for s, tree in direct.items():
        H = maps[bake.scene.names[s]][0]
        whole = [resample(*t.dense())[0] for t in (tree, indirect[s])]
        n = min(a.shape[0] for a in (*whole, H)) - 1
        a, b, c = (x[:: (len(x) - 1) // n, :: (len(x) - 1) // n] for x in (*whole, H))
        assert c == pytest.approx(a + b, rel=1e-5)


def test_figures_of_the_surfaces(one):
    bake, maps = one
    stats = light_maps.load(bake.path("maps", 0)).stats
    assert sorted(stats) == ["ball", "floor", "wall"]
    for name, figures in stats.items():
        H, hidden = maps[name]
        assert figures["texels"] == H.shape[0] * H.shape[1] and figures["hidden"] == hidden.sum()
        assert figures["mean_H"] == pytest.approx(H.sum(axis=2).mean(axis=(0, 1)).tolist(), rel=1e-5)
        assert figures["samples_direct"] > 0 and figures["samples_indirect"] > 0 and figures["error"] > 0


def test_three_chunks_hold_what_one_holds(one, tmp_path):
    bake = Baked(tmp_path, scene_of(still_life()), RHO, chunks=3).all()
    merged = light_maps.merge([light_maps.load(bake.path("maps", c)) for c in (2, 0, 1)])
    whole = light_maps.load(one[0].path("maps", 0))
    assert merged.maps.value.tobytes() == whole.maps.value.tobytes()
    assert merged.maps.level.tolist() == whole.maps.level.tolist() and merged.stats == whole.stats


def test_the_same_bytes_again(one, tmp_path):
    again = Baked(tmp_path, scene_of(still_life()), RHO).all()
    assert Path(again.path("maps", 0)).read_bytes() == Path(one[0].path("maps", 0)).read_bytes()


def test_surfaces_in_another_order_are_the_same_scene(one, tmp_path):
    """And a new surface that nobody sees, inside the ball, renumbers the others without a change of their draws."""
    backwards = dict(reversed(still_life().items()))
    assert_same_maps(baked(tmp_path / "a", backwards, RHO), one[1], 0)
    inside = {"a coin": (rectangle([0.48, 0.48, 0.3], [0.04, 0, 0], [0, 0.04, 0]), {"role": "cast_only"})}
    assert_same_maps(baked(tmp_path / "b", inside | still_life(), RHO), one[1], LINEAR)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_the_size_of_the_world_changes_nothing(one, tmp_path, scale):
    M = np.diag([scale, scale, scale, 1.0])
    assert_same_maps(baked(tmp_path, still_life(M=M), RHO), one[1], SCALED)


def test_a_world_far_away_is_the_same(one, tmp_path):
    M = np.eye(4)
    M[:3, 3] = 1e5, -1e5, 1e5
    assert_same_maps(baked(tmp_path, still_life(M=M), RHO), one[1], MOVED)


def test_a_turned_world_is_the_same_within_its_noise(one, tmp_path):
    """Other directions are drawn: means of maps agree, texels within some per cent of the brightest."""
    M = np.array([[0.36, 0.48, -0.8, 0], [-0.8, 0.6, 0, 0], [0.48, 0.64, 0.6, 0], [0, 0, 0, 1]])
    found = baked(tmp_path, still_life(M=M), RHO)
    for name, (H, _) in one[1].items():
        assert found[name][0].mean() == pytest.approx(H.mean(), rel=0.03)


@pytest.mark.parametrize("k", [2.0**-30, 1e-6, 3.0, 1e6])
def test_light_times_k_is_maps_times_k(one, tmp_path, k):
    found = baked(tmp_path, still_life(E=np.array([3.0, 2, 1]) * k), RHO)
    assert_same_maps({name: (H.astype(float) / k, hidden) for name, (H, hidden) in found.items()}, one[1], LINEAR)


def test_groups_add_up_to_all_lamps_at_once(tmp_path):
    apart = baked(tmp_path / "a", still_life(window=1), RHO)
    together = baked(tmp_path / "b", still_life(window=0), RHO)
    assert all(H.shape[2] == 2 for H, _ in apart.values())
    added = {name: (H.sum(axis=2, keepdims=True), hidden) for name, (H, hidden) in apart.items()}
    assert_same_maps(added, together, 2e-3)


def test_a_group_of_its_own_is_that_lamp_alone(one, tmp_path):
    """Group 0 of two lamps against a bake with the first lamp alone, within the noise of other trees."""
    apart = baked(tmp_path, still_life(window=1), RHO)
    for name, (H, _) in one[1].items():
        assert apart[name][0][:, :, 0].mean() == pytest.approx(H.mean(), rel=0.03)


def test_no_emission_is_exactly_nothing(tmp_path):
    maps = baked(tmp_path, still_life(E=0.0), RHO)
    assert sorted(maps) == ["ball", "floor", "wall"]
    for H, _ in maps.values():
        assert not H.any() and min(H.shape[:2]) == 2  # and no more texels than the roots have


def test_an_even_wall_ends_tiny_and_a_shadow_does_not(tmp_path):
    assert all(H.shape[:2] == (2, 2) for H, _ in baked(tmp_path / "a", cube(1.0, E=1.0), 0.5).values())
    screen = {"screen": (rectangle([0.2, 0.2, 0.3], [0.3, 0, 0], [0, 0.6, 0]), {})}
    assert min(baked(tmp_path / "b", still_life() | screen, RHO)["floor"][0].shape[:2]) == 17


def test_thin_surfaces_work(tmp_path):
    """A strip a millionth wide in the light: finite, and as bright as the floor beside it."""
    strip = {"strip": (rectangle([0.1, 0.1, 0.0], [0.8, 0, 0], [0, 1e-6, 0]), {})}
    maps = baked(tmp_path, still_life() | strip, RHO)
    H = maps["strip"][0]
    assert np.isfinite(H).all() and H.max() > 0


def test_interpenetrating_things_are_finite(tmp_path):
    """A tube through the floor: hidden below, lit above, nothing negative or NaN."""
    through = np.eye(4)
    through[:3, 3] = 0.2, 0.2, -0.5
    tube = {"tube": (transformed(cylinder(0.1, 1.0), through), {})}
    maps = baked(tmp_path, still_life() | tube, RHO | {"tube": 0.5})
    assert all(np.isfinite(H).all() and (H >= 0).all() for H, _ in maps.values())
    H = maps["tube"][0]  # v goes up
    assert H[-1].max() > 10 * H[0].max()


@pytest.mark.parametrize("name", ["solution", "direct_0", "indirect_0", "scene"])
def test_damaged_files_are_refused_by_name(one, tmp_path, capsys, name):
    bake = Baked(tmp_path, scene_of(still_life()), RHO)
    for file in ("scene", "solution", "direct_0", "indirect_0"):
        (tmp_path / f"{file}.npz").write_bytes((one[0].folder / f"{file}.npz").read_bytes())
    path = tmp_path / f"{name}.npz"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)
    assert bake.balance_resample(0) == 1
    said = capsys.readouterr().err
    assert str(path) in said and len(said.strip().splitlines()) == 1
    assert not (tmp_path / "maps_0.npz").exists()
