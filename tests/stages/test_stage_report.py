"""A bake written by hand: two floor halves that share a border, a lamp that only shines, two levels. Its report."""

import json
import re
import shutil

import numpy as np
import pytest

from lib.formats import (
    casters,
    light_maps,
    pictures,
    report_pictures,
    scene,
    scene_view,
    solution,
    textured_maps,
    trees,
)
from lib.formats.artefact import write_json
from lib.maps.mapset import pack
from lib.nurbs.surface import bilinear
from stages import picture, report

NAMES = ['a <b>&"floor"', "c floor", "lamp"]
SETTINGS = {
    "settings": {"bake": {"convergence": 0.001}},
    "warnings": ["look </script><script>alert(1)</script>"],
    "camera": {"eye": [100, 50, 300], "target": [100, 50, 0.0], "fov": 40},
    "units": "cm",
    "up": "z",
}


def quad(x, z, width):
    return bilinear([x, 0, z], [x + width, 0, z], [x + width, 1, z], [x, 1, z])


def ramp(low, high):
    """Map (2 v, 3 u) that grows from low at u = 0 to high at u = 1, one light group."""
    return np.broadcast_to(np.linspace(low, high, 3)[None, :, None, None], (2, 3, 1, 3)).astype(np.float32)


def make(folder):
    """Write every file the report reads."""
    stages = folder / "stages"
    surfaces = [quad(0, 0, 1), quad(1, 0, 1), quad(0.5, 2, 1)]
    E = np.array([[0.0] * 3, [0] * 3, [10] * 3])
    scene.save(
        stages / "import_scene/scene.npz",
        scene.Scene(
            NAMES,
            ["000-a", "001-c", "002-lamp"],
            surfaces,
            np.full(3, -1, np.int32),
            np.array([False, False, True]),
            ["full"] * 3,
            E,
            np.zeros(3, np.int32),
            ["all"],
            np.array([False, False, True]),
            ["m"] * 3,
            "z",
            ["from the scene"],
        ),
    )
    no = np.zeros
    casters.save(
        stages / "tessellate/casters.npz",
        casters.Casters(
            np.array([1, 0.5, 1]),
            2.0,
            no((0, 3)),
            no((0, 2)),
            no((0, 3), np.int32),
            no(0, np.int32),
            no(0, bool),
            np.array([1.0, 1, 1]),
            np.ones((3, 2)),
            no(3),
            np.ones(3, bool),
            no((3, 2), bool),
            no((3, 4), bool),
            no(3, bool),
            np.full(3, -1, np.int32),
            np.array([[0, 1, 1, 0, 0]], np.int32),
            no((4, 2), np.int64),
            no((0, 3, 2)),
            no((0, 3), bool),
        ),
    )
    maps = [ramp(0, 2), ramp(2.5, 3)]
    light_maps.save(
        stages / "balance_resample/chunk_0.npz", light_maps.LightMaps(pack([0, 1], [[2, 1]] * 2, [0, 0], maps))
    )
    B = [0.5 * m.sum(axis=2) for m in maps]
    both = pack([0, 1], [[2, 1]] * 2, [0, 0], B)
    textured_maps.save(
        stages / "budget_reduce/textures.npz",
        textured_maps.TexturedMaps(NAMES[:2], both, both, no((2, 3)), np.full((2, 3), 0.5), no(2, bool)),
    )
    tree = trees.Tree(
        (2, 1),
        0,
        no((6, 2), np.int32),
        no((6, 1, 3), np.float32),
        no(6, bool),
        no(6, np.float32),
        np.array([[0, 0, 0], [0, 0, 1]], np.int32),
        0.03,
    )
    trees.save(stages / "refine/direct_0.npz", "direct", {0: tree, 1: tree}, {})
    trees.save(stages / "refine/indirect_0.npz", "indirect", {0: tree, 1: tree}, {})
    solved = dict.fromkeys(solution.Solution.__dataclass_fields__, no(2, np.float32))  # one number an element
    solved.update(
        H_indirect=no((2, 1, 3), np.float32),
        is_hidden=no((2, 16), bool),
        n_u=np.array([1, 1, 0]),
        n_v=np.array([1, 1, 0]),
        rho=np.full((3, 3), 0.5),
        mean_H=np.full(3, 2.0),
        history=np.array([[0, 1.0], [2, 0.1], [4, 0.0005]]),
        ledger={"emitted": [[10.0] * 3], "received": [[4.0] * 3], "absorbed": [[2.0] * 3]},
        facts={"shots": 4},
    )
    solved["H_surface"] = no((3, 3))
    solution.save(stages / "shoot/solution.npz", solution.Solution(**solved))
    row = {
        "level_before": 1,
        "level_after": 0,
        "size_before": [5, 3],
        "size_after": [3, 2],
        "bytes_before": 100,
        "bytes_after": 32,
        "D_given_up": 0.25,
    }
    write_json(
        stages / "budget_reduce/budget.json",
        {
            "profile": "standard",
            "T": 1000,
            "S_before": 132,
            "S_after": 64,
            "S_smallest": 64,
            "fixed": 0,
            "order": "loss_per_byte",
            "lost": 0.0216,
            "steps": [],
            "surfaces": [
                {**row, "surface": NAMES[0], "D": 1.5},
                {**row, "surface": NAMES[1], "D": 2.5, "level_before": 0},
            ],
        },
    )
    for stage, rays, run in (("sample", 700, "old"), ("refine", 300, "old"), ("lod_export", 0, "new")):
        write_json(
            stages / stage / "cost_0.json",
            {
                "stage": stage,
                "seconds": 1.5,
                "cpu_seconds": 2.0,
                "peak_mb": 50.0,
                "rays": rays,
                "run": run,
                "notes": {"dim": 5},
            },
        )
    for k in range(2):
        write_gltf(folder, k, both)
    write_json(
        folder / "lods.json",
        {
            "exposure": 3.0,
            "levels": [
                {
                    "file": f"scene_LOD{k}.gltf",
                    "triangles": n,
                    "vertices": 8,
                    "max_distance": 0.0,
                    "rms_distance": 0.0,
                    "bytes": 200,
                }
                for k, n in enumerate((4, 2))
            ],
        },
    )


