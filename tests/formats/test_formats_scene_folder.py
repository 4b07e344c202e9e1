"""Settings from defaults, scene.yaml and the command line: precedence, and every mistake named with its source."""

import pytest
import yaml

from lib.formats import scene_folder, scene_schema, strict_yaml
from lib.formats.mistakes import Mistakes
from lib.refusal import Refusal

FLOOR = "geometry:\n- {name: floor, rectangle: {origin: [0, 0, 0], u: [4, 0, 0], v: [0, 4, 0]}}\n"


@pytest.fixture
def folder(tmp_path):
    def write(text):
        (tmp_path / "scene.yaml").write_text(text, encoding="utf-8")
        return tmp_path

    return write


def refused(*args):
    with pytest.raises(Refusal) as caught:
        scene_folder.read(*args)
    return str(caught.value)


def mistake(settings):
    """The one complaint about settings given as YAML text beside a good geometry."""
    mistakes = Mistakes()
    scene_schema.check(strict_yaml.parse(FLOOR + settings, "scene.yaml"), mistakes, "scene.yaml")
    with pytest.raises(Refusal) as caught:
        mistakes.stop()
    lines = str(caught.value).splitlines()
    assert len(lines) == 1
    return lines[0].removeprefix("scene.yaml: ")


def test_command_line_over_scene_over_defaults(folder):
    scene = folder(FLOOR + "bake: {tolerance: 0.05, seed: 7}\nlods: [0.5]\n")
    read = scene_folder.read(scene, {"scene": str(scene), "bake": {"tolerance": 0.02}})
    defaults = yaml.safe_load(scene_folder.DEFAULTS_FILE.read_text())
    assert read.settings["bake"] == {**defaults["bake"], "tolerance": 0.02, "seed": 7, "first_look": False}
    assert read.settings["lods"] == [0.5] and read.settings["budget"] == "64 MiB"
    assert read.where(("bake", "tolerance")) == ("command line", None)
    assert read.where(("bake", "seed")) == (str(scene / "scene.yaml"), 3)
    assert read.where(("budget",))[0] == "config/bake.yaml"


def test_dotted_keys_and_texts_of_a_command_line(folder):
    typed = {
        "bake.tolerance": "2e-2",
        "bake": {"bounces": "1"},
        "lods": ["0.5", {"deviation": "1 mm"}],
        "budget": "1MiB",
    }
    settings = scene_folder.read(folder(FLOOR), typed).settings
    assert (settings["bake"]["tolerance"], settings["bake"]["bounces"]) == (0.02, 1)
    assert (settings["lods"], settings["budget"]) == ([0.5, {"deviation": "1 mm"}], "1MiB")


@pytest.mark.parametrize(
    "typed, said",
    [
        ({"buget": 1}, "command line: buget: unknown key; did you mean budget?"),
        ({"bake": {"tolerence": 0.01}}, "command line: bake.tolerence: unknown key; did you mean tolerance?"),
        ({"bake.tolerance": float("nan")}, "command line: bake.tolerance: nan is not a finite number"),
        ({"bake.tolerance": "inf"}, "command line: bake.tolerance: inf is not a finite number"),
        ({"bake.tolerance": 3}, "command line: bake.tolerance: 3 is out of range; allowed: 0.002 to 0.1"),
        ({"bake": 5}, "command line: bake: expected keys with values, found 5"),
        ({"bake": {"seed": 1}, "bake.seed": 2}, "command line: bake.seed: set twice"),
        ({"lods": None}, "command line: lods: expected a list, found nothing"),
    ],
)
def test_mistakes_of_the_command_line_say_so(folder, typed, said):
    assert refused(folder(FLOOR), typed) == said


def test_mistakes_of_all_sources_are_listed_at_once(folder):
    message = refused(folder(FLOOR + "bake: {seed: -1}\nunits: inch\n"), {"lods": []})
    assert [line.split(": ")[1] for line in message.splitlines()] == ["lods", "bake.seed", "units"]
    assert "(line 3)" in message and "(line 4)" in message


def test_missing_scenes(folder, tmp_path):
    assert refused(tmp_path / "none") == f"{tmp_path}/none: no such folder"
    assert refused(tmp_path) == f"{tmp_path}/scene.yaml: no such file"
    assert refused(folder("units: m\n")) == f"{tmp_path}/scene.yaml: geometry is missing"
    assert "geometry: the list is empty" in refused(folder("geometry: []\n"))
    assert scene_folder.read(folder(FLOOR) / "scene.yaml").folder == tmp_path


