"""A scene whose lamps shine by pictures, from scene.yaml to the exported textures, through the stages' doors."""

import base64
import json
from types import SimpleNamespace

import numpy as np
import pytest

from lib.formats import exported, pictures, preflight, scene
from lib.formats.rule_settings import rule_settings
from lib.refusal import Refusal
from stages import (
    apply_base_texture,
    balance_resample,
    budget_reduce,
    import_scene,
    lod_export,
    package,
    refine,
    sample,
    shoot,
    tessellate,
)
from tests.maps.test_maps_emission import picture

SCENE = """geometry:
- {name: floor, rectangle: {origin: [-1, -1, 0], u: [2, 0, 0], v: [0, 2, 0]}}
- {name: screen, rectangle: {origin: [-0.5, 0.5, 1], u: [1, 0, 0], v: [0, -1, 0]}, material: screen}
- {name: print, rectangle: {origin: [-1, 1, 0.2], u: [2, 0, 0], v: [0, 0, 1]}, material: print}
materials:
  screen: {power: 6, emission_texture: half.png, colour: [1, 1, 0.5]}
  print: {texture: grey.png, emission: [0, 0.5, 0], emission_texture: half.png, colour_space: linear, group: glow}
bake: {max_level: 3, elements: 100, rays_per_element: 32, gather_rays: 32, shadow_rays: [4, 8], texture_level: 6}
export: {exposure: 0.5}
lods: [{deviation: 1 %}]
"""


def written(folder, text="rb", pixels=16):
    """The scene's folder, with a picture of squares of `text` and a grey one."""
    folder.mkdir(exist_ok=True)
    (folder / "scene.yaml").write_text(SCENE, encoding="utf-8")
    pictures.write_png_srgb(folder / "half.png", picture(text, pixels))
    pictures.write_png8(folder / "grey.png", np.full((4, 4, 3), 128, np.uint8))
    return folder


def run(folder, home, intensity=None):
    """What a run of the Snakefile does, in one process."""
    found = preflight.load(folder, None, home)
    settings = rule_settings(found.settings, [], found.tolerances, found.reconstruction)
    if intensity:
        settings["apply_base_texture"] = json.dumps({"texture_level": 6, "intensity": intensity})
    out = home / found.name
    file = lambda name: str(out / f"{name}.npz")  # noqa: E731
    chunk, both = ["--chunk", "0", "--chunks", "1"], ["--scene", file("scene"), "--casters", file("casters")]

    def door(stage, name, *argv):
        own = ["--settings", settings[name]] if name in settings and name != "lod_export" else []
        assert stage.main([*argv, *own]) in (0, None)

    door(import_scene, "", "--scene-slice", found.slices["geometry"], "--out", file("scene"))
    door(tessellate, "tessellate", "--scene", file("scene"), "--out", file("casters"))
    door(sample, "sample", *both, *chunk, "--out", file("samples"))
    materials = ["--materials", found.slices["materials"]]
    door(shoot, "shoot", *both, "--samples", file("samples"), *materials, "--out", file("solution"))
    light = {
        "direct": ["--samples", file("samples"), "--radiosity-out", file("radiosity")],
        "indirect": ["--direct", file("direct"), "--radiosity", file("radiosity")],
    }
    for half, files in light.items():
        given = ["--half", half, *files, "--solution", file("solution"), "--out", file(half)]
        door(refine, "refine", *both, *chunk, *given)
    halves = ["--direct", file("direct"), "--indirect", file("indirect"), "--solution", file("solution")]
    door(balance_resample, "balance_resample", "--scene", file("scene"), *halves, "--out", file("maps"))
    given = ["--textures", found.slices["textures"], "--maps-folder", str(out / "maps"), "--out", file("textured")]
    door(apply_base_texture, "apply_base_texture", *both[:2], "--maps", file("maps"), *materials, *given)
    tables = ["--table", str(out / "budget.json"), "--out", file("textures")]
    door(budget_reduce, "budget_reduce", "--maps", file("textured"), *both[2:], *tables)
    level = ["--level", json.dumps(found.settings["lods"][0]), "--level-index", "0"]
    door(lod_export, "lod_export", *both, *level, "--units", "m", "--out", file("lod"))
    given = ["--textures", file("textures"), "--budget", str(out / "budget.json"), "--lods", file("lod")]
    door(package, "package", *both, *materials, *given, "--results", str(out))
    return SimpleNamespace(found=found, out=out, scene=scene.load(file("scene")))


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    home = tmp_path_factory.mktemp("bake")
    return run(written(home / "room"), home / "results")


