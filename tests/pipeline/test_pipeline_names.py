"""Folders and surfaces with names that shells, Snakemake or file systems might take for something else."""

import json

import pytest

from tests.pipeline.runs import TINY

pytestmark = pytest.mark.slow

FOLDER = "a {c} $(touch pwned) `touch pwned` \"q\" 's' ü; & {wildcards.c}"
SURFACES = {
    "name: floor,": 'name: "{c} $(touch pwned) \\"q\\" \'s\' ü",',
    "name: back wall,": "name: -back {wildcards.c} {input},",
    "name: dome\n": 'name: "dome; touch pwned &"\n',
    "name: glow,": 'name: "Dome; touch pwned &",',  # differs in case alone
    "[0.7, 0.6, 0.5]": "[0.97, 0.6, 0.5]",  # so that a warning names one of them
}
SMALL = """geometry:
- {name: floor, rectangle: {origin: [0, 0, 0], u: [3, 0, 0], v: [0, 2, 0]}}
- {name: lamp, rectangle: {origin: [1, 0.5, 2], u: [0, 1, 0], v: [1, 0, 0]}, material: lamp}
materials:
  lamp: {emission: 10}
"""


def test_odd_names_bake_and_never_pass_through_a_shell(fresh, tmp_path):
    text = TINY.replace("chunks: 3", "chunks: 1")
    for old, new in SURFACES.items():
        assert old in text
        text = text.replace(old, new)
    text = text.replace("name: -back {wildcards.c} {input}", 'name: "-back {wildcards.c} {input}"')
    scene = tmp_path / FOLDER
    scene.mkdir()
    (scene / "scene.yaml").write_text(text, encoding="utf-8")
    (scene / "wood.png").write_bytes((fresh.scene / "wood.png").read_bytes())
    done = fresh.bake(scene=scene)
    (results,) = (fresh.work / "results").iterdir()
    assert results.name.isascii() and not set(results.name) & set(" ${}`'\";&")
    names = json.loads((results / "report.json").read_text(encoding="utf-8"))["surfaces"]
    expected = {"{c} $(touch pwned) \"q\" 's' ü", "-back {wildcards.c} {input}", "dome; touch pwned &", "lamp"}
    assert {row["name"] for row in names} == expected | {"Dome; touch pwned &"}
    nodes = json.loads((results / "scene_LOD0.gltf").read_text(encoding="utf-8"))["nodes"]
    assert expected <= {node.get("name") for node in nodes}
    files = {path.name for path in results.glob("maps/*.exr")}
    assert len(files) == 4 and all(name[:3].isdigit() and name.isascii() for name in files)
    assert not list(tmp_path.rglob("pwned*")) and not list(fresh.checkout.rglob("pwned*"))
    assert "warning: material white: reflectance above 0.95 (surface -back {wildcards.c} {input}" in done.stderr
    assert fresh.listed(scene=scene) == {}


def test_a_scene_of_five_lines_by_relative_and_by_absolute_path(fresh, tmp_path):
    assert len(SMALL.splitlines()) == 5
    scene = tmp_path / "my scenes" / "small"
    scene.mkdir(parents=True)
    (scene / "scene.yaml").write_text(SMALL)
    fresh.bake("results/small/lods.json", scene="../my scenes/small", config=["bake={tolerance: 0.1, max_level: 4}"])
    results = fresh.work / "results/small"
    assert (results / "scene.glb").exists() and (results / "maps/000-floor.exr").exists()
    typed = ["bake={tolerance: 0.1, max_level: 4}"]
    assert fresh.listed("results/small/lods.json", scene=scene, config=typed) == {}
    retuned = fresh.listed("results/small/lods.json", scene=scene / "scene.yaml", config=[*typed, "lods=[0.5]"])
    assert retuned == {"lod_export": 1, "package": 1}
