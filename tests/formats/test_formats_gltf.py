"""The written glTF, read back by a reader of our own that knows nothing of the writer."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest

from lib.formats import exported, pictures
from lib.formats.gltf import Material, Piece, texture_coordinates, write_combined, write_level, y_up

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
UP = np.tile([0.0, 0.0, 1.0], (4, 1))
F = np.array([[0, 1, 2], [0, 2, 3]])
EXTRAS = {"unit": "B_over_pi", "encoding": "srgb", "exposure": 2.5}


@pytest.fixture
def ramp(tmp_path):
    """A picture 9 x 5 whose red is u and whose green is v, and its material."""
    v, u = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 9), indexing="ij")
    pictures.write_png_srgb(tmp_path / "textures" / "a ramp.png", np.stack([u, v, 0 * u], axis=2))
    png = (tmp_path / "textures" / "a ramp.png").read_bytes()
    return Material("wall/1", uri="textures/a ramp.png", png=png)


def wall(material=0, name="wall/1"):
    return Piece(name, material, SQUARE, UP, F, texture_coordinates(SQUARE[:, :2], 9, 5))


def bilinear(picture, st):
    """What a viewer shows at texture coordinates st (k, 2) of a picture (h, w, 3), clamped, row 0 at t = 0."""
    h, w = picture.shape[:2]
    x, y = np.clip(st[:, 0] * w - 0.5, 0, w - 1), np.clip(st[:, 1] * h - 0.5, 0, h - 1)
    i, j = np.minimum(x.astype(int), w - 2), np.minimum(y.astype(int), h - 2)
    a, b = (x - i)[:, None], (y - j)[:, None]
    low = picture[j, i] * (1 - a) + picture[j, i + 1] * a
    return low * (1 - b) + (picture[j + 1, i] * (1 - a) + picture[j + 1, i + 1] * a) * b


@pytest.mark.parametrize("kind", ["level", "combined"])
def test_a_ramp_shows_its_own_parameters(tmp_path, ramp, kind):
    """Texel centres, upright: at every point of the wall the picture says the point's own u and v, corners included."""
    if kind == "level":
        path = tmp_path / "scene_LOD0.gltf"
        write_level(path, [wall()], [ramp], np.zeros(3), EXTRAS)
    else:
        path = tmp_path / "scene.glb"
        write_combined(path, [[wall()]], [ramp], [0.0], np.zeros(3), EXTRAS)
    [part], [texture] = exported.load(path)
    at = np.random.default_rng(5).random((200, 2))
    at[:4] = SQUARE[:, :2]
    below = at[:, 0] >= at[:, 1]  # which of the two triangles
    weights = np.where(
        below[:, None],
        np.stack([1 - at[:, 0], at[:, 0] - at[:, 1], at[:, 1]], 1),
        np.stack([1 - at[:, 1], at[:, 0], at[:, 1] - at[:, 0]], 1),
    )
    st = np.einsum("kc,kcx->kx", weights, part.ST[part.F[np.where(below, 0, 1)]])
    shown = bilinear(np.asarray(texture.rgb, float), st)
    assert np.abs(shown[:, :2] - at).max() < 0.008  # an 8-bit step near white, dithered
    assert texture.wrap == ("clamp", "clamp")


def test_names_materials_and_extras(tmp_path, ramp):
    path = tmp_path / "scene_LOD0.gltf"
    lamp = Material("lamp", colour=(1.0, 0.5, 0.25))
    n = write_level(path, [wall(), Piece("lamp", 1, SQUARE, UP, F)], [ramp, lamp], np.zeros(3), EXTRAS)
    document = json.loads(path.read_text())
    assert n == path.stat().st_size + (tmp_path / "scene_LOD0.bin").stat().st_size
    assert [m["name"] for m in document["meshes"]] == [m["name"] for m in document["materials"]] == ["wall/1", "lamp"]
    assert [node["name"] for node in document["nodes"]] == ["wall/1", "lamp", "scene"]
    assert document["extensionsUsed"] == ["KHR_materials_unlit"] and "extensionsRequired" not in document
    for material in document["materials"]:
        assert material["extensions"] == {"KHR_materials_unlit": {}}
        assert material["extras"] == {"moeller_bake": EXTRAS}
    assert document["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"] == [1.0, 0.5, 0.25, 1.0]
    assert document["images"][0]["uri"] == "textures/a%20ramp.png"
    assert document["buffers"][0]["uri"] == "scene_LOD0.bin"
    assert "TEXCOORD_0" not in document["meshes"][1]["primitives"][0]["attributes"]


