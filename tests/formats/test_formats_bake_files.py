"""Which files of a results folder belong to the bake that is reported."""

import pytest

from lib.formats import bake_files
from lib.formats.artefact import ArtefactError, write_json

NEEDED = ("stages/import_scene/scene.npz", "stages/tessellate/casters.npz", "lods.json")


def touch(folder, *names):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


def test_files_are_found_below_the_results_and_what_is_given_goes_first(tmp_path):
    touch(tmp_path, *NEEDED, "stages/refine/direct_0.npz", "stages/refine/direct_1.npz")
    found = bake_files.find({"scene": "mine.npz", "direct": ["one.npz"]}, tmp_path)
    assert found["scene"] == "mine.npz" and found["direct"] == ["one.npz"]
    assert found["casters"] == str(tmp_path / NEEDED[1]) and found["solution"] is None and found["maps"] == []
    assert len(bake_files.find({}, tmp_path)["direct"]) == 2


@pytest.mark.parametrize("name", NEEDED)
def test_a_file_every_report_needs_is_named(tmp_path, name):
    touch(tmp_path, *(n for n in NEEDED if n != name))
    with pytest.raises(ArtefactError, match=name):
        bake_files.find({}, tmp_path)


def test_costs_of_jobs_that_the_bake_no_longer_has_are_left_out(tmp_path):
    names = [
        "stages/sample/cost_0.json",
        "stages/sample/cost_1.json",
        "stages/refine/cost_direct_1.json",
        "stages/lod_export/cost_1.json",
        "stages/lod_export/cost_2.json",
        "stages/thin_meshes/cost.json",
        "stages/shoot/cost.json",
        "stages/report/cost.json",
        "stages/first_look/cost.json",
    ]
    kept = [name for name in names if bake_files._is_current(tmp_path / name, n_chunks=1, n_levels=2, has_meshes=False)]
    assert kept == ["stages/sample/cost_0.json", "stages/lod_export/cost_1.json", "stages/shoot/cost.json"]


@pytest.mark.parametrize("file, stage", [("cost_direct_0", "refine direct"), ("cost_indirect_3", "refine indirect")])
def test_the_halves_of_refine_are_told_apart(tmp_path, file, stage):
    write_json(tmp_path / f"{file}.json", {"stage": "refine"})
    assert bake_files._named({"stage": "refine"}, tmp_path / f"{file}.json")["stage"] == stage
    assert bake_files._named({"stage": "shoot"}, tmp_path / f"{file}.json")["stage"] == "shoot"