def shown(bake, name):
    """The exported texture of a surface in linear light, (h, w, 3), row 0 at the map's v = 0."""
    parts, textures = exported.load(bake.out / "scene_LOD0.gltf")
    part = next(part for part in parts if part.name == name)
    return textures[part.texture].rgb


def test_the_power_is_exact(bake):
    """6 W, of which red and blue as their pictures and colours have it: 2 : 1."""
    k = bake.scene.names.index("screen")
    assert bake.scene.E[k] == pytest.approx([4.0, 0, 2.0], rel=1e-12)
    assert bake.scene.E[bake.scene.names.index("print")] == pytest.approx([0, 0, 0])  # green times red and blue
    assert list(bake.scene.glow) == [k]


def test_the_screen_shows_its_picture_and_no_light_map(bake):
    """(E / pi) times exposure: E is 8 where red is 1, 4 where blue is."""
    picture_shown = shown(bake, "screen")
    h, w, _ = picture_shown.shape
    assert w >= 32 and picture_shown[h // 2, 2] == pytest.approx([1, 0, 0], abs=0.01)  # 8 / pi / 2 > 1
    assert picture_shown[h // 2, -3] == pytest.approx([0, 0, 4 / np.pi / 2], abs=0.01)
    assert not (bake.out / "maps" / f"{bake.scene.files[bake.scene.names.index('screen')]}.exr").exists()


def test_light_on_the_floor_follows_the_picture(bake):
    """Left of the screen is red: so is the floor below, more than blue is, whose lamp is half as strong."""
    floor = shown(bake, "floor")
    w = floor.shape[1]
    left, right = floor[:, : w // 4].mean(axis=(0, 1)), floor[:, -(w // 4) :].mean(axis=(0, 1))
    assert left[0] > 1.3 * right[0] and right[2] > 1.3 * left[2]


def test_a_changed_picture_bakes_again_and_a_retuned_group_does_not(tmp_path, bake):
    room, results = written(tmp_path / "room"), tmp_path / "results"
    first = preflight.load(room, None, results).slices
    pictures.write_png_srgb(room / "half.png", picture("br", 16))
    second = preflight.load(room, None, results).slices
    assert first["geometry"] != second["geometry"] and first["materials"] == second["materials"]
    pictures.write_png8(room / "grey.png", np.full((4, 4, 3), 127, np.uint8))
    assert preflight.load(room, None, results).slices["geometry"] == second["geometry"]


def test_intensity_scales_the_picture_and_a_texture_stays_below_it(tmp_path):
    """White halves and black ones on a grey wall: twice the light of its group, twice the picture."""
    once = run(written(tmp_path / "a", "w."), tmp_path / "one")
    twice = run(written(tmp_path / "b", "w."), tmp_path / "two", {"glow": 2.0})
    print_1, print_2 = shown(once, "print"), shown(twice, "print")
    h, w, _ = print_1.shape
    difference = print_2[:, : w // 4].mean(axis=(0, 1)) - print_1[:, : w // 4].mean(axis=(0, 1))
    assert difference[1] == pytest.approx(0.5 / np.pi / 2, abs=0.02)  # and no other channel
    assert difference[[0, 2]] == pytest.approx([0, 0], abs=1e-3)
    assert print_1[h // 2, 2, 1] > print_1[h // 2, -3, 1] + 0.05


@pytest.mark.parametrize(
    "change, said",
    [
        (("half.png, colour: [1, 1, 0.5]", "hlf.png"), "materials.screen.emission_texture: no file 'hlf.png'"),
        (("power: 6, ", ""), "materials.screen.emission_texture: is for a material with emission, power or lumens"),
        (("half.png, colour: [1, 1, 0.5]", "black.png"), "materials.screen.emission_texture: is black where its light"),
        (("half.png, colour: [1, 1, 0.5]", "cut.png"), "materials.screen.emission_texture: "),
        (("emission_texture: half.png", "emision_texture: half.png"), "emission_texture"),
    ],
)
def test_refusals(tmp_path, change, said):
    folder = written(tmp_path / "room")
    pictures.write_png8(folder / "black.png", np.zeros((4, 4, 3), np.uint8))
    (folder / "cut.png").write_bytes((folder / "half.png").read_bytes()[:60])
    (folder / "scene.yaml").write_text(SCENE.replace(*change, 1), encoding="utf-8")
    with pytest.raises(Refusal) as caught:
        preflight.load(folder, None, tmp_path / "results")
    assert said in str(caught.value) and str(caught.value).startswith(str(folder)), str(caught.value)


def screen_gltf(png):
    """A .gltf of a square of two triangles, 1 m wide, facing down at height 1 (y up), its emission picture inside."""
    V = np.array([[-0.5, 1, -0.5], [0.5, 1, -0.5], [0.5, 1, 0.5], [-0.5, 1, 0.5]], "<f4")
    T, F = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], "<f4"), np.array([0, 1, 2, 0, 2, 3], "<u4")
    parts, views, at = [V.tobytes(), T.tobytes(), F.tobytes()], [], 0
    for part in parts:
        views.append({"buffer": 0, "byteOffset": at, "byteLength": len(part)})
        at += len(part)
    uri = lambda kind, data: f"data:{kind};base64,{base64.b64encode(data).decode()}"  # noqa: E731
    kinds = ((5126, 4, "VEC3"), (5126, 4, "VEC2"), (5125, 6, "SCALAR"))
    shine = {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"name": "shine", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}, **shine}],
        "textures": [{"source": 0}],
        "images": [{"uri": uri("image/png", png)}],
        "buffers": [{"byteLength": at, "uri": uri("application/octet-stream", b"".join(parts))}],
        "bufferViews": views,
        "accessors": [
            {"bufferView": k, "componentType": c, "count": n, "type": t} for k, (c, n, t) in enumerate(kinds)
        ],
    }
    return json.dumps(document)


