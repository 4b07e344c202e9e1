"""Textures on meshes, as the check of a scene folder sees them."""

import numpy as np
import pytest

from lib.formats import pictures, preflight
from lib.refusal import Refusal

SCENE = """
units: m
geometry:
- {name: lamp, rectangle: {origin: [0, 0, 2], u: [0, 1, 0], v: [1, 0, 0]}, material: lamp}
- {name: sheet, file: sheet.obj, units: m, material: paint}
materials:
  lamp: {power: 60}
  paint: {texture: paint.png, colour_space: linear}
"""
CORNERS = "v 0 0 0\nv 3 0 0\nv 3 1 0\nv 0 1 0\n"
# The right triangle lies on the picture's white half, the left one on the black.
WITH = CORNERS + "vt 0.1 0.1\nvt 0.4 0.1\nvt 0.6 0.1\nvt 0.9 0.9\nf 1/1 2/2 3/1\nf 1/3 3/4 4/4\n"
WITHOUT = CORNERS + "f 1 2 3\nf 1 3 4\n"


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A folder with a scene in it, which is the working folder."""
    monkeypatch.chdir(tmp_path)
    scene = tmp_path / "room"
    scene.mkdir()
    codes = np.zeros((64, 64, 3), np.uint8)
    codes[:, 32:] = 255
    pictures.write_png8(scene / "paint.png", codes)
    (scene / "scene.yaml").write_text(SCENE)
    return scene


def test_a_textured_mesh_shoots_with_its_average(home):
    (home / "sheet.obj").write_text(WITH)
    found = preflight.load(home)
    assert found.has_meshes
    (name,) = found.textures
    assert name.startswith("sheet")
    assert found.rho_avg[name] == pytest.approx([0.5] * 3, abs=1e-3)


def test_a_texture_on_a_mesh_without_coordinates_is_refused(home):
    (home / "sheet.obj").write_text(WITHOUT)
    with pytest.raises(Refusal) as refused:
        preflight.load(home)
    said = str(refused.value)
    assert said.startswith(f"{home / 'scene.yaml'}: surface sheet")
    assert said.endswith(": texture: the mesh has no texture coordinates")
