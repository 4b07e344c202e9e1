"""The frame of the stages: exit status, log, cost record, and what the terminal is told."""

import json
from argparse import ArgumentTypeError

import pytest

from lib import door
from lib.formats.artefact import ArtefactError
from lib.refusal import Refusal


def stage(body, folder, *more):
    """Run a body as a stage does, with its log and cost in folder."""
    argv = ["--log", str(folder / "log.txt"), "--cost", str(folder / "cost.json"), *more]
    return door.run("A stage.", lambda parser: parser.add_argument("--n", type=int), body, argv)


def record(folder):
    return json.loads((folder / "cost.json").read_text())


def test_a_job_that_ends_well(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("BAKE_RUN", "one")

    def body(args, cost):
        cost.rays += args.n
        cost.notes["spared"] = 2
        door.warn("the lamp is dark")

    assert stage(body, tmp_path, "--n", "7") == 0
    found = record(tmp_path)
    assert (found["stage"], found["rays"], found["notes"], found["run"]) == ("test_door", 7, {"spared": 2}, "one")
    assert found["seconds"] >= 0 and found["peak_mb"] > 1 and "stopped" not in found
    assert capsys.readouterr().err == "warning: the lamp is dark\n"
    assert (tmp_path / "log.txt").read_text().splitlines()[0] == "warning: the lamp is dark"
    assert door.stopped(tmp_path, "one") == []


@pytest.mark.parametrize("kind", [Refusal, ArtefactError])
def test_a_refusal_is_one_line_on_the_terminal_and_in_the_log(tmp_path, capsys, kind):
    def body(args, cost):
        raise kind("scene.yaml: budget: too small")

    assert stage(body, tmp_path) == 1
    assert capsys.readouterr().err == "scene.yaml: budget: too small\n"
    assert (tmp_path / "log.txt").read_text() == "scene.yaml: budget: too small\n"


def test_a_refused_setting_is_told_with_the_scene_it_is_from(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("BAKE_SCENE", "room/scene.yaml")
    monkeypatch.setenv("BAKE_RUN", "two")
    for text, kind, told in (
        ("budget: too small", Refusal, "room/scene.yaml: budget: too small"),
        ("room/scene.yaml: up: x", Refusal, "room/scene.yaml: up: x"),
        ("a.npz: damaged", ArtefactError, "a.npz: damaged"),
    ):

        def body(args, cost, kind=kind, text=text):
            raise kind(text)

        assert stage(body, tmp_path) == 1
        assert capsys.readouterr().err == f"{told}\n"
        assert door.stopped(tmp_path, "two") == [told]
        assert door.stopped(tmp_path, "three") == []  # another run's


def test_a_fault_of_ours_is_told_in_full(tmp_path, monkeypatch):
    monkeypatch.setenv("BAKE_RUN", "two")

    def body(args, cost):
        raise ZeroDivisionError("by zero")

    with pytest.raises(ZeroDivisionError):
        stage(body, tmp_path)
    assert "Traceback" in (tmp_path / "log.txt").read_text()
    assert door.stopped(tmp_path, "two") == ["test_door: ZeroDivisionError: by zero; a fault of this program"]


def test_ctrl_c_says_nothing(tmp_path, capsys):
    def body(args, cost):
        raise KeyboardInterrupt

    assert stage(body, tmp_path) == 130
    assert capsys.readouterr().err == ""
    assert not (tmp_path / "cost.json").exists()


def test_warnings_outside_a_stage_go_to_the_terminal(tmp_path, capsys):
    assert stage(lambda args, cost: None, tmp_path) == 0
    door.warn("late")
    assert capsys.readouterr().err == "warning: late\n"
    assert "late" not in (tmp_path / "log.txt").read_text()


def test_json_as_it_stands_or_from_a_file(tmp_path):
    (tmp_path / "a.json").write_text('{"x": [1, 2]}')
    assert door.json_text('{"x": [1, 2]}') == door.json_text(f"@{tmp_path}/a.json") == {"x": [1, 2]}
    with pytest.raises(ArgumentTypeError, match="b.json: missing"):
        door.json_text(f"@{tmp_path}/b.json")


def test_damaged_records_stop_nobody(tmp_path):
    (tmp_path / "cost.json").write_text("{")
    (tmp_path / "cost_1.json").write_text('{"run": "one", "stopped": "why"}')
    assert door.stopped(tmp_path, "one") == ["why"]
