"""Kept readings: used again while nothing they were made from has changed, and at most so many."""

import os

import pytest

from lib.formats import geometry_cache, geometry_file, obj, open_sheets, scene_geometry, scene_model

SHEET = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\ng one\nusemtl m\nf 1 2 3\ng two\nf 2 4 3\n"


@pytest.fixture
def read(tmp_path, monkeypatch):
    """Read a sheet of one material with a cache: (its GeometryFile, was it read from the file?)."""
    (tmp_path / "a.obj").write_text(SHEET)
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 0.5 0.25\n")
    readings, original = [], obj.read
    monkeypatch.setattr(obj, "read", lambda *args: readings.append(1) or original(*args))

    def make(only=None):
        before = len(readings)
        content = geometry_file.read(tmp_path / "a.obj", "a.obj", "part", only, cache=tmp_path / ".cache")
        return content, len(readings) > before

    return make


def test_a_reading_is_used_again_and_says_the_same(read):
    (first, is_read), (second, is_read_again) = read(), read()
    assert (is_read, is_read_again) == (True, False)
    assert (first.materials, first.notes, first.total) == (second.materials, second.notes, second.total)
    assert [p.area for p in first.patches] == [p.area for p in second.patches] == [pytest.approx(1.0)]
    assert (first.patches[0].surface.V == second.patches[0].surface.V).all()


def test_other_options_files_beside_it_and_code_are_read_anew(read, tmp_path, monkeypatch):
    read()
    assert read("one")[1] and len(read("one")[0].patches[0].surface.F) == 1
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 0 0 0.125\n")
    content, is_read = read()
    assert is_read and content.materials["m"]["reflectance"] == [0, 0, 0.125]
    (tmp_path / "scene.yaml").write_text("lods: [0.5]")  # the settings are no part of a model
    assert not read()[1]
    (tmp_path / "a.obj").write_text(SHEET.replace("f 2 4 3\n", ""))
    assert read()[1] and not read()[1]
    monkeypatch.setattr(geometry_cache, "_code", lambda: "another reader")
    assert read()[1] and not read()[1]


def test_what_was_found_of_sheets_holds_until_something_changes(tmp_path):
    asked, home, folder = [], tmp_path / "home", tmp_path / "cache"
    home.mkdir()
    (home / "a.obj").write_text("v 0 0 0")

    def sides(**settings):
        before = len(asked)
        found = geometry_cache.sides(folder, home, settings, lambda: asked.append(1) or ({"b", "a"}, {"c"}))
        assert found == ({"a", "b"}, {"c"})
        return len(asked) > before

    assert sides(up="z") and not sides(up="z")
    (home / "scene.yaml").write_text("lods: [1]")
    assert not sides(up="z")
    assert sides(up="y") and not sides(up="y")
    (home / "a.obj").write_text("v 0 0 0.5")
    assert sides(up="y") and not sides(up="y")
    (folder / geometry_cache.SIDES).write_text("{")
    assert sides(up="y") and not sides(up="y")


def test_levels_of_detail_do_not_ask_again_which_sides_are_lit(tmp_path, monkeypatch):
    scene = """
geometry:
- {name: sheet, rectangle: {origin: [0, 0, 0], u: [1, 0, 0], v: [0, 1, 0]}, material: card, two_sided: auto}
- {name: lamp, rectangle: {origin: [0, 0, -1], u: [1, 0, 0], v: [0, 1, 0]}, material: lamp}
materials: {card: {reflectance: 0.5}, lamp: {emission: %d}}
lods: [%g]
"""
    asked, original = [], open_sheets.lit_sides
    monkeypatch.setattr(open_sheets, "lit_sides", lambda *args: asked.append(1) or original(*args))

    def turned(light, level):
        (tmp_path / "scene.yaml").write_text(scene % (light, level))
        model = scene_model.read(tmp_path, None, tmp_path / "results" / "cache")
        return bool(model.table["sheet"]["turn"])

    assert turned(1, 1) and turned(1, 0.5) and len(asked) == 1
    assert turned(2, 0.5) and len(asked) == 2


def test_a_damaged_reading_is_made_again(read, tmp_path):
    read()
    (kept,) = (tmp_path / ".cache").glob("*.npz")
    kept.write_bytes(kept.read_bytes()[:-30])
    assert read()[1] and not read()[1]


def test_the_newest_readings_are_kept(read, tmp_path):
    content, folder = read()[0], tmp_path / "many"
    for k in range(geometry_cache.KEPT + 3):
        geometry_cache.save(folder, f"{k:03d}", content)
        os.utime(folder / f"{k:03d}.npz", ns=(k, k))
    geometry_cache.save(folder, "last", content)
    kept = sorted(path.stem for path in folder.glob("*.npz"))
    assert len(kept) == geometry_cache.KEPT and kept[-1] == "last" and "003" not in kept and "018" in kept


def test_white_of_a_file_reflects_no_more_than_things_do(read, tmp_path):
    read()
    loaded = scene_geometry.load([{"name": "sheet", "file": "a.obj"}], "m", tmp_path, str(tmp_path / "scene.yaml"))
    assert loaded.materials["m"]["reflectance"] == [scene_geometry.BRIGHTEST, 0.5, 0.25] == [0.9, 0.5, 0.25]
