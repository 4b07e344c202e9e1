"""The stage that draws a scene before its bake: axes, sides, roles and meshes of a scene folder come out right."""

import json

import numpy as np
import pytest

from lib.formats import pictures, preflight, scene_import
from lib.formats.artefact import read_json
from stages import first_look

# A red wall on the left, a green one on the right, a white floor and a lamp above, seen along y (up: z).
Z_UP = """
up: z
geometry:
- {name: floor, rectangle: {origin: [-1, 0, 0], u: [2, 0, 0], v: [0, 2, 0]}}
- {name: left, rectangle: {origin: [-1, 0, 0], u: [0, 2, 0], v: [0, 0, 2]}, material: red}
- {name: right, rectangle: {origin: [1, 0, 0], u: [0, 2, 0], v: [0, 0, 2]}, material: green, flip: true}
- {name: lamp, rectangle: {origin: [-0.5, 0.5, 2], u: [0, 1, 0], v: [1, 0, 0]}, material: lamp}
materials:
  red: {reflectance: [0.7, 0, 0]}
  green: {reflectance: [0, 0.7, 0]}
  lamp: {reflectance: 0, emission: 10}
camera: {eye: [0, -3, 1], target: [0, 0, 1], fov: 40}
bake: {first_look: true}
"""
Y_UP = """
up: y
units: mm
geometry:
- {name: floor, rectangle: {origin: [-1000, 0, 0], u: [2000, 0, 0], v: [0, 0, -2000]}}
- {name: left, rectangle: {origin: [-1000, 0, 0], u: [0, 0, -2000], v: [0, 2000, 0]}, material: red}
- {name: right, rectangle: {origin: [1000, 0, 0], u: [0, 0, -2000], v: [0, 2000, 0]}, material: green, flip: true}
- {name: lamp, rectangle: {origin: [-500, 2000, -500], u: [0, 0, -1000], v: [1000, 0, 0]}, material: lamp}
materials:
  red: {reflectance: [0.7, 0, 0]}
  green: {reflectance: [0, 0.7, 0]}
  lamp: {reflectance: 0, emission: 10}
camera: {eye: [0, 1000, 3000], target: [0, 1000, 0], fov: 40}
bake: {first_look: true}
"""


@pytest.fixture
def drawn(tmp_path, monkeypatch, capsys):
    """Linear light (400, 640, 3) of the picture of a scene.yaml."""
    monkeypatch.chdir(tmp_path)

    def draw(text, **files):
        folder = tmp_path / "room"
        folder.mkdir(exist_ok=True)
        (folder / "scene.yaml").write_text(text)
        for name, content in files.items():
            (folder / name.replace("_", ".")).write_text(content)
        found = preflight.load(folder)
        told = {name: found.settings[name] for name in ("camera", "up")}
        options = ["--scene-slice", found.slices["geometry"], "--materials", found.slices["materials"]]
        options += ["--textures", found.slices["textures"]]
        options += ["--settings", json.dumps({**told, "units": "m", "exposure": 0.3}), "--out", "look.png"]
        assert first_look.main(options) == 0 and "first look: look.png" in capsys.readouterr().out
        return pictures.read_linear("look.png", "srgb")

    return draw


def sides(light):
    """Mean light of the picture's parts where the left wall, the right wall, floor and lamp are."""
    parts = light[150:250, 150:200], light[150:250, 440:490], light[340:360, 280:360], light[50:70, 300:340]
    return [part.mean(axis=(0, 1)) for part in parts]


def test_walls_floor_and_lamp_are_where_they_belong(drawn):
    left, right, floor, lamp = sides(drawn(Z_UP))
    assert left[0] > 0.02 and left[1] == left[2] == 0
    assert right[1] > 0.02 and right[0] == right[2] == 0
    assert (floor > 0.02).all() and floor[2] < floor[0]  # blue comes from the lamp alone
    assert lamp == pytest.approx([0.3 * 10 / np.pi] * 3, rel=0.01)


def test_up_and_units_change_nothing(drawn):
    a, b = drawn(Z_UP), drawn(Y_UP)
    assert np.abs(np.array(sides(a)) - sides(b)).max() < 0.02 * a.max()
    assert np.mean(np.abs(a - b) > 0.1) < 0.01