def write_gltf(folder, k, maps):
    """Both halves (level 1: the first alone) as triangles over textures of one colour each, y up."""
    blob, views, accessors = b"", [], []

    def add(array, kind, component):
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "type": kind, "componentType": component, "count": len(array)})
        blob += array.tobytes()
        return len(accessors) - 1

    meshes = []
    for s in range(2 - k):
        V = np.array([[s, 0, 0], [s + 1, 0, 0], [s + 1, 0, -1], [s, 0, -1]], "<f4")
        meshes.append(
            {
                "primitives": [
                    {
                        "material": s,
                        "attributes": {
                            "POSITION": add(V, "VEC3", 5126),
                            "TEXCOORD_0": add(np.full((4, 2), 0.5, "<f4"), "VEC2", 5126),
                        },
                        "indices": add(np.array([0, 1, 2, 0, 2, 3], "<u4"), "SCALAR", 5125),
                    }
                ]
            }
        )
    for s, codes in enumerate(([200, 0, 0], [0, 100, 0])):
        pictures.write_png8(folder / f"textures/{s}.png", np.full((2, 2, 3), codes, np.uint8))
    (folder / f"scene_LOD{k}.bin").write_bytes(blob)
    write_json(
        folder / f"scene_LOD{k}.gltf",
        {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(meshes)))}],
            "nodes": [{"mesh": m} for m in range(len(meshes))],
            "meshes": meshes,
            "accessors": accessors,
            "bufferViews": views,
            "buffers": [{"uri": f"scene_LOD{k}.bin", "byteLength": len(blob)}],
            "images": [{"uri": f"textures/{s}.png"} for s in range(2)],
            "textures": [{"source": s} for s in range(2)],
            "extensionsUsed": ["KHR_materials_unlit"],
            "materials": [
                {"extensions": {"KHR_materials_unlit": {}}, "pbrMetallicRoughness": {"baseColorTexture": {"index": s}}}
                for s in range(2)
            ],
        },
    )


