"""What re-runs when what changes, asked by dry runs after a full bake."""

import json
import shutil

import numpy as np
import pytest

from lib.formats import pictures
from tests.pipeline.runs import STAGES, Project, edited, jobs, products

pytestmark = pytest.mark.slow


def stages_from(first):
    """The stages from `first` on, without lod_export where it does not read what is made from there."""
    return {stage for stage in STAGES[STAGES.index(first) :] if stage != "lod_export"}


EXPORT = {"lod_export", "package", "report"}


def test_first_run_lists_every_stage(baked):
    assert jobs(baked.first).keys() == set(STAGES)
    counts = jobs(baked.first)
    assert counts["sample"] == counts["refine_direct"] == counts["refine_indirect"] == counts["balance_resample"] == 3
    assert counts["lod_export"] == 2


def test_nothing_changed_nothing_to_do(baked):
    assert baked.listed() == {}


@pytest.mark.parametrize(
    "old, new, expected",
    [
        ("lods: [{deviation: 5 mm}, 0.3]", "lods: [{deviation: 5 mm}, 0.3, 0.1]", EXPORT),
        ("budget: 8 KiB", "budget: 6 KiB", {"budget_reduce", "package", "report"}),
        ("tolerance: 0.1", "tolerance: 0.07", stages_from("refine_direct")),
        ("reflectance: [0.7, 0.6, 0.5]", "reflectance: [0.7, 0.6, 0.4]", stages_from("shoot")),
        ("max_level: 5", "max_level: 5, seed: 2", stages_from("sample")),
        ("origin: [0, 3, 0]", "origin: [0, 3.1, 0]", set(STAGES)),
        ("eye: [2, -4, 2]", "eye: [2, -4, 1]", {"report"}),
        ("camera:", "surfaces: {dome: {tolerance: 0.05}}\ncamera:", stages_from("refine_direct")),
        ("camera:", "surfaces: {dome: {reconstruction: gouraud}}\ncamera:", EXPORT),
    ],
    ids=["lods", "budget", "tolerance", "reflectance", "seed", "geometry", "camera", "own-tolerance", "own-way"],
)
def test_an_edit_of_the_scene(baked, old, new, expected):
    with edited(baked.scene / "scene.yaml", old, new):
        assert baked.listed().keys() == expected


def test_a_setting_typed_counts_as_one_written(baked):
    assert baked.listed(config=["budget=6 KiB"]).keys() == {"budget_reduce", "package", "report"}


def test_a_repainted_texture_of_equal_average(baked):
    path = baked.scene / "wood.png"
    before = path.read_bytes()
    picture = pictures.read_linear(str(path), "srgb")
    try:
        pictures.write_png_srgb(path, np.asarray(picture, dtype=np.float64)[:, ::-1])
        assert path.read_bytes() != before
        assert baked.listed().keys() == {"apply_base_texture", "budget_reduce", "package", "report"}
    finally:
        path.write_bytes(before)


def test_a_lost_map_is_made_again(baked):
    path = baked.results / "maps" / "001-dome.exr"
    path.rename(baked.results / "away.exr")
    try:
        assert baked.listed().keys() == {"apply_base_texture", "budget_reduce", "package", "report"}
    finally:
        (baked.results / "away.exr").rename(path)


@pytest.mark.parametrize(
    "module, expected",
    [
        ("lib/radiosity/shooting.py", stages_from("shoot")),
        ("lib/maps/budget.py", {"budget_reduce", "package", "report"}),
        ("lib/lod/levels.py", EXPORT),
        ("lib/formats/preflight.py", set()),
    ],
)
def test_an_edit_of_the_code(baked, module, expected):
    path = baked.checkout / module
    with edited(path, '"""', '"""Edited. '):
        done = baked.bake("--dry-run")
    assert jobs(done).keys() == expected
    assert not expected or f"now: '{module} " in done.stdout  # the reason names it


def test_a_moved_project_is_not_baked_again(project, tmp_path):
    """Checkout, scene and results below one folder, which is renamed."""

    def at(home):
        return Project(home, home / "rooms" / "tiny room", home)

    shutil.copytree(project.checkout, tmp_path / "here")
    shutil.copytree(project.scene, tmp_path / "here" / "rooms" / "tiny room")
    target = "results/tiny-room/stages/tessellate/casters.npz"
    at(tmp_path / "here").bake(target)
    (tmp_path / "here").rename(tmp_path / "there")
    assert at(tmp_path / "there").listed(target) == {}


@pytest.mark.parametrize("level", ["0.2", "{triangles: 300}"])
def test_a_changed_level_is_cut_alone(baked, level):
    listed = baked.listed(config=["lods=[{deviation: 5 mm}, " + level + "]"])
    assert listed == {"lod_export": 1, "package": 1, "report": 1}


def test_a_changed_first_level_cuts_its_shares_again(baked):
    assert baked.listed(config=["lods=[{deviation: 6 mm}, 0.3]"]) == {"lod_export": 2, "package": 1, "report": 1}
    assert baked.listed(config=["lods=[{deviation: 6 mm}]"]) == {"lod_export": 1, "package": 1, "report": 1}


def test_a_retune_of_the_levels_casts_no_ray(copied):
    before, maps = json.loads((copied.results / "report.json").read_text()), products(copied.results)
    assert before["run"]["rays"] == before["totals"]["rays"] > 0
    done = copied.bake(config=["lods=[{deviation: 1 mm}]"])
    assert jobs(done) == {"lod_export": 1, "package": 1, "report": 1}
    after = json.loads((copied.results / "report.json").read_text())
    assert after["run"]["rays"] == 0 and after["totals"]["rays"] == before["totals"]["rays"]
    assert [level["file"] for level in after["levels"]] == ["scene_LOD0.gltf"]
    kept = products(copied.results)
    assert "scene_LOD1.gltf" not in kept  # of the bake before
    same = [name for name in maps if name.startswith(("maps", "textures"))]
    assert same and {name: kept.get(name) for name in same} == {name: maps[name] for name in same}


def test_reading_the_scene_is_among_the_costs(baked):
    record = json.loads((baked.results / "stages/preflight/cost.json").read_text())
    assert record["stage"] == "preflight" and record["cpu_seconds"] > 0 and record["rays"] == 0
    rows = json.loads((baked.results / "report.json").read_text())["stages"]
    assert rows[0]["stage"] == "preflight" and rows[0]["jobs"] == 1


LOOK = "bake={first_look: true}"


def test_a_first_look_comes_first_and_hangs_on_scene_and_camera_alone(fresh):
    done = fresh.bake(config=[LOOK])
    made = fresh.results / "first_look.png"
    assert f"first look: {made.relative_to(fresh.work)}" in done.stdout
    assert made.stat().st_mtime_ns < (fresh.results / "stages/import_scene/scene.npz").stat().st_mtime_ns
    light = pictures.read_linear(str(made), "srgb")
    assert light.shape == (400, 640, 3) and light.max() > 0.9
    assert fresh.listed() == {"report": 1}  # which shows all settings; the picture stays
    assert fresh.listed(config=[LOOK, "lods=[0.5]", "budget=6 KiB"]).keys() == {"budget_reduce", *EXPORT}
    with edited(fresh.scene / "scene.yaml", "eye: [2, -4, 2]", "eye: [2, -4, 1]"):
        assert fresh.listed(config=[LOOK]).keys() == {"first_look", "report"}