def test_a_mesh_and_a_back(drawn, tmp_path):
    """The floor as a mesh, the left wall turned away: not seen, unless it has two sides, each of its own colour."""
    mesh = "v -1 0 0\nv 1 0 0\nv 1 2 0\nv -1 2 0\nf 1 2 3\nf 1 3 4\n"
    text = Z_UP.replace("rectangle: {origin: [-1, 0, 0], u: [2, 0, 0], v: [0, 2, 0]}", "file: floor.obj")
    whole = sides(drawn(Z_UP))
    assert np.abs(np.array(sides(drawn(text, floor_obj=mesh))) - whole).max() < 0.03 * np.max(whole)
    away = Z_UP.replace("material: red}", "material: red, flip: true}")
    background = sides(drawn(away))[0]
    assert background[0] == pytest.approx(background[2], rel=0.3)  # grey
    both = away.replace("flip: true}\n- {name: right", "flip: true, two_sided: true}\n- {name: right")
    assert sides(drawn(both))[0] == pytest.approx(whole[0], rel=0.1, abs=1e-6)
    blue = both.replace("  lamp: {", "  blue: {reflectance: [0, 0, 0.7]}\n  lamp: {")
    left = sides(drawn(blue.replace("camera:", "surfaces: {left/back: {material: blue}}\ncamera:")))[0]
    assert left[2] > 0.02 and left[0] == left[1] == 0


def test_things_of_a_scene(tmp_path):
    """Roles; a back goes with its front; the file's numbers in metres, y up."""
    roles = "surfaces: {right: {role: cast_only}, floor: {role: receive_only}}\ncamera:"
    (tmp_path / "scene.yaml").write_text(Z_UP.replace("camera:", roles).replace("red}", "red, two_sided: true}"))
    found = preflight.load(tmp_path, results_root=tmp_path / "results")
    x = scene_import.read(read_json(found.slices["geometry"]), tmp_path, "scene.yaml", charts=False)
    assert x.names == ["floor", "lamp", "left", "left/back", "right"]
    floor, lamp, left, right = first_look.things(x, found.rho_avg, {}, {})
    assert (floor.blocks, lamp.blocks, left.blocks, right.blocks) == (False, True, True, True)
    assert (floor.front.reflects, left.front.reflects, right.front.reflects) == (True, True, False)
    assert left.back.rho.tolist() == [0.7, 0, 0] and floor.back is None
    assert (lamp.front.E == 10).all() and not left.front.E.any()
    assert floor.V.min(axis=0).tolist() == [-1, 0, -2] and floor.V.max(axis=0).tolist() == [1, 0, 0]


def halves(path, left, right):
    """A picture of two colours, 8-bit linear."""
    image = np.zeros((8, 16, 3), np.uint8)
    image[:, :8], image[:, 8:] = left, right
    pictures.write_png8(path, image)


def test_pictures_of_materials_and_of_lamps(drawn, tmp_path):
    """Red is left in the picture, blue right: on the floor u goes to the right, on the right wall, which is turned by
    `flip`, into the depth, so red is near; the floor as a mesh says the same by its texture coordinates.  Of the lamp,
    whose u goes into the depth as well, the near half is red, the far one green.
    """
    (tmp_path / "room").mkdir()
    halves(tmp_path / "room/tiles.png", [200, 0, 0], [0, 0, 200])
    halves(tmp_path / "room/lamp.png", [255, 0, 255], [0, 255, 255])
    text = Z_UP.replace("v: [0, 2, 0]}}", "v: [0, 2, 0]}, material: tiles}").replace(
        "material: green", "material: tiles"
    )
    tiles = "  tiles: {texture: tiles.png, colour_space: linear}\n"
    text = text.replace("  lamp: {", tiles + "  lamp: {emission_texture: lamp.png, ")
    mesh = "v -1 0 0\nv 1 0 0\nv 1 2 0\nv -1 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    floor = "rectangle: {origin: [-1, 0, 0], u: [2, 0, 0], v: [0, 2, 0]}"
    for written in (text, text.replace(floor, "file: floor.obj")):
        light = drawn(written, floor_obj=mesh)
        near, far = light[150:250, 475:490].mean(axis=(0, 1)), light[150:250, 440:450].mean(axis=(0, 1))
        left, right = light[340:360, 240:310].mean(axis=(0, 1)), light[340:360, 330:400].mean(axis=(0, 1))
        for red, blue in ((left, right), (near, far)):
            assert red[0] > 0.01 and red[2] == 0 and blue[2] > 0.01 and blue[0] == 0
        rows = light[30:90, 310:330].mean(axis=1)
        lamp = rows[rows[:, 2] > 0.3]
        assert len(lamp) > 20 and (lamp[:3, 0] > 0.3).all() and (lamp[-3:, 1] > 0.3).all()
        assert not lamp[:3, 1].any() and not lamp[-3:, 0].any()
        if written is text:  # a mesh's pictures go round
            assert not light[360:375, 170:300, 2].any() and not light[360:375, 350:470, 0].any()
