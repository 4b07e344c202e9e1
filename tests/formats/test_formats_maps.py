"""Light maps and textured maps as files: there and back, and refused when unsound."""

import dataclasses

import numpy as np
import pytest

from lib.formats import light_maps, textured_maps
from lib.formats.artefact import ArtefactError
from lib.maps.mapset import pack


def some_maps(channels, surface=(1, 4), level=(1, 2)):
    rng = np.random.default_rng(0)
    sides = [(2**n + 1, 2 * 2**n + 1) for n in level]
    maps, hidden = [rng.random((*s, *channels)) for s in sides], [rng.random(s) < 0.2 for s in sides]
    return pack(surface, [[2, 1]] * 2, level, maps, hidden)


def textured(surface=(1, 4), names=("a", "b")):
    return textured_maps.TexturedMaps(
        list(names),
        some_maps((3,), surface),
        some_maps((3,), surface, (3, 2)),
        np.array([[0, 0, 0], [1, 2, 3.0]]),
        np.array([[0.5, 0.5, 0.5], [0, 0, 0]]),
        np.array([True, False]),
        {"12ab": [640, 480]},
        {names[0]: {"seconds": 1.5}},
    )


def same(one, two):
    return all(np.array_equal(getattr(one, f), getattr(two, f)) for f in light_maps.FIELDS)


def test_light_maps_there_and_back(tmp_path):
    x = light_maps.LightMaps(some_maps((2, 3)), {"wall": {"error": 0.01}})
    light_maps.save(tmp_path / "a.npz", x)
    y = light_maps.load(tmp_path / "a.npz")
    assert same(x.maps, y.maps) and y.stats == x.stats
    data = (tmp_path / "a.npz").read_bytes()
    light_maps.save(tmp_path / "a.npz", x)
    assert (tmp_path / "a.npz").read_bytes() == data


def test_textured_maps_there_and_back(tmp_path):
    x = textured()
    textured_maps.save(tmp_path / "a.npz", x)
    y = textured_maps.load(tmp_path / "a.npz")
    assert same(x.light, y.light) and same(x.final, y.final) and y.names == x.names
    assert np.array_equal(x.E, y.E) and np.array_equal(x.rho_avg, y.rho_avg) and np.array_equal(x.textured, y.textured)
    assert y.pictures == x.pictures and y.stats == x.stats


def test_chunks_merge_by_surface_in_any_order():
    a, b = textured((1, 4), "ad"), textured((2, 3), "bc")
    one, two = textured_maps.merge([a, b]), textured_maps.merge([b, a])
    assert one.names == two.names == ["a", "b", "c", "d"]
    assert same(one.final, two.final) and np.array_equal(one.E, two.E) and one.E[1:3].tolist() == b.E.tolist()
    assert one.textured.tolist() == [True, True, False, False] and set(one.stats) == {"a", "b"}
    textured_maps.check(one)


@pytest.mark.parametrize(
    "change, word",
    [
        ({"names": ["a"]}, "light|final"),
        ({"E": np.full((2, 3), -1.0)}, "E"),
        ({"rho_avg": np.full((2, 3), 1.2)}, "rho_avg"),
        ({"textured": np.zeros(2)}, "textured"),
        ({"final": some_maps((3,), (1, 5))}, "final"),
        ({"light": some_maps((1, 3))}, "light"),
    ],
)
def test_unsound_maps_are_not_written(change, word, tmp_path):
    with pytest.raises(ArtefactError, match=f"a.npz: ({word})"):
        textured_maps.save(tmp_path / "a.npz", dataclasses.replace(textured(), **change))
    assert not list(tmp_path.iterdir())


def test_nan_names_the_surface_and_is_not_written(tmp_path):
    maps = some_maps((1, 3))
    maps.value[-1] = np.nan
    with pytest.raises(ArtefactError, match="a.npz: .*not finite .surface 4"):
        light_maps.save(tmp_path / "a.npz", light_maps.LightMaps(maps))
    assert not list(tmp_path.iterdir())


def test_a_file_of_another_kind_or_cut_is_refused(tmp_path):
    light_maps.save(tmp_path / "a.npz", light_maps.LightMaps(some_maps((1, 3))))
    with pytest.raises(ArtefactError, match="a.npz: .*expected textured_maps"):
        textured_maps.load(tmp_path / "a.npz")
    data = (tmp_path / "a.npz").read_bytes()
    for cut in (len(data) // 2, len(data) - 1, 0):
        (tmp_path / "a.npz").write_bytes(data[:cut])
        with pytest.raises(ArtefactError, match="a.npz"):
            light_maps.load(tmp_path / "a.npz")
    flipped = bytearray(data)
    flipped[len(data) // 2] ^= 1
    (tmp_path / "a.npz").write_bytes(bytes(flipped))
    with pytest.raises(ArtefactError, match="a.npz"):
        light_maps.load(tmp_path / "a.npz")
