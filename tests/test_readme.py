"""The README says what is so: its files exist, its scene and settings are accepted, its lists are complete."""

import re
import shutil
import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

from lib.formats import preflight, scene_model

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
needs_ocp = pytest.mark.skipif(find_spec("OCP") is None, reason="needs the extra `step`")


def block(language, word):
    """The one code block of a language that holds a word."""
    (found,) = [text for kind, text in BLOCKS if kind == language and word in text]
    return found


@pytest.fixture
def own_scene(tmp_path):
    """The scene of 'Your own scene', as its shell commands make it."""
    text = block("sh", "scene.yaml")
    folder = tmp_path / "my room"
    folder.mkdir()
    shutil.copy(ROOT / re.search(r"^cp (\S+)", text, re.MULTILINE)[1], folder)
    lines = re.search(r"<<'END'\n(.*?)^END", text, re.MULTILINE | re.DOTALL)[1]
    (folder / "scene.yaml").write_text(lines, encoding="utf-8")
    assert len(lines.splitlines()) == 5
    return folder


def test_the_five_lines_are_a_scene(own_scene, tmp_path):
    scene = preflight.load(own_scene, {}, tmp_path / "results")
    assert scene.name == "my-room" and f"results/{scene.name}/" in README
    assert {"floor", "lamp", "teapot/01"} <= set(scene.names)
    assert not scene.warnings


@pytest.mark.parametrize(
    ("file", "surfaces"),
    [
        ("v7_my_surfaces.3dm", 1),
        ("CornellBox-Original.obj", 8),
        ("car.glb", 9),
        ("teapot.bpt", 32),
        ("teapot.teaset.txt", 32),
        pytest.param("NIST_MBE_PMI_11.stp", 10, marks=needs_ocp),
        pytest.param("test_pipe.iges", 4, marks=needs_ocp),
    ],
)
def test_a_model_and_three_lines_are_a_scene(file, surfaces, tmp_path):
    name = "model" + Path(file).suffix
    shutil.copy(ROOT / "tests" / "data" / file, tmp_path / name)
    lines = block("yaml", "light: studio").replace("model.3dm", name)
    (tmp_path / "scene.yaml").write_text(lines, encoding="utf-8")
    made = scene_model.read(tmp_path).scene
    fronts = [full for full in made.names if full.startswith("model") and not full.endswith("/back")]
    assert len(lines.splitlines()) == 3 and len(fronts) == surfaces
    assert scene_model.STUDIO in made.names
    for kind in ("`.zip` ", f"`{Path(file).suffix}`"):
        assert kind in README


def test_the_settings_shown_are_accepted(own_scene, tmp_path):
    settings = yaml.safe_load(block("yaml", "lods:"))
    scene = preflight.load(own_scene, settings, tmp_path / "results")
    assert scene.settings["budget"] == 16 * 2**20
    assert len(scene.settings["lods"]) == 3
    typed = dict(text.split("=", 1) for text in re.findall(r'"(\w+=[^"]*)"', block("sh", "bake={tolerance")))
    scene = preflight.load(own_scene, {k: yaml.safe_load(v) for k, v in typed.items()}, tmp_path / "results")
    assert scene.settings["bake"]["tolerance"] == 0.02 and scene.settings["budget"] == 2 * 2**20


def test_named_files_exist():
    folders = "data|lib|tests|stages|config|benchmarks|[.]ci"
    names = re.findall(rf"(?:\]\(|`)((?:{folders})/[^\s`)]*|Snakefile|pyproject[.]toml)", README)
    assert len(names) > 10
    assert not [name for name in names if not (ROOT / name).exists()]


def test_every_stage_is_listed_in_order():
    listed = re.search(r"The stages, in order: (.*?)\. Each", README, re.DOTALL)[1]
    listed = [name for name in re.sub(r"\([^)]*\)", "", listed).replace("\n", " ").replace(" ", "").split(",") if name]
    drawn = re.findall(r"^\s*rule (\w+):", (ROOT / "Snakefile").read_text(encoding="utf-8"), re.MULTILINE)
    order = list(dict.fromkeys(re.sub("_(in)?direct$", "", name) for name in drawn if name != "all"))
    assert listed == order
    assert not [name for name in listed if not (ROOT / "stages" / f"{name}.py").exists()]


@pytest.mark.parametrize("text", [text for kind, text in BLOCKS if kind == "sh"], ids=lambda text: text.split()[0])
def test_shell_blocks_are_shell(text):
    assert subprocess.run(["bash", "-n"], input=text, text=True, capture_output=True).stderr == ""
