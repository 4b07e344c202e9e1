"""Stage lod_export: levels by deviation, count and share, in metres, one job a level."""

import json

import numpy as np
import pytest

from lib.formats import casters, lod_mesh, scene
from lib.formats.artefact import ArtefactError
from stages import lod_export, tessellate
from tests.stages.test_stage_tessellate import small_scene

LEVELS = [{"deviation": "1 mm"}, 0.3, {"share": 0.1}, {"triangles": 60}, {"triangles": 3}]


@pytest.fixture
def files(tmp_path):
    scene.save(tmp_path / "scene.npz", small_scene(2.0, flip=["ball"]))
    argv = ["--scene", str(tmp_path / "scene.npz"), "--out", str(tmp_path / "casters.npz")]
    assert tessellate.main(argv) == 0
    return tmp_path


def run(files, k, levels=LEVELS, units="m"):
    out = files / f"lod_{k}.npz"
    argv = ["--scene", files / "scene.npz", "--casters", files / "casters.npz", "--level", json.dumps(levels[k])]
    argv += ["--level-index", k, "--units", units, "--out", out]
    finest = ["--finest", files / "lod_0.npz"] if levels is LEVELS and k in (1, 2) else []
    status = lod_export.main([str(word) for word in (*argv, *finest)])
    return status, out


def test_levels_are_what_was_asked(files):
    levels = []
    for k in range(len(LEVELS)):
        status, out = run(files, k)
        assert status == 0
        levels.append(lod_mesh.load(out))
    n = [len(level.F) for level in levels]
    assert levels[0].distance.max() <= 1e-3 and n[0] > 1000
    assert 0.8 * 0.3 * n[0] <= n[1] <= 0.3 * n[0] and 0.7 * 0.1 * n[0] <= n[2] <= 0.1 * n[0]
    assert n[3] <= 60
    assert n[4] == 2 * 7 + 2 * 3 and levels[4].note == f"3 triangles asked for, these surfaces need {n[4]}"
    assert [level.level for level in levels] == list(range(5)) and levels[1].asked == {"share": 0.3}


def test_a_level_is_in_metres_and_faces_the_lit_side(files):
    level = lod_mesh.load(run(files, 3)[1])
    own = slice(level.vertex_start[0], level.vertex_start[1])
    centre = np.array([1.0, 1.0, 3.2])
    out = level.V[own] - centre
    assert np.linalg.norm(out, axis=1) == pytest.approx(0.6, rel=1e-9)
    # a sphere's facets lie evenly below it: 0 at the vertices, most in their middles
    assert 0.3 * level.distance[0] < level.rms[0] < 0.8 * level.distance[0] and level.distance[0] < level.slide[0] < 0.5
    assert np.allclose(level.N[own], -out / 0.6, atol=1e-6)  # flipped: the ball is lit from inside
    F = level.F[: level.face_start[1]]
    A, B, C = (level.V[F[:, k]] for k in range(3))
    assert (np.einsum("kc,kc->k", np.cross(B - A, C - A), A - centre) < 0).all()


def test_every_role_is_exported(files):
    level = lod_mesh.load(run(files, 3)[1])
    assert (np.diff(level.face_start) > 0).all() and len(level.distance) == 8


def test_lengths_follow_the_unit_of_the_scene(files):
    a = run(files, 0, [{"deviation": "2 mm"}])[1].read_bytes()
    assert lod_mesh.load(run(files, 0, [{"deviation": 2}], "mm")[1]).tolerance == pytest.approx(2e-3)
    assert lod_mesh.load(run(files, 0, [{"deviation": "0.1 %"}])[1]).tolerance == pytest.approx(
        1e-3 * casters.load(files / "casters.npz").scale
    )
    assert run(files, 0, [{"deviation": "2 mm"}])[1].read_bytes() == a


def test_a_first_share_refers_to_the_default_level(files):
    default = lod_mesh.load(run(files, 0, [{"deviation": "0.01 %"}])[1])
    whole = lod_mesh.load(run(files, 0, [1.0, 0.5])[1])
    half = lod_mesh.load(run(files, 1, [1.0, 0.5])[1])
    assert np.array_equal(whole.F, default.F) and len(half.F) <= len(whole.F) / 2


def test_refusals(files, capsys):
    assert run(files, 0, [{"deviation": "1e-9 mm"}])[0] == 1
    assert "at most 4000000" in capsys.readouterr().err
    assert run(files, 0, [{"deviation": 0}])[0] == 1
    assert "deviation" in capsys.readouterr().err
    assert not (files / "lod_0.npz").exists()
    assert run(files, 1)[0] == 1
    assert f"{files}/lod_0.npz" in capsys.readouterr().err


def test_the_artefact_is_checked(files):
    path = run(files, 3)[1]
    level = lod_mesh.load(path)
    for field, value in (("UV", level.UV + 1), ("N", level.N * 2), ("F", level.F + len(level.V)), ("gap", -1.0)):
        with pytest.raises(ArtefactError):
            lod_mesh.save(files / "bad.npz", lod_mesh.LodMesh(**{**vars(level), field: value}))
