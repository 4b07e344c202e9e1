"""What a file or a folder holds is listed, and nothing is written."""

import subprocess
import sys
from pathlib import Path

import pytest

from stages import describe

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"


def listed(path, capsys):
    assert describe.main([str(path)]) == 0
    return capsys.readouterr().out.splitlines()


def test_a_rhino_file(capsys):
    lines = listed(DATA / "v5_extrusions.3dm", capsys)
    assert lines[0].endswith("Rhino, 48 surfaces (38 trimmed, 10 whole, 4 of open sheets), its unit is 0.001 m")
    rows = [line.split() for line in lines[2:50]]
    assert [row[0] for row in rows] == [f"{k:02d}" for k in range(1, 49)]
    assert sum(row[1] == "trimmed" and row[8] == "2" for row in rows) == 6  # an outer loop and a hole
    assert "no material shines" in lines and "skipped: 10 curves" in lines
    assert lines[-1].startswith("textures that are not used") and "AtoZ.jpg" in lines[-1]


def test_the_door_of_import_lists_as_well(capfd):
    command = [sys.executable, "-m", "stages.import_scene", "--describe", str(DATA / "v7_my_surfaces.3dm")]
    assert subprocess.run(command, cwd=ROOT).returncode == 0
    assert "Rhino, 1 surfaces (1 whole)" in capfd.readouterr().out


def test_a_closed_surface_with_poles_and_a_reversed_one(capsys):
    head = listed(DATA / "v3_HumanHead2.3dm", capsys)[2].split()
    assert head[:10] == ["01", "whole", "3", "x", "3", "15", "x", "17", "u", "2"]
    columns = listed(DATA / "v3_Speeder.3dm", capsys)
    assert ["yes" in line for line in columns[2:4]].count(True) == 1


def test_a_scene_folder(tmp_path, capsys):
    (tmp_path / "scene.yaml").write_text(
        "units: cm\ngeometry:\n"
        "- {name: lamp, rectangle: {origin: [0, 0, 0], u: [100, 0, 0], v: [0, 200, 0]}, material: bulb}\n"
        "materials: {bulb: {power: 40, group: night}}\n"
    )
    lines = listed(tmp_path, capsys)
    assert lines[0] == f"{tmp_path}/scene.yaml: 1 surfaces, 2 m2, units cm, z up, light groups: night"
    assert lines[2].split()[-1] == "40" and lines[3] == "material bulb: reflectance 0 0 0, power 40, group night"
    assert [path.name for path in tmp_path.iterdir()] == ["scene.yaml"]


@pytest.mark.parametrize("path", ["none.bpt", "none", "LICENSE"])
def test_what_can_not_be_read_is_refused(path, capsys):
    assert describe.main([str(ROOT / path)]) == 1
    assert str(ROOT / path) in capsys.readouterr().err
