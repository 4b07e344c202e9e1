"""A scene with a mesh: how it is thinned is found out once, whatever levels of detail are asked for."""

import json

import pytest

from lib.formats import lod_mesh
from tests.lod.charted_meshes import sphere
from tests.pipeline.runs import Project, edited, jobs

pytestmark = pytest.mark.slow

# A floor, a lamp and a ball of 432 triangles.
SCENE = """geometry:
- {name: floor, rectangle: {origin: [-2, -2, -1], u: [4, 0, 0], v: [0, 4, 0]}}
- {name: lamp, rectangle: {origin: [-0.5, -0.5, 3], u: [0, 1, 0], v: [1, 0, 0]}, material: lamp}
- {name: ball, file: ball.obj, units: m}
materials: {lamp: {reflectance: 0, emission: 10}}
bake: {tolerance: 0.1, max_level: 4}
lods: [{deviation: 1 mm}, 0.3]
"""
EXPORT = {"lod_export", "package", "report"}


@pytest.fixture(scope="module")
def meshes(project, tmp_path_factory):
    """The Project of a baked scene with a mesh."""
    home = tmp_path_factory.mktemp("meshes")
    scene, work = home / "with mesh", home / "work"
    scene.mkdir()
    work.mkdir()
    (scene / "scene.yaml").write_text(SCENE)
    ball = sphere(6)
    lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in ball.V] + [f"f {a} {b} {c}" for a, b, c in ball.F + 1]
    (scene / "ball.obj").write_text("\n".join(lines) + "\n")
    made = Project(project.checkout, scene, work)
    made.first = made.bake()
    return made


def test_meshes_are_thinned_by_a_job_of_their_own(meshes):
    assert jobs(meshes.first)["thin_meshes"] == 1
    assert meshes.listed() == {}
    results = meshes.work / "results/with-mesh"
    stages = [row["stage"] for row in json.loads((results / "report.json").read_text())["stages"]]
    assert stages.index("budget_reduce") < stages.index("thin_meshes") < stages.index("lod_export")
    count = [lod_mesh.load(results / f"stages/lod_export/lod_{k}.npz").face_start[-1] for k in (0, 1)]
    assert 2 + 2 + 100 < count[0] <= 2 + 2 + 432 and count[1] <= 0.3 * count[0]


@pytest.mark.parametrize(
    "old, new, expected",
    [
        ("1 mm}, 0.3]", "5 mm}, 0.2, 0.1]", EXPORT),
        ("lods:", "budget: 8 KiB\nlods:", {"budget_reduce", "package", "report"}),
        ("max_level: 4", "max_level: 5", None),
    ],
    ids=["lods", "budget", "depth"],
)
def test_no_setting_but_geometry_thins_them_again(meshes, old, new, expected):
    with edited(meshes.scene / "scene.yaml", old, new):
        listed = meshes.listed()
    assert "thin_meshes" not in listed and (expected is None or listed.keys() == expected)


@pytest.mark.parametrize(
    "module, again", [("lib/lod/collapse.py", True), ("lib/lod/levels.py", False), ("lib/radiosity/shooting.py", False)]
)
def test_an_edit_of_what_thins_them_does(meshes, module, again):
    with edited(meshes.checkout / module, '"""', '"""Edited. '):
        listed = meshes.listed()
    assert ("thin_meshes" in listed) == again and ("lod_export" in listed) == (again or "levels" in module)


def test_without_the_mesh_there_is_no_such_job(meshes):
    with edited(meshes.scene / "scene.yaml", "- {name: ball, file: ball.obj, units: m}\n", ""):
        assert "thin_meshes" not in meshes.listed()
