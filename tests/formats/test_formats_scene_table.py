"""Materials, patterns and light: totals spread over exact areas, references that lead nowhere refused."""

import math
from pathlib import Path

import numpy as np
import pytest

from lib.formats import scene_check, scene_table
from lib.refusal import Refusal

DATA = Path(__file__).parents[1] / "data"
SIX = "{name: six, rectangle: {origin: [0, 0, 0], u: [2, 0, 0], v: [0, 3, 0]}"


def check(folder, *lines, overrides=None):
    (folder / "scene.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return scene_check.run(folder, overrides)


def rows(folder, *lines):
    return check(folder, *lines).slices["geometry"]["surfaces"]


def refused(folder, *lines):
    with pytest.raises(Refusal) as caught:
        check(folder, *lines)
    return str(caught.value).replace(f"{folder}/", "")


def test_power_and_lumens_are_spread_over_the_area(tmp_path):
    table = rows(
        tmp_path,
        "geometry:",
        f"- {SIX}, material: watt}}",
        "- {name: lumen, rectangle: {origin: [0, 0, 1], u: [1, 0, 0], v: [0, 1, 0]}, material: lumen}",
        "materials: {watt: {power: 36, colour: [1, 2, 3]}, lumen: {lumens: 683, colour: [1, 0.5, 0]}}",
    )
    assert table["six"]["E"] == pytest.approx([1, 2, 3])
    E = np.array(table["lumen"]["E"])
    assert 683 * E @ [0.2126, 0.7152, 0.0722] == pytest.approx(683) and E[1] / E[0] == pytest.approx(0.5) and E[2] == 0


def test_a_total_is_that_of_each_placed_object(tmp_path):
    (tmp_path / "teapot.bpt").write_bytes((DATA / "teapot.bpt").read_bytes())
    found = check(
        tmp_path,
        "geometry:",
        "- {name: pot, file: teapot.bpt, place: [{}, {scale: 3, translate: [20, 0, 0]}], material: glow}",
        "materials: {glow: {power: 90}}",
    )
    table, area = (
        found.slices["geometry"]["surfaces"],
        dict(zip(found.outcome["names"], found.outcome["area"], strict=True)),
    )
    for copy in ("pot.1/", "pot.2/"):
        power = math.fsum(sum(table[name]["E"]) * area[name] for name in table if name.startswith(copy))
        assert power == pytest.approx(90)
        assert len({tuple(table[name]["E"]) for name in table if name.startswith(copy)}) == 1


def test_later_patterns_win_and_flip_turns(tmp_path):
    found = check(
        tmp_path,
        "geometry:",
        "- {name: wall/left, rectangle: {origin: [0, 0, 0], u: [1, 0, 0], v: [0, 1, 0]}, role: cast_only}",
        "- {name: wall/right, rectangle: {origin: [0, 0, 1], u: [1, 0, 0], v: [0, 1, 0]}, reconstruction: gouraud}",
        "surfaces:",
        '  "wall/*": {role: receive_only, flip: true, tolerance: 0.05}',
        '  "wall/r*": {flip: false, material: red}',
        "materials: {red: {reflectance: [0.6, 0, 0]}}",
    )
    table = found.slices["geometry"]["surfaces"]
    left, right = table["wall/left"], table["wall/right"]
    assert (left["role"], left["turn"], left["material"]) == ("receive_only", True, "default")
    assert (right["role"], right["turn"], right["material"]) == ("receive_only", False, "red")
    assert found.outcome["reconstruction"] == {"wall/right": "gouraud"}
    assert found.outcome["tolerances"] == {"wall/left": 0.05, "wall/right": 0.05}
    assert not {"tolerance", "reconstruction"} & set(left)  # a change of them does not move what is imported


def test_black_is_a_declared_zero_and_lights_are_black_unless_they_say_otherwise(tmp_path):
    table = rows(
        tmp_path,
        "geometry:",
        *(
            f"- {{name: {name}, rectangle: {{origin: [0, 0, {z}], u: [1, 0, 0], v: [0, 1, 0]}}, material: {name}}}"
            for z, name in enumerate(("zero", "red", "lamp", "shade", "plain"))
        ),
        "materials: {zero: {reflectance: 0}, red: {reflectance: [0.5, 0, 0]}, lamp: {emission: 5}, plain: {},",
        "  shade: {emission: [1, 2, 3], reflectance: 0.5}}",
    )
    assert {name: row["is_black"] for name, row in table.items()} == {
        "zero": True, "red": False, "lamp": True, "shade": False, "plain": False,
    }  # fmt: skip
    assert table["lamp"]["E"] == [5, 5, 5] and table["shade"]["E"] == [1, 2, 3] and table["plain"]["E"] == [0, 0, 0]


def test_light_groups_are_those_of_the_lights_in_the_scene(tmp_path):
    entry = "- {{name: {0}, rectangle: {{origin: [0, 0, {1}], u: [1, 0, 0], v: [0, 1, 0]}}, material: {0}}}"
    found = check(
        tmp_path,
        "geometry:",
        *(entry.format(name, z) for z, name in enumerate(("a", "b", "c"))),
        "materials: {a: {emission: 1, group: evening}, b: {power: 5}, c: {reflectance: 0.5}, d: {power: 1, group: x}}",
    )
    assert found.outcome["groups"] == ["evening", "main"]


@pytest.mark.parametrize(
    "material, said",
    [
        ("{emission: 1, power: 2}", "materials.m.power: a material has only one of emission, power, lumens"),
        (
            "{texture: a.png, reflectance: 1}",
            "materials.m.reflectance: a material has a texture or a reflectance, not both",
        ),
        ("{repeat: [1, 2]}", "materials.m.repeat: is for a material with a texture"),
        ("{emission: 1, colour: [1, 1, 1]}", "materials.m.colour: is for a material with power or lumens"),
        ("{power: 1, colour: [0, 0, 0]}", "materials.m.colour: one channel at least must be > 0"),
        ("{group: x}", "materials.m.group: is for a material with emission, power or lumens"),
        ("{texture: none.png}", "materials.m.texture: no file 'none.png' in the scene's folder"),
        ("{texture: ../a.png}", "materials.m.texture: '../a.png' lies outside the scene's folder"),
        ("{texture: /etc/passwd}", "materials.m.texture: '/etc/passwd' is an absolute path"),
        ("{texture: sub}", "materials.m.texture: 'sub' is not a file"),
        ('{texture: "a\\0b"}', "materials.m.texture: the path holds a control character"),
        ("{power: 1.0e+25, colour: [1, 1, 1]}", ""),
    ],
)
def test_contradictions_in_materials_are_refused(tmp_path, material, said):
    (tmp_path / "sub").mkdir()
    lines = ("geometry:", f"- {SIX}, material: m}}", "materials:", f"  m: {material}")
    if said:
        assert refused(tmp_path, *lines).startswith(f"scene.yaml: {said}")
        assert "(line 4)" in refused(tmp_path, *lines)
    else:
        assert rows(tmp_path, *lines)["six"]["E"] == pytest.approx([1e25 / 18] * 3)


def test_references_that_lead_nowhere_are_refused_with_the_nearest_name(tmp_path):
    message = refused(
        tmp_path,
        "geometry:",
        f"- {SIX}, material: wod}}",
        f"- {SIX}}}",
        "- {file: teapt.bpt}",
        "- {rectangle: {origin: [0, 0, 0], u: [2, 0, 0], v: [0, 3, 0]}, units: cm}",
        "- {name: ../up, rectangle: {origin: [0, 0, 0], u: [2, 0, 0], v: [0, 3, 0]}, trimmed: skip}",
        "materials: {wood: {reflectance: 0.5}}",
        'surfaces: {"*": {material: wodd}}',
        "bake: {shadow_rays: [64, 16]}",
        "camera: {eye: [0, 0, 1], target: [0, 0, 1]}",
    )
    assert [line.removeprefix("scene.yaml: ") for line in message.splitlines()] == [
        "surface six: material: no material 'wod' is defined; did you mean wood? (line 2)",
        "surface six: name: two entries have this name, the first in line 2; names are different (line 3)",
        "surface teapt: file: no file 'teapt.bpt' in the scene's folder (line 4)",
        "geometry[3].name: the name is missing (line 5)",
        "surface ../up: name: a part '..' is not allowed in a name (line 6)",
        "surface ../up: trimmed: is for entries with a `file` (line 6)",
        "surfaces.*.material: no material 'wodd' is defined; did you mean wood? (line 8)",
        "bake.shadow_rays: [64, 16]; expected [n0, n1] with n0 <= n1 (line 9)",
        "camera: eye and target are one point (line 10)",
    ]


def test_a_pattern_that_matches_nothing_is_refused(tmp_path):
    message = refused(tmp_path, "geometry:", f"- {SIX}}}", "surfaces: {sixx: {role: full}, six: {role: full}}")
    assert message == "scene.yaml: surfaces.sixx: matches no surface; did you mean six? (line 3)"


def test_lights_of_no_finite_strength_are_refused(tmp_path):
    tiny = "- {name: dot, rectangle: {origin: [0, 0, 0], u: [1.0e-10, 0, 0], v: [0, 1.0e-10, 0]}, material: m}"
    assert "its light is more than 1e30 W/m2" in refused(
        tmp_path, "geometry:", tiny, "materials: {m: {power: 1.0e+20}}"
    )


def test_reflectance_defaults():
    assert scene_table.reflectance({}) == [0.7] * 3
    assert scene_table.reflectance({"lumens": 5}) == [0] * 3
    assert scene_table.reflectance({"reflectance": [1, 0, 0.5]}) == [1, 0, 0.5]
