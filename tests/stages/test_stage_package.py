"""Stage package: what a viewer finds, colours, exposure, shared textures, leftovers."""

import dataclasses
import json

import numpy as np
import pytest

from lib.formats import casters, exported, scene, textured_maps
from lib.formats.artefact import read_json, write_json
from lib.formats.pictures import read_png8
from lib.maps import exposure, mapset
from stages import lod_export, package, tessellate
from tests.stages.test_stage_tessellate import small_scene

LEVELS = [{"deviation": "5 mm"}, 0.3]


def maps_of(x):
    """Constant light on the box, a ramp on the picture, a lamp of constant light as box/6; the ball has no map."""
    light = []
    for s in range(1, 8):
        w, h = (9 if s == 7 else 5), 5
        v, u = np.meshgrid(np.linspace(0, 1, h), np.linspace(0, 1, w), indexing="ij")
        light.append(np.stack([u, v, 0 * u], axis=2) if s == 7 else np.full((h, w, 3), 0.4))
    light[5] = 0 * light[5]
    hidden = [np.zeros(a.shape[:2], bool) for a in light]
    hidden[0][2:, 2:] = True  # box/1 partly buried: its dark texels may not show
    light[0] = light[0] * np.linspace(1, 2, 5)[None, :, None]
    light[0][hidden[0]] = 0
    packed = mapset.pack(np.arange(1, 8), [[1, 1]] * 6 + [[2, 1]], [2] * 7, light, hidden)
    rho = np.full((7, 3), 0.5)
    return textured_maps.TexturedMaps(x.names[1:], packed, packed, x.E[1:], rho, np.zeros(7, bool))


@pytest.fixture
def files(tmp_path):
    x = small_scene()
    x.E[6] = [30.0, 20.0, 10.0]
    scene.save(tmp_path / "scene.npz", x)
    at = [str(tmp_path / name) for name in ("scene.npz", "casters.npz")]
    assert tessellate.main(["--scene", at[0], "--out", at[1]]) == 0
    for k in range(len(LEVELS)):
        argv = ["--scene", at[0], "--casters", at[1], "--level", json.dumps(LEVELS[k]), "--level-index", str(k)]
        argv += ["--finest", str(tmp_path / "lod_0.npz")] if k else []
        assert lod_export.main([*argv, "--out", str(tmp_path / f"lod_{k}.npz")]) == 0
    textured_maps.save(tmp_path / "textures.npz", maps_of(x))
    write_json(tmp_path / "materials.json", {"rho_avg": {name: [0.5, 0.5, 0.25] for name in x.names}})
    return tmp_path


def run(files, settings=None, n_levels=2, results="results", ways=None):
    """Package the files; ways: {surface index: reconstruction}, else "texture"."""
    settings = {**(settings or {}), "reconstruction": by_name(files, ways or {})}
    argv = []
    for option in ("scene", "casters", "textures"):
        argv += [f"--{option}", str(files / f"{option}.npz")]
    argv += ["--materials", str(files / "materials.json"), "--settings", json.dumps(settings)]
    argv += ["--lods", *(str(files / f"lod_{k}.npz") for k in range(n_levels))]
    argv += ["--budget", str(files / "budget.json")] if (files / "budget.json").exists() else []
    return package.main([*argv, "--results", str(files / results)]), files / results


def test_every_level_names_the_same_textures(files):
    status, results = run(files)
    assert status == 0
    uris = [[image["uri"] for image in read_json(results / f"scene_LOD{k}.gltf")["images"]] for k in (0, 1)]
    assert uris[0] == uris[1] == ["textures/001-surface.png", "textures/007-surface.png"]
    assert sorted(p.name for p in (results / "textures").iterdir()) == ["001-surface.png", "007-surface.png"]
    lods = read_json(results / "lods.json")
    assert [row["file"] for row in lods["levels"]] == ["scene_LOD0.gltf", "scene_LOD1.gltf"]
    assert lods["levels"][0]["triangles"] > lods["levels"][1]["triangles"]
    assert lods["levels"][0]["max_distance"] <= 5e-3 and lods["levels"][1]["gap"] == 0
    box = lods["levels"][0]["bounding_box"]
    assert np.allclose(box["min"], [0, 0, -1]) and np.allclose(box["max"], [1, 1.9, 1], atol=6e-3)  # y up
    assert lods["combined"]["bytes"] == (results / "scene.glb").stat().st_size


