"""Preflight: resolved settings, content-addressed slices that move only for what is in them, a quick second parse."""

import datetime
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from lib.formats import preflight
from lib.refusal import Refusal

ROOT = Path(__file__).parents[2]
TEXT = """
units: cm
geometry:
- {name: floor, rectangle: {origin: [0, 0, 0], u: [400, 0, 0], v: [0, 300, 0]}, material: wood}
- {name: lamp, rectangle: {origin: [100, 100, 250], u: [0, 50, 0], v: [50, 0, 0]}, material: lamp}
- {name: pot, file: teapot.bpt, units: cm, place: {scale: 10, translate: [200, 200, 0]}, material: white}
materials:
  wood: {texture: wood.png, repeat: [4, 3]}
  lamp: {power: 60}
  white: {reflectance: [0.97, 0.8, 0.8]}
camera: {eye: [0, 0, 150], target: [200, 200, 50]}
lods: [{deviation: 1 mm}, {deviation: 2}, {deviation: 1 %}, 0.25, {triangles: 12}]
"""


def paint(path, values):
    """A 2 x 2 picture of linear grey values, top row first, 16 bit."""
    codes = np.round(np.array(values, dtype=np.float64) * 65535).astype(np.uint16)
    out = oiio.ImageOutput.create(str(path))
    out.open(str(path), oiio.ImageSpec(2, 2, 1, "uint16"))
    out.write_image(codes.reshape(2, 2, 1))
    out.close()


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A folder with a scene in it, which is the working folder."""
    monkeypatch.chdir(tmp_path)
    scene = tmp_path / "my room"
    scene.mkdir()
    shutil.copy(ROOT / "tests/data/teapot.bpt", scene)
    paint(scene / "wood.png", [[0.2, 0.4], [0.6, 0.8]])
    (scene / "scene.yaml").write_text(TEXT)
    return scene


def edit(home, old, new):
    text = (home / "scene.yaml").read_text()
    assert old in text
    (home / "scene.yaml").write_text(text.replace(old, new))


def test_everything_is_resolved(home):
    found = preflight.load(home)
    assert (found.folder, found.name) == (home, "my-room")
    assert found.names == ["floor", "lamp", *(f"pot/{k:02d}" for k in range(1, 33))]
    assert found.files[0] == "000-floor" and found.files[33] == "033-pot-32"
    assert found.roles == ["full"] * 34 and found.is_black == [False, True] + [False] * 32
    assert found.area[:2] == pytest.approx([12, 0.25])
    settings = found.settings
    assert settings["budget"] == 64 << 20 and settings["bake"]["tolerance"] == 0.01
    lods = settings["lods"]
    assert (
        lods[0] == {"deviation": 0.001}
        and lods[1] == {"deviation": 0.02}
        and lods[3:] == [{"share": 0.25}, {"triangles": 12}]
    )
    assert lods[2]["deviation"] == pytest.approx(0.04)  # of 4 m
    assert settings["camera"] == {"eye": [0, 0, 1.5], "target": [2, 2, 0.5], "fov": 50}
    assert found.geometry_files == [str(home / "teapot.bpt")] and found.texture_files == [str(home / "wood.png")]
    assert found.textures == {"floor": {"file": str(home / "wood.png"), "colour_space": "srgb", "repeat": [4, 3]}}
    assert found.rho_avg["lamp"] == [0, 0, 0] and found.rho_avg["pot/01"] == [0.97, 0.8, 0.8]
    assert found.warnings == ["material white: reflectance above 0.95 (surface pot/01 and 31 more) converges slowly"]


def test_averages_are_taken_in_linear_light_and_rounded(home):
    linear = preflight.load(home, {"materials": {"wood": {"colour_space": "linear"}}}).rho_avg["floor"]
    srgb = preflight.load(home).rho_avg["floor"]
    assert linear == pytest.approx([0.5] * 3, abs=1e-4)
    values = np.array([0.2, 0.4, 0.6, 0.8])
    assert srgb == pytest.approx([(((values + 0.055) / 1.055) ** 2.4).mean()] * 3, abs=1e-4)
    assert srgb == [round(x, 4) for x in srgb]


def test_slices_are_named_by_their_content_and_written_once(home):
    first = preflight.load(home)
    stamps = {path: os.stat(path).st_mtime_ns for path in first.slices.values()}
    shutil.rmtree(home.parent / "results" / "my-room" / "stages", ignore_errors=True)
    (home.parent / "results/my-room/preflight.json").unlink()
    again = preflight.load(str(home) + "/scene.yaml")  # made anew, typed differently: the same files
    assert again == first
    assert {path: os.stat(path).st_mtime_ns for path in again.slices.values()} == stamps
    assert first.slices["geometry"].startswith("results/my-room/settings/geometry-")


@pytest.mark.parametrize(
    "old, new, moved",
    [
        ("lods: [{deviation: 1 mm}", "lods: [{deviation: 2 mm}", ()),
        ("camera:", "budget: 1 MiB\nbake: {tolerance: 0.05}\ncamera:", ()),
        ("[0.97, 0.8, 0.8]", "[0.9, 0.8, 0.8]", ("materials",)),
        ("[0.97, 0.8, 0.8]", "0", ("materials", "geometry")),  # black now: it needs no rays
        ("repeat: [4, 3]", "repeat: [2, 3]", ("textures",)),
        ("{power: 60}", "{power: 61}", ("geometry",)),
        ("u: [400, 0, 0]", "u: [401, 0, 0]", ("geometry",)),
        ("material: white}", "material: white, role: cast_only}", ("geometry",)),
        ("material: white}", "material: white, flip: true}", ("geometry",)),
    ],
)
def test_an_edit_moves_the_slices_that_hold_it_and_no_other(home, old, new, moved):
    before = preflight.load(home).slices
    edit(home, old, new)
    after = preflight.load(home).slices
    assert {kind for kind in before if before[kind] != after[kind]} == set(moved)


def test_a_repainted_texture_of_equal_average_moves_only_the_textures(home):
    before = preflight.load(home)
    paint(home / "wood.png", [[0.8, 0.6], [0.4, 0.2]])
    after = preflight.load(home)
    assert after.rho_avg == before.rho_avg
    assert {kind for kind in before.slices if before.slices[kind] != after.slices[kind]} == {"textures"}
    paint(home / "wood.png", [[0.8, 0.6], [0.4, 0.3]])
    last = preflight.load(home)
    assert {kind for kind in after.slices if after.slices[kind] != last.slices[kind]} == {"textures", "materials"}


def test_an_edited_geometry_file_moves_the_geometry(home):
    before = preflight.load(home).slices
    text = (home / "teapot.bpt").read_text()
    (home / "teapot.bpt").write_text(text.replace("1.4 0.0 2.4", "1.41 0.0 2.4", 1))
    after = preflight.load(home).slices
    assert {kind for kind in before if before[kind] != after[kind]} == {"geometry"}


def test_the_second_parse_imports_nothing_heavy(home):
    first = preflight.load(home)
    code = (
        "import sys, json\nfrom lib.formats import preflight\n"
        f"found = preflight.load({str(home)!r})\n"
        "heavy = {'numpy', 'rhino3dm', 'geomdl', 'jsonschema', 'yaml', 'OpenImageIO'} & set(sys.modules)\n"
        "print(json.dumps([sorted(heavy), found.names, found.slices]))"
    )
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    heavy, *found = json.loads(subprocess.check_output([sys.executable, "-c", code], env=env))
    assert heavy == []
    assert found == [first.names, first.slices]


def test_a_lost_or_damaged_slice_is_written_again(home):
    path = Path(preflight.load(home).slices["geometry"])
    whole = path.read_bytes()
    for damage in (path.unlink, lambda: path.write_bytes(whole[:50])):
        damage()
        preflight.load(home)
        assert path.read_bytes() == whole
    (home.parent / "results/my-room/preflight.json").write_text("{")
    assert preflight.load(home).slices["geometry"] == str(path)


def test_overrides_are_part_of_the_key(home):
    assert preflight.load(home, {"scene": str(home), "bake": {"seed": "5"}}).settings["bake"]["seed"] == 5
    assert preflight.load(home).settings["bake"]["seed"] == 1
    with pytest.raises(Refusal, match="command line: bake.sede: unknown key; did you mean seed"):
        preflight.load(home, {"bake": {"sede": 5}})


def test_a_second_folder_of_the_same_name_is_refused(home, tmp_path):
    preflight.load(home)
    other = tmp_path / "elsewhere" / "my-room"
    shutil.copytree(home, other)
    with pytest.raises(Refusal, match="results/my-room holds the bake of"):
        preflight.load(other)
    shutil.rmtree(home)  # moved, not copied
    assert preflight.load(other).folder == other


def test_a_moved_scene_keeps_its_slices_of_geometry_and_materials(home, tmp_path):
    before = preflight.load(home).slices
    home.rename(tmp_path / "away")
    (tmp_path / "away").rename(tmp_path / "my-room")
    after = preflight.load("my-room").slices
    assert before["geometry"] == after["geometry"] and before["materials"] == after["materials"]


@pytest.mark.parametrize(
    "damage, said",
    [
        (lambda home: (home / "wood.png").write_bytes(b"no picture"), "my room/wood.png: surface floor: texture: "),
        (lambda home: (home / "wood.png").unlink(), "my room/scene.yaml: materials.wood.texture: no file 'wood.png'"),
        (
            lambda home: (home / "teapot.bpt").write_text("32\n"),
            "my room/teapot.bpt: surface pot/01: ends before patch 1",
        ),
        (
            lambda home: edit(home, "units: cm", "unit: cm"),
            "my room/scene.yaml: unit: unknown key; did you mean units?",
        ),
        (lambda home: edit(home, "power: 60", "power: .nan"), "my room/scene.yaml: '.nan' is not a finite number"),
    ],
)
def test_refusals_name_the_file_as_typed_and_leave_nothing(home, damage, said):
    damage(home)
    with pytest.raises(Refusal) as caught:
        preflight.load("my room")
    assert str(caught.value).startswith(said)
    assert not (home.parent / "results").exists()


def test_hostile_scenes_are_refused_within_two_seconds(home):
    for text in ("a: " + "[" * 200_000, "a: !!python/object:os.system x", "a: &a [x, x]\nb: *a\n" * 3):
        (home / "scene.yaml").write_text(text)
        start = time.monotonic()
        with pytest.raises(Refusal, match="my room/scene.yaml: "):
            preflight.load("my room")
        assert time.monotonic() - start < 2


def test_another_process_may_read_the_scene(home):
    asked, overrides = [], {"bake": {"tolerance": 0.02}, "up": datetime.date(2026, 1, 2)}
    with pytest.raises(Refusal, match="up: .*2026-01-02"):
        preflight.load(home, overrides)
    del overrides["up"]

    def elsewhere(*arguments):
        asked.append(json.loads(json.dumps(arguments)))
        preflight.make(*asked[-1])

    found = preflight.load(home, overrides, "results", elsewhere)
    assert asked == [[str(home), overrides, "results"]]
    assert found == preflight.load(home, overrides) and found.settings["bake"]["tolerance"] == 0.02
    assert preflight.load(home, overrides, "results", elsewhere) == found and len(asked) == 1  # kept


def test_a_file_that_changes_while_it_is_read_stops_the_run(home):
    def elsewhere(*arguments):
        preflight.make(*arguments)
        edit(home, "units: cm\ngeometry", "units: mm\ngeometry")

    with pytest.raises(Refusal, match="my room: a file has changed while it was read; run again"):
        preflight.load(home, {}, "results", elsewhere)