def test_a_mesh_file_shines_by_a_picture_inside_it(tmp_path):
    """Left half red, right half blue; E is pi times the factor times the picture's mean."""
    room = written(tmp_path / "room")
    (room / "screen.gltf").write_text(screen_gltf((room / "half.png").read_bytes()))
    head = "- {name: floor, rectangle: {origin: [-1, -1, 0], u: [2, 0, 0], v: [0, 2, 0]}}\n"
    body = SCENE[SCENE.index("bake:") :]
    (room / "scene.yaml").write_text(f"geometry:\n{head}- {{file: screen.gltf, name: screen}}\n{body}")
    baked = run(room, tmp_path / "results")
    (k,) = baked.scene.glow
    assert baked.scene.E[k] == pytest.approx([np.pi / 2, 0, np.pi / 2], rel=0.01)
    floor = shown(baked, "floor")
    w = floor.shape[1]
    left, right = floor[:, : w // 4].mean(axis=(0, 1)), floor[:, -(w // 4) :].mean(axis=(0, 1))
    assert left[0] > 1.3 * right[0] and right[2] > 1.3 * left[2]
    parts, textures = exported.load(baked.out / "scene_LOD0.gltf")
    part = next(part for part in parts if part.name == baked.scene.names[k])
    for x, colour in ((-0.4, [0.5, 0, 0]), (0.4, [0, 0, 0.5])):  # emission pi / pi times the exposure, by position
        a, b, c = (part.ST[part.F[0, n]] for n in range(3))
        A, B, C = (part.V[part.F[0, n]] for n in range(3))
        where = np.linalg.lstsq(np.stack([B - A, C - A], axis=1), [x, 1, 0] - A, rcond=None)[0]
        s, t = a + where[0] * (b - a) + where[1] * (c - a)
        rgb = textures[part.texture].rgb
        assert rgb[int(t * rgb.shape[0]), int(s * rgb.shape[1])] == pytest.approx(colour, abs=0.02)
