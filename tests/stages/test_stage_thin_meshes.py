"""Stage thin_meshes: the levels of a scene's meshes are the same with its file and without, and cost less with it."""

import json

import numpy as np
import pytest

from lib.formats import lod_mesh, mesh_ladder, scene
from lib.formats.artefact import read_json
from lib.lod import thinned
from lib.lod.mesh_levels import TRIALS
from lib.surfaces.measure import transformed
from stages import lod_export, tessellate, thin_meshes
from tests.lod.charted_meshes import sphere, split
from tests.rooms import scene_of
from tests.shapes import rectangle
from tests.stages.test_stage_tessellate import small_scene

LEVELS = [{"deviation": "1 %"}, 0.8, {"triangles": 400}]


def mixed_scene():
    """A ball of two meshes that touch, a floor, and a small ball that is seen from both sides."""
    away = np.diag([0.3, 0.3, 0.3, 1.0])
    away[:3, 3] = [3.0, 0.0, 0.0]
    moon = transformed(sphere(8), away)
    one, other = split(sphere(12), [[0, 1, 2], [3, 4, 5]])
    return scene_of(
        {
            "ball/1": (one, {}),
            "ball/2": (other, {}),
            "floor": (rectangle([0, 0, -1], [4, 0, 0], [0, 4, 0]), {}),
            "moon": (moon, {}),
            "moon back": (moon, {"front": "moon", "flip": True}),
        }
    )


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """scene.npz, casters.npz, ladder.npz and its cost."""
    home = tmp_path_factory.mktemp("thin")
    scene.save(home / "scene.npz", mixed_scene())
    assert tessellate.main(["--scene", str(home / "scene.npz"), "--out", str(home / "casters.npz")]) == 0
    assert thin(home, "ladder.npz", "--cost", home / "cost.json") == 0
    return home


def thin(home, name, *more):
    argv = ["--scene", home / "scene.npz", "--casters", home / "casters.npz", "--out", home / name, *more]
    return thin_meshes.main([str(word) for word in argv])


def export(home, k, out, *more, levels=LEVELS):
    argv = ["--scene", home / "scene.npz", "--casters", home / "casters.npz", "--level", json.dumps(levels[k])]
    return lod_export.main([str(word) for word in (*argv, "--level-index", k, "--out", out, *more)])


def test_each_group_of_touching_meshes_is_in_the_file_once(files):
    found = mesh_ladder.load(files / "ladder.npz")
    assert [known.index.tolist() for known in found] == [[0, 1], [2]]  # the moon is the third mesh, its back none
    assert [len(known.history.death) for known in found] == [12 * 12**2, 12 * 8**2]
    for known in found:
        assert (known.measured[0, :, :3] == 0).all() and (known.measured[-1, :, 0] > 0).all()
        assert known.measured[0, :, 3].sum() == len(known.history.death) and len(known.steps) >= 5
    notes = read_json(files / "cost.json")["notes"]
    assert notes["meshes"] == 3 and notes["groups"] == 2 and notes["triangles"] == 12 * (12**2 + 8**2)


def test_a_second_run_writes_the_same_bytes(files):
    assert thin(files, "again.npz") == 0
    assert (files / "again.npz").read_bytes() == (files / "ladder.npz").read_bytes()


@pytest.mark.parametrize("k", range(len(LEVELS)))
def test_levels_are_the_same_with_the_file_and_without(files, k, monkeypatch):
    finest = ["--finest", first_of(files)] if k == 1 else []
    built, patches = [], thinned.Thinned.patches
    monkeypatch.setattr(thinned.Thinned, "patches", lambda self, step: built.append(step) or patches(self, step))
    assert export(files, k, files / "without.npz", *finest) == 0
    survey = len(built)

    def unexpected(*args, **kwargs):
        raise AssertionError("collapses found again")

    monkeypatch.setattr(thinned.fast_simplification, "simplify", unexpected)
    built.clear()
    assert export(files, k, files / "with.npz", "--ladder", files / "ladder.npz", *finest) == 0
    assert (files / "with.npz").read_bytes() == (files / "without.npz").read_bytes()
    assert 2 <= len(built) <= 2 + 2 * TRIALS and len(built) < survey / 2  # of each group one, and what was tried before
    level = lod_mesh.load(files / "with.npz")
    count = np.diff(level.face_start)
    assert count[3] == count[4] and (k > 0 or level.distance.max() <= 0.01 * 4)
    assert count.sum() <= [np.inf, 0.8 * len(lod_mesh.load(first_of(files)).F), 400][k]


def first_of(files):
    path = files / "first.npz"
    assert path.exists() or export(files, 0, path, "--ladder", files / "ladder.npz") == 0
    return path


def test_a_share_of_the_first_level_counts_it_as_it_is(files):
    """A tenth of it, asked for by share and by number."""
    n = len(lod_mesh.load(first_of(files)).F)
    argv = ["--ladder", files / "ladder.npz"]
    assert export(files, 1, files / "share.npz", *argv, "--finest", files / "first.npz", levels=[LEVELS[0], 0.25]) == 0
    assert export(files, 0, files / "number.npz", *argv, levels=[{"triangles": int(0.25 * n)}]) == 0
    share, number = (lod_mesh.load(files / f"{name}.npz") for name in ("share", "number"))
    assert np.array_equal(share.F, number.F) and np.array_equal(share.V, number.V)


def test_a_file_of_other_meshes_is_named(files, tmp_path, capsys):
    x = mixed_scene()
    x.surfaces[0], x.surfaces[1] = split(sphere(10), [[0, 1, 2], [3, 4, 5]])
    scene.save(tmp_path / "scene.npz", x)
    assert tessellate.main(["--scene", str(tmp_path / "scene.npz"), "--out", str(tmp_path / "casters.npz")]) == 0
    assert export(tmp_path, 0, tmp_path / "lod.npz", "--ladder", files / "ladder.npz") == 1
    told = capsys.readouterr().err
    assert "ladder.npz: collapses of 1728 triangles, these meshes have 1200; delete it" in told
    mesh_ladder.save(tmp_path / "part.npz", mesh_ladder.load(files / "ladder.npz")[:1])
    assert export(files, 0, tmp_path / "lod.npz", "--ladder", tmp_path / "part.npz") == 1
    assert "part.npz: not of these 3 meshes" in capsys.readouterr().err
    assert not (tmp_path / "lod.npz").exists()


def test_a_damaged_file_stops_the_export(files, tmp_path, capsys):
    data = bytearray((files / "ladder.npz").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "ladder.npz").write_bytes(data)
    assert export(files, 0, tmp_path / "lod.npz", "--ladder", tmp_path / "ladder.npz") == 1
    assert "ladder.npz: damaged" in capsys.readouterr().err


def test_a_scene_without_meshes_has_no_ladder(tmp_path, capsys):
    scene.save(tmp_path / "scene.npz", small_scene())
    assert tessellate.main(["--scene", str(tmp_path / "scene.npz"), "--out", str(tmp_path / "casters.npz")]) == 0
    assert thin(tmp_path, "ladder.npz") == 1
    assert "the scene has no meshes" in capsys.readouterr().err
