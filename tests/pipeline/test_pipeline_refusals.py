"""Bad input and bad circumstances, as the terminal shows them: the plain reason, no traceback, a status not 0."""

import json
import os
import shutil

import pytest

from tests.pipeline.runs import TINY, edited, products

SPACE = "my scenes/tiny room/scene.yaml"


def refused(project, *options, **chosen):
    """The lines of a run that must end with a refusal before its first job."""
    done = project.run(*options, **chosen)
    assert done.returncode != 0
    assert "Traceback" not in done.stderr and "Error" not in done.stderr, done.stderr
    assert {path.name for path in project.results.glob("stages/*")} <= {"preflight"}  # read before, for a list of jobs
    return done.stderr.splitlines()


def test_a_misspelt_key_gives_one_line_with_the_nearest_name(fresh):
    with edited(fresh.scene / "scene.yaml", "max_level: 5", "max_levle: 5"):
        (line,) = refused(fresh)
    number = next(n for n, text in enumerate(TINY.splitlines(), 1) if "max_level" in text)
    assert line.endswith(f"{SPACE}: bake.max_levle: unknown key; did you mean max_level? (line {number})")


def test_all_mistakes_at_once_with_their_lines(fresh):
    with (
        edited(fresh.scene / "scene.yaml", "tolerance: 0.1", "tolerance: 7"),
        edited(fresh.scene / "scene.yaml", "budget: 8 KiB", "bugdet: 8 KiB"),
        edited(fresh.scene / "scene.yaml", "reflectance: 0.2", "reflectance: 1.2"),
    ):
        lines = refused(fresh)
    assert len(lines) == 3 and any("bugdet" in line and "budget?" in line for line in lines)
    assert any("bake.tolerance" in line for line in lines) and any("glow.reflectance" in line for line in lines)
    assert all("(line " in line for line in lines)


@pytest.mark.parametrize(
    "typed, message",
    [
        ("budgt=3 MiB", "command line: budgt: unknown key; did you mean budget?"),
        ("bake={tolerance: -1}", "command line: bake.tolerance: "),
    ],
)
def test_what_is_typed_is_checked_like_what_is_written(fresh, typed, message):
    (line,) = refused(fresh, config=[typed])
    assert line.startswith(message)


def test_a_picture_that_is_missing_is_named_with_its_line(fresh):
    with edited(fresh.scene / "scene.yaml", "wood.png", "woood.png"):
        (line,) = refused(fresh)
    assert f"{SPACE}: materials.wood.texture: no file 'woood.png'" in line and "(line " in line


def test_scenes_that_are_not_there(fresh, tmp_path):
    (line,) = refused(fresh, scene=tmp_path / "no where")
    assert line.startswith(f"{tmp_path / 'no where'}: ")
    (line,) = refused(fresh, scene="", config=["scene="])
    assert "scene=FOLDER" in line


def test_results_that_can_not_be_written_are_named(fresh):
    (fresh.work / "results").write_text("a file, not a folder")
    (line,) = refused(fresh)
    assert line.startswith("results/tiny-room/settings/") and "can not be written" in line


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_results_folder_is_named(fresh):
    (fresh.work / "results").mkdir(mode=0o555)
    (line,) = refused(fresh)
    assert line.startswith("results/tiny-room/settings/") and "can not be written" in line


def test_a_second_folder_of_the_same_name_is_not_mixed_in(fresh, tmp_path):
    other = tmp_path / "elsewhere" / "Tiny room"
    shutil.copytree(fresh.scene, other)
    fresh.listed()
    before = (fresh.results / "preflight.json").read_bytes()
    other = other.rename(other.with_name("tiny  room"))  # the same cleaned name
    (line,) = refused(fresh, scene=other)
    assert line.startswith(f"{other}: results/tiny-room holds the bake of {fresh.scene}")
    assert (fresh.results / "preflight.json").read_bytes() == before


def test_warnings_reach_the_terminal(fresh):
    with edited(fresh.scene / "scene.yaml", "[0.7, 0.6, 0.5]", "[0.97, 0.6, 0.5]"):
        done = fresh.bake("--dry-run")
    assert "warning: material white: reflectance above 0.95 (surface back wall and 1 more)" in done.stderr


@pytest.mark.slow
def test_a_budget_below_the_smallest_total_leaves_the_bake_as_it_is(baked):
    before = products(baked.results)
    done = baked.run(config=["budget=1"])
    assert done.returncode != 0
    (line,) = done.stderr.splitlines()
    assert line.startswith("command line: budget: 1 bytes can not be met; the smallest possible total of these 4 ")
    smallest = json.loads((baked.results / "stages/budget_reduce/budget.json").read_text())["S_smallest"]
    assert line.endswith(f" textures is {smallest} bytes")
    assert products(baked.results) == before


CLOSED = """
geometry:
- {name: floor, rectangle: {origin: [0, 0, 0], u: [1, 0, 0], v: [0, 1, 0]}, material: mirror}
- {name: ceiling, rectangle: {origin: [0, 0, 1], u: [0, 1, 0], v: [1, 0, 0]}, material: mirror}
- {name: front, rectangle: {origin: [0, 0, 0], u: [0, 0, 1], v: [1, 0, 0]}, material: mirror}
- {name: back, rectangle: {origin: [0, 1, 0], u: [1, 0, 0], v: [0, 0, 1]}, material: mirror}
- {name: left, rectangle: {origin: [0, 0, 0], u: [0, 1, 0], v: [0, 0, 1]}, material: mirror}
- {name: right, rectangle: {origin: [1, 0, 0], u: [0, 0, 1], v: [0, 1, 0]}, material: mirror}
materials:
  mirror: {reflectance: 1, emission: 1}
bake: {tolerance: 0.1, elements: 60, rays_per_element: 64}
"""


@pytest.mark.slow
def test_a_closed_room_that_absorbs_nothing_does_not_converge(fresh, tmp_path):
    room = tmp_path / "closed room"
    room.mkdir()
    (room / "scene.yaml").write_text(CLOSED)
    done = fresh.run("results/closed-room/stages/shoot/solution.npz", scene=room)
    assert done.returncode != 0 and "Traceback" not in done.stderr
    told = [line for line in done.stderr.splitlines() if "does not converge" in line]
    assert told and told[-1].startswith(f"{room / 'scene.yaml'}: the light does not converge")
    assert "warning: material mirror: reflectance above 0.95" in done.stderr
    record = json.loads((fresh.work / "results/closed-room/stages/shoot/cost.json").read_text())
    assert record["stopped"] == told[-1]