def test_levels_share_materials_in_the_combined_file(tmp_path, ramp):
    write_combined(
        tmp_path / "scene.glb", [[wall()], [wall()], [wall()]], [ramp], [0.5, 0.1, 1e-6], np.zeros(3), EXTRAS
    )
    data = (tmp_path / "scene.glb").read_bytes()
    magic, version, length, n_json, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    document = json.loads(data[20 : 20 + n_json])
    assert len(document["materials"]) == len(document["textures"]) == len(document["images"]) == 1
    assert len(document["meshes"]) == 3 and {m["primitives"][0]["material"] for m in document["meshes"]} == {0}
    [top] = document["scenes"][0]["nodes"]
    root = document["nodes"][top]
    assert root["extras"]["MSFT_screencoverage"] == [0.5, 0.1, 1e-6]
    names = [document["nodes"][k]["name"] for k in root["extensions"]["MSFT_lod"]["ids"]]
    assert names == ["scene_LOD1", "scene_LOD2"]
    image = document["bufferViews"][document["images"][0]["bufferView"]]
    start = 20 + n_json + 8 + image["byteOffset"]
    assert data[start : start + image["byteLength"]] == ramp.png
    assert len(exported.load(tmp_path / "scene.glb")[0]) == 1  # a viewer without the extension draws one level


@pytest.mark.parametrize("kind", ["gltf", "glb"])
def test_accessors_are_aligned_and_bounded(tmp_path, ramp, kind):
    odd = Piece("odd", 0, SQUARE[:3], UP[:3], F[:1], SQUARE[:3, :2])
    path = tmp_path / f"a.{kind}"
    if kind == "gltf":
        write_level(path, [odd, wall()], [ramp], np.zeros(3), EXTRAS)
        document, blob = json.loads(path.read_text()), (tmp_path / "a.bin").read_bytes()
    else:  # the picture's bytes come first, one too many
        write_combined(path, [[odd, wall()]], [replace(ramp, png=ramp.png + b"!")], [0.0], np.zeros(3), EXTRAS)
        data = path.read_bytes()
        n = struct.unpack_from("<I", data, 12)[0]
        document, blob = json.loads(data[20 : 20 + n]), data[28 + n :]
        assert len(ramp.png + b"!") % 4 or len(ramp.png) % 4
    size = {5123: 2, 5125: 4, 5126: 4}
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        at = view["byteOffset"] + accessor["byteOffset"]
        n = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
        assert at % size[accessor["componentType"]] == 0
        assert accessor["byteOffset"] + accessor["count"] * n * size[accessor["componentType"]] <= view["byteLength"]
        dtype = {5123: "<u2", 5125: "<u4", 5126: "<f4"}[accessor["componentType"]]
        values = np.frombuffer(blob, dtype, accessor["count"] * n, at).reshape(-1, n)
        assert accessor["min"] == values.min(axis=0).tolist() and accessor["max"] == values.max(axis=0).tolist()


def test_many_vertices_take_wide_indices(tmp_path):
    t = np.linspace(0, 1, 70_000)
    V = np.stack([t, t**2, 0 * t], axis=1)
    strip = np.stack([np.arange(69_998), np.arange(1, 69_999), np.arange(2, 70_000)], axis=1)
    big = Piece("big", 0, V, np.tile([0.0, 0, 1], (70_000, 1)), strip)
    write_level(tmp_path / "a.gltf", [big], [Material("big", colour=(1, 1, 1))], np.zeros(3), EXTRAS)
    [part], _ = exported.load(tmp_path / "a.gltf")
    assert np.array_equal(part.F, strip)


def test_z_up_becomes_y_up_and_far_scenes_keep_their_place(tmp_path, ramp):
    assert y_up([[1.0, 2.0, 3.0]], "z").tolist() == [[1, 3, -2]]
    assert y_up([[1.0, 2.0, 3.0]], "y").tolist() == [[1, 2, 3]]
    assert np.linalg.det(y_up(np.eye(3), "z")) == pytest.approx(1)  # a rotation: windings stay
    write_level(tmp_path / "a.gltf", [wall()], [ramp], np.array([1e5, 0, 0]), EXTRAS)
    [part], _ = exported.load(tmp_path / "a.gltf")
    assert np.allclose(part.V, SQUARE + [1e5, 0, 0])


def test_vertex_colours(tmp_path):
    colour = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], dtype=float)
    piece = Piece("g", 0, SQUARE, UP, F, colour=colour)
    write_level(tmp_path / "a.gltf", [piece], [Material("g")], np.zeros(3), EXTRAS)
    [part], _ = exported.load(tmp_path / "a.gltf")
    assert np.allclose(part.colour, colour) and part.factor == (1, 1, 1)


def test_same_bytes_twice(tmp_path, ramp):
    for name in ("a", "b"):
        write_combined(tmp_path / f"{name}.glb", [[wall()], [wall()]], [ramp], [1, 0], np.zeros(3), EXTRAS)
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


def test_a_piece_without_triangles_is_left_out(tmp_path, ramp):
    empty = Piece("none", 0, SQUARE, UP, F[:0])
    write_level(tmp_path / "a.gltf", [empty, wall()], [ramp], np.zeros(3), EXTRAS)
    assert len(exported.load(tmp_path / "a.gltf")[0]) == 1
