"""The stage makes the Scene that preflight saw, the same bytes each time and wherever the scene lies."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from lib.formats import preflight, scene, scene_import
from stages import import_scene

DATA = Path(__file__).parents[1] / "data"
TEXT = """
geometry:
- {name: floor, rectangle: {origin: [0, 0, 0], u: [4, 0, 0], v: [0, 3, 0]}}
- {name: lamp, triangle: [[1, 1, 2], [1, 2, 2], [2, 1, 2]], material: lamp}
- {name: craft, file: v3_Speeder.3dm, place: {scale: [20, -20, 20]}, role: cast_only}
- {name: pot, file: teapot.bpt, units: cm, place: [{scale: 3}, {scale: 3, translate: [1, 1, 0]}]}
materials: {lamp: {lumens: 800, group: evening}}
surfaces: {"pot.2/*": {reconstruction: gouraud, tolerance: 0.05, flip: true}}
"""


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "room"
    folder.mkdir()
    (folder / "scene.yaml").write_text(TEXT)
    for name in ("v3_Speeder.3dm", "teapot.bpt"):
        shutil.copy(DATA / name, folder)
    return folder


def run(found, out="scene.npz"):
    return import_scene.main(
        ["--scene-slice", found.slices["geometry"], "--out", out, "--log", "log.txt", "--cost", "cost.json"]
    )


def test_what_the_snakefile_told_is_told_once(home, capsys, monkeypatch):
    monkeypatch.setenv("BAKE_RUN", "a run")
    assert run(preflight.load(home)) == 0
    assert "skipped" not in capsys.readouterr().err
    assert "warning: v3_Speeder.3dm: skipped" in Path("log.txt").read_text()


def test_the_scene_is_that_of_preflight(home, capsys):
    found = preflight.load(home)
    assert run(found) == 0
    made = scene.load("scene.npz")
    assert (made.names, made.files, made.role, made.groups) == (found.names, found.files, found.roles, found.groups)
    assert made.is_black.tolist() == found.is_black
    index = {name: k for k, name in enumerate(made.names)}
    assert found.tolerances["pot.2/05"] == 0.05 and found.reconstruction["pot.2/05"] == "gouraud"
    assert len(found.tolerances) == len(found.reconstruction) == 32  # the patches of one pot, nothing else
    assert made.role[index["craft/1"]] == "cast_only" and made.groups == ["evening"]
    crafts = made.flip[[index["craft/1"], index["craft/2"]]]
    assert crafts.tolist().count(True) == 1  # one half is reversed in the file, the mirror turns both
    assert not made.flip[index["pot.1/05"]] and made.flip[index["pot.2/05"]]
    E = made.E[index["lamp"]]
    assert 683 * E @ [0.2126, 0.7152, 0.0722] * 0.5 == pytest.approx(800)
    assert np.ptp(made.surfaces[index["floor"]].P, axis=(0, 1)) == pytest.approx([4, 3, 0])
    skipped = "v3_Speeder.3dm: skipped: 15 curves, 8 text dots"
    assert made.warnings == [skipped] and found.warnings == [skipped]
    assert f"warning: {skipped}" in capsys.readouterr().err and skipped in Path("log.txt").read_text()
    cost = json.loads(Path("cost.json").read_text())
    assert cost["rays"] == 0 and cost["notes"]["surfaces"] == 68


def test_the_bytes_depend_on_the_content_alone(home, tmp_path):
    run(preflight.load(home), "first.npz")
    entries = TEXT.split("materials:")[0].strip().split("\n")[1:]
    shuffled = TEXT.replace("\n".join(entries), "\n".join(reversed(entries)))
    home.rename(tmp_path / "away")
    (tmp_path / "away" / "scene.yaml").write_text(shuffled)
    run(preflight.load("away", {}, "elsewhere"), "second.npz")
    assert Path("first.npz").read_bytes() == Path("second.npz").read_bytes()


def test_a_file_that_changes_under_a_bake_is_refused(home, capsys):
    found = preflight.load("room")
    (home / "teapot.bpt").write_text("changed")
    assert run(found) == 1
    assert capsys.readouterr().err == "room/teapot.bpt: changed while the bake ran; start it again\n"
    assert not Path("scene.npz").exists()


def test_a_missing_slice_is_named(home, capsys):
    preflight.load(home)
    assert import_scene.main(["--scene-slice", "results/room/settings/none.json", "--out", "x.npz"]) == 1
    assert "none.json: missing" in capsys.readouterr().err


def test_a_lamp_in_the_plane_of_a_ceiling_is_a_warning_with_both_names(home, capsys):
    lamp = "- {name: glow, rectangle: {origin: [1, 1, 0], u: [1, 0, 0], v: [0, 1, 0]}, material: lamp}\n"
    (home / "scene.yaml").write_text(TEXT.replace("materials:", lamp + "materials:"))
    assert run(preflight.load(home)) == 0
    said = "warning: surfaces floor and glow lie in one another, lit on the same side: move one a little"
    assert said in capsys.readouterr().err


def test_texture_coordinates_that_do_not_serve_as_a_map_are_told(home, capsys):
    """Of two sheets one has both triangles on the same place of the picture."""
    obj = "v 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    obj += "usemtl good\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\nusemtl folded\nf 1/1 2/2 3/3\nf 1/1 3/3 4/2\n"
    (home / "sheets.obj").write_text(obj)
    entry = "- {name: sheets, file: sheets.obj, uv: own, place: [{}, {translate: [0, 0, 1]}], two_sided: true}\n"
    (home / "scene.yaml").write_text(TEXT.replace("materials:", entry + "materials:"))
    assert run(preflight.load(home)) == 0
    (told,) = [line for line in capsys.readouterr().err.splitlines() if "uv: own" in line]
    assert told.startswith("warning: sheets.obj: `uv: own`: no texture coordinates, or they fold, ")
    assert told.endswith("charts are made for sheets.1/2, sheets.2/2")


@pytest.mark.parametrize("side, cell", [(100.0, 1.0), (32.0, 0.5)])
def test_the_finest_cells_of_a_mesh_are_of_the_scene_or_of_itself(side, cell):
    """In a scene of 640 m: 1 m, but at least 64 across the mesh."""
    assert scene_import.finest_cell(side**2, 640.0) == pytest.approx(cell)