def test_colours(files):
    _, results = run(files, {"exposure": 2.0})
    parts, textures = exported.load(results / "scene.glb")
    by_name = {part.name: part for part in parts}
    assert len(parts) == 8
    even = 0.4 / np.pi * 2
    assert by_name["box/2"].texture == -1 and np.allclose(by_name["box/2"].factor, even)
    assert np.allclose(by_name["box/6"].factor, np.minimum(np.array([30, 20, 10]) / np.pi * 2, 1))  # the lamp glows
    picture = np.asarray(textures[by_name["picture"].texture].rgb, float)
    assert picture.shape == (5, 9, 3)
    v, u = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 9), indexing="ij")
    st = by_name["picture"].ST
    assert sorted(set(st[:, 0])) == pytest.approx([0.5 / 9, 8.5 / 9]) and sorted(set(st[:, 1])) == pytest.approx(
        [0.1, 0.9]
    )
    assert np.abs(picture[..., 0] - u / np.pi * 2).max() < 6e-3 and np.abs(picture[..., 1] - v / np.pi * 2).max() < 6e-3


def test_a_caster_without_map_is_drawn_in_its_own_colour(files):
    _, results = run(files, {"exposure": 1.0})
    [ball] = [p for p in exported.load(results / "scene_LOD0.gltf")[0] if p.name == "ball"]
    final = textured_maps.load(files / "textures.npz").final  # seven squares of equal area
    B = np.mean([final.map(k)[~final.hidden_map(k)].mean(axis=0) for k in range(7)], axis=0)
    ambient = [0.5, 0.5, 0.25] * B / np.pi
    assert ball.texture == -1 and np.allclose(ball.colour.min(axis=0), ambient, rtol=1e-6)
    # box/6, the lamp, is the side x = 1 of the box: it shines along +x, past the ball above it
    assert np.allclose(ball.colour.max(axis=0), ambient, rtol=1e-6)


def test_hidden_texels_are_filled(files):
    _, results = run(files)
    codes = read_png8(results / "textures" / "001-surface.png")
    assert codes.min() > 100  # the buried corner takes its neighbours' light, not black


def test_exposure_takes_the_brightest_reflected_percent_to_white(files):
    _, results = run(files)
    x, shapes = textured_maps.load(files / "textures.npz"), casters.load(files / "casters.npz")
    found = read_json(results / "lods.json")["exposure"]
    assert found == exposure.automatic(x.final, shapes.area[x.final.surface])
    assert 1 / found * np.pi == pytest.approx(1.0, abs=0.25)  # the ramp's bright end; the lamp does not count
    material = read_json(results / "scene_LOD0.gltf")["materials"][0]
    assert material["extras"]["moeller_bake"] == {"unit": "B_over_pi", "encoding": "srgb", "exposure": found}
    write_json(files / "budget.json", {"exposure": 2 * found})  # that of the textures before they were reduced
    used = [read_json(run(files, asked)[1] / "lods.json")["exposure"] for asked in ({}, {"exposure": 7})]
    assert used == [2 * found, 7]
    dark = mapset.pack([0], [[1, 1]], [0], [np.zeros((2, 2, 3))])
    assert exposure.automatic(dark, np.ones(1)) == 1.0


def by_name(files, ways):
    return {name: ways.get(s, "texture") for s, name in enumerate(scene.load(files / "scene.npz").names)}