@pytest.mark.parametrize(
    "written, said",
    [
        ("bake: {tolerance: 0}", "bake.tolerance: 0 is out of range; allowed: 0.002 to 0.1 (line 3)"),
        ("bake: {tolerance: '0.01'}", "bake.tolerance: expected a number, found the text '0.01' (line 3)"),
        ("bake: {tolerance: true}", "bake.tolerance: expected a number, found true (line 3)"),
        ("bake: {max_level: -1}", "bake.max_level: -1 is out of range; allowed: 3 to 9 (line 3)"),
        ("bake: {max_level: 6.0}", "bake.max_level: expected a whole number, found 6.0 (line 3)"),
        ("bake: {convergence: -0.1}", "bake.convergence: -0.1 is out of range; allowed: 1e-06 to 0.1 (line 3)"),
        ("bake: {rays_per_element: 0}", "expected auto, or a whole number from 16 to 4096 (line 3)"),
        ("bake: {gather_rays: many}", "expected auto, or a whole number from 16 to 65536 (line 3)"),
        ("bake: {bounces: 0}", "expected converge, or a whole number of reflections"),
        ("bake: {shadow_rays: [0, 4]}", "bake.shadow_rays[0]: 0 is out of range; allowed: 1 to 4096 (line 3)"),
        ("bake: {relative_to: surfaces}", "did you mean surface?"),
        ("budget: 0", "budget: 0 is not allowed; expected a whole number of bytes >= 1"),
        ("budget: much", "budget: 'much' is not allowed; expected a whole number of bytes"),
        ("budget: -5 MiB", "budget: '-5 MiB' is not allowed"),
        ("lods: [0]", "lods[0]: 0 is out of range; allowed: > 0 and <= 1 (line 3)"),
        ("lods: [{deviation: 0}]", "lods[0].deviation: 0 is not allowed; expected a number > 0"),
        ("lods: [{deviation: 1 mm, share: 1}]", "lods[0]: expected one of deviation, triangles, share, and only one"),
        ("materials: {a: {reflectance: 1.01}}", "materials.a.reflectance: 1.01 is out of range; allowed: 0 to 1"),
        ("materials: {a: {reflectance: [1, 1]}}", "materials.a.reflectance: expected a list of 3, found 2"),
        ("materials: {a: {reflectance: [0.1, 0.2, -0.1]}}", "materials.a.reflectance[2]: -0.1 is out of range"),
        ("materials: {a: {emission: -1}}", "materials.a.emission: -1 is out of range; allowed: >= 0"),
        ("materials: {a: {repeat: [0, 1]}}", "materials.a.repeat[0]: 0 is out of range"),
        (
            "surfaces: {'*': {role: ful}}",
            "surfaces.*.role: 'ful' is not allowed; expected full or cast_only or receive_only",
        ),
        ("camera: {eye: [0, 0, 1]}", "camera: target is missing"),
        ("export: {profiles: [lightmap]}", "export.profiles[0]: 'lightmap' is not allowed; expected standard"),
    ],
)
def test_values_out_of_their_range_are_refused_with_the_range(written, said):
    assert said in mistake(written)


@pytest.mark.parametrize(
    "entry, said",
    [
        ("{name: a}", "surface a: one of rectangle, quadrangle, triangle, nurbs, file is wanted"),
        ("{name: a, file: b.bpt, triangle: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}", "and only one"),
        (
            "{name: a, rectangle: {origin: [0, 0], u: [1, 0, 0], v: [0, 1, 0]}}",
            "rectangle.origin: expected a list of 3",
        ),
        ("{name: a, rectangle: {origin: [0, 0, 0], u: [1, 0, x], v: [0, 1, 0]}}", "rectangle.u[2]: expected a number"),
        ("{name: a, rectangle: {origin: [0, 0, 2.0e+100], u: [1, 0, 0], v: [0, 1, 0]}}", "between -1e100 and 1e100"),
        ("{name: a, rectangel: {}}", "rectangel: unknown key; did you mean rectangle?"),
        ("{name: a, file: b.bpt, place: {scale: 0}}", "place.scale: 0 is not allowed; expected a number other than 0"),
        ("{name: a, file: b.bpt, place: {scale: [1, 2]}}", "place.scale: expected a list of 3, found 2"),
        ("{name: a, file: b.bpt, place: [{rotate: {axis: [0, 0, 1]}}]}", "place[0].rotate: degrees is missing"),
        ("{name: a, file: b.bpt, trimmed: what}", "trimmed: 'what' is not allowed; expected keep or skip or refuse"),
        ("{name: a, nurbs: {degree_u: 0, degree_v: 1, points: []}}", "nurbs.degree_u: 0 is out of range"),
        ("{name: a, nurbs: {degree_u: 1.5, degree_v: 1, points: []}}", "nurbs.degree_u: expected a whole number"),
        ("{name: a, nurbs: {degree_u: 1, degree_v: 1, points: []}}", "nurbs.points: the list is empty"),
        ("5", "geometry[1]: expected keys with values, found 5"),
    ],
)
def test_geometry_entries_are_named_in_complaints(entry, said):
    mistakes = Mistakes()
    scene_schema.check(strict_yaml.parse(f"{FLOOR}- {entry}\n", "scene.yaml"), mistakes, "scene.yaml")
    with pytest.raises(Refusal) as caught:
        mistakes.stop()
    assert said in str(caught.value) and "(line 3)" in str(caught.value)


def test_the_defaults_fit_the_schema_and_name_every_key_of_bake():
    defaults = strict_yaml.read(scene_folder.DEFAULTS_FILE)
    mistakes = Mistakes()
    scene_schema.check(defaults, mistakes, "config/bake.yaml", required=False)
    mistakes.stop()
    known = set(scene_schema._validator().schema["$defs"]["bake"]["properties"])
    assert set(defaults["bake"]) == known - {"quality"}  # another name for a tolerance