@pytest.fixture(autouse=True, scope="module")
def small():
    """Pictures of a few pixels: what they show is tested elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BAKE_RUN", "new")
        patch.setattr(report_pictures, "HERO", (24, 15))
        patch.setattr(report_pictures, "SMALL", (16, 10))
        yield


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bakes") / "my room"
    folder.mkdir()
    make(folder)
    assert report.main(["--results", str(folder), "--settings", json.dumps(SETTINGS)]) == 0
    return folder


@pytest.fixture
def spoilt(results, tmp_path):
    """A copy a test may take files from."""
    return shutil.copytree(results, tmp_path / "copy")


def test_figures(results):
    facts = json.loads((results / "report.json").read_text())
    assert facts["scene"] == "my room"
    assert facts["camera"] == {"eye": [1, 3, -0.5], "target": [1, 0, -0.5], "fov": 40}
    assert facts["totals"]["rays"] == 1000 and facts["run"] == {"id": "new", "rays": 0, "seconds": 1.5, "jobs": 1}
    assert [s["stage"] for s in facts["stages"]] == ["sample", "refine", "lod_export"]
    first = facts["surfaces"][0]
    assert first["map"] == [3, 2] and first["samples"] == 12 and first["leaves"] == 2 and first["D_i"] == 1.5
    assert first["error"] == pytest.approx(np.sqrt(2) * 0.03 / 2)
    assert first["bytes"] == 4 * (3 * 2 + 1)
    assert facts["surfaces"][2]["map"] is None
    assert facts["gouraud"] == {
        "triangles": 8,
        "levels": [{"level": 0, "triangles": 4, "times": 2.0}, {"level": 1, "triangles": 2, "times": 4.0}],
    }
    assert facts["shoot"]["unshot"] == 0.0005 and facts["shoot"]["shots"] == [0, 2, 4]
    assert [row["name"] for row in facts["budget"]] == [NAMES[0]]
    assert facts["warnings"] == ["from the scene", SETTINGS["warnings"][0]]
    assert {"what": "dim lights counted as unblocked", "count": 15, "unit": "pairs of sample and light"} in facts[
        "savings"
    ]


def test_the_worst_seam_is_the_step_between_the_halves(results):
    facts = json.loads((results / "report.json").read_text())
    assert (
        facts["seams"]
        == facts["seams_exported"]
        == [{"a": NAMES[0], "b": NAMES[1], "worst": 0.5, "rms": 0.5, "relative": 0.2}]  # of 2.5 beside it
    )


def test_the_page_is_whole_and_names_are_text(results):
    page = (results / "report.html").read_text()
    assert "alert(1)" in page and "<script>alert(1)" not in page
    assert NAMES[0] not in page and "a &lt;b&gt;&amp;&quot;floor&quot;" in page
    assert not re.search(r"""(src|href|action|xlink:href)\s*=\s*["']?\s*(https?:)?//""", page)
    assert not re.search(r"url\(|@import|\bimport\(", page.split("<script")[0])
    for title in ("Levels of detail", "Illumination maps", "Texture budget", "Seams", "Gouraud", "Settings", "Cost"):
        assert title in page


def test_the_camera_of_the_scene_is_turned_to_metres_and_y_up():
    view = scene_view.scene_camera(SETTINGS["camera"], SETTINGS)
    assert view.eye == pytest.approx((1, 3, -0.5)) and view.target == pytest.approx((1, 0, -0.5)) and view.fov == 40


def test_a_bake_without_maps_still_has_a_report(spoilt):
    for name in (
        "balance_resample/chunk_0.npz",
        "budget_reduce/textures.npz",
        "budget_reduce/budget.json",
        "shoot/solution.npz",
        "refine/direct_0.npz",
        "refine/indirect_0.npz",
    ):
        (spoilt / "stages" / name).unlink()
    assert report.main(["--results", str(spoilt)]) == 0


def test_a_missing_level_is_named(spoilt, capsys):
    (spoilt / "scene_LOD1.bin").unlink()
    assert report.main(["--results", str(spoilt)]) == 1
    assert "scene_LOD1.bin: missing" in capsys.readouterr().err


def test_picture_door_draws_both_halves(results, tmp_path, capsys):
    camera = json.dumps({"eye": [1, 3, -0.5], "target": [1, 0, -0.5], "fov": 20})
    out = tmp_path / "picture.png"
    assert (
        picture.main(
            ["--gltf", str(results / "scene_LOD0.gltf"), "--camera", camera, "--size", "40x20", "--out", str(out)]
        )
        == 0
    )
    codes = pictures.read_png8(out)
    assert codes.shape == (20, 40, 3)
    assert {tuple(codes[10, 12].tolist()), tuple(codes[10, 27].tolist())} == {(200, 0, 0), (0, 100, 0)}
    assert picture.main(["--gltf", "x.gltf", "--size", "0x9", "--out", str(out)]) == 1
    assert "expected like 960x600" in capsys.readouterr().err