def reconstruct(files, ways, level=2):
    """Store the maps again, cut the levels with them known; ways: {surface index: reconstruction}, else "texture"."""
    chosen = by_name(files, ways)
    maps = textured_maps.load(files / "textures.npz")
    if level == 0:
        corners = np.array([[[0.1, 0.1, 0.1], [0.3, 0.2, 0.1]], [[0.2, 0.2, 0.2], [0.4, 0.3, 0.2]]])
        packed = mapset.pack(np.arange(1, 8), [[1, 1]] * 7, [0] * 7, [corners] * 7)
        maps = dataclasses.replace(maps, light=packed, final=packed)
        textured_maps.save(files / "textures.npz", maps)
    argv = ["--scene", files / "scene.npz", "--casters", files / "casters.npz", "--textures", files / "textures.npz"]
    for k in range(len(LEVELS)):
        more = ["--level", json.dumps(LEVELS[k]), "--level-index", k, "--reconstruction", json.dumps(chosen)]
        more += ["--out", files / f"lod_{k}.npz"]
        assert lod_export.main([str(a) for a in (*argv, *more)]) == 0
    return maps


def test_gouraud_puts_the_map_into_vertices_on_its_lattice(files):
    maps = reconstruct(files, {7: "gouraud"})
    _, results = run(files, {"exposure": 2.0}, ways={7: "gouraud"})
    assert read_json(results / "lods.json")["in_vertices"] == ["ball", "picture"]
    assert [p.name for p in (results / "textures").iterdir()] == ["001-surface.png"]
    for k in (0, 1):
        [part] = [p for p in exported.load(results / f"scene_LOD{k}.gltf")[0] if p.name == "picture"]
        assert part.texture == -1 and part.ST is None and len(part.V) == 45 and len(part.F) == 64
        u, v = part.V[:, 0], part.V[:, 1]  # the picture stands in the plane of x and, y up, y
        i, j = np.rint(u * 8).astype(int), np.rint(v * 4).astype(int)
        assert np.allclose(part.colour, maps.final.map(6)[j, i] / np.pi * 2, atol=1e-6)


def test_auto_uses_vertices_only_where_nothing_shows(files):
    reconstruct(files, {1: "auto", 7: "auto"})
    _, results = run(files, ways={1: "auto", 7: "auto"})
    assert read_json(results / "lods.json")["in_vertices"] == ["ball"]
    reconstruct(files, {2: "auto", 7: "auto"}, level=0)
    _, results = run(files, ways={2: "auto", 7: "auto"})
    assert read_json(results / "lods.json")["in_vertices"] == ["ball", "box/2", "picture"]
    [part] = [p for p in exported.load(results / "scene.glb")[0] if p.name == "picture"]
    assert len(part.F) == 2 and part.colour is not None


def test_leftovers_of_an_earlier_run_go(files):
    _, results = run(files)
    (results / "textures" / "099-old.png").write_bytes(b"")
    _, results = run(files, n_levels=1)
    assert not (results / "scene_LOD1.gltf").exists() and not (results / "scene_LOD1.bin").exists()
    assert not (results / "textures" / "099-old.png").exists()
    assert len(read_json(results / "lods.json")["levels"]) == 1
    document = read_json(results / "scene_LOD0.gltf")
    assert "MSFT_lod" not in document["extensionsUsed"]


def test_same_bytes_twice(files):
    _, a = run(files)
    _, b = run(files, results="again")
    for path in sorted(p for p in a.rglob("*") if p.is_file()):
        assert path.read_bytes() == (b / path.relative_to(a)).read_bytes(), path.name


@pytest.mark.parametrize("value", [0, -1, "bright", True])
def test_a_wrong_exposure_is_refused(files, value, capsys):
    status, results = run(files, {"exposure": value})
    assert status == 1 and not results.exists()
    assert "export: exposure" in capsys.readouterr().err
