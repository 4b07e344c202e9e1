"""A glTF file written by hand, byte by byte, and read back as a viewer would."""

import base64
import json
import struct

import numpy as np
import pytest

from lib.formats import exported, pictures
from lib.formats.artefact import ArtefactError
from lib.maps.colour import srgb_to_linear
from lib.report.camera import Camera
from lib.report.picture import join, render

CODES = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [200, 150, 100]]], np.uint8)
V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
ST = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "<f4")
F = np.array([0, 1, 2, 0, 2, 3], "<u2")


def document(uri, image):
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "above", "translation": [0, 0, -2], "children": [1]}, {"name": "square", "mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_1": 1}, "indices": 2, "material": 0}]}],
        "materials": [
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}, "baseColorFactor": [1, 1, 1, 1]}}
        ],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33071, "wrapT": 33071}],
        "images": [image],
        "buffers": [{"byteLength": 92, **({"uri": uri} if uri else {})}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 12},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4},
            {"bufferView": 1, "componentType": 5126, "type": "VEC2", "count": 4},
            {"bufferView": 2, "componentType": 5123, "type": "SCALAR", "count": 6},
        ],
    }


def data():
    return V.tobytes() + ST.tobytes() + F.tobytes()


def write_gltf(folder, image=None):
    pictures.write_png8(folder / "a b.png", CODES)
    (folder / "x.bin").write_bytes(data())
    (folder / "x.gltf").write_text(json.dumps(document("x.bin", image or {"uri": "a%20b.png"})))
    return folder / "x.gltf"


def corners(path):
    parts, textures = exported.load(path)
    camera = Camera((0.5, 0.5, -2 + 0.5 / np.tan(np.radians(30))), (0.5, 0.5, -2), 60)
    image = render(join(parts), textures, camera, 10, 10, samples=1)
    return image[[2, 2, 7, 7], [2, 7, 2, 7]].tolist()


def test_a_textured_square_shows_its_texels_in_place(tmp_path):
    path = write_gltf(tmp_path)
    assert corners(path) == CODES.reshape(4, 3).tolist()
    parts, textures = exported.load(path)
    assert parts[0].name == "square" and parts[0].V[:, 2].tolist() == [-2] * 4
    assert textures[0].wrap == ("clamp", "clamp")
    assert textures[0].rgb == pytest.approx(srgb_to_linear(CODES / 255), abs=1e-6)


def test_pictures_in_a_data_uri_and_in_a_binary_file(tmp_path):
    png = write_gltf(tmp_path).parent / "a b.png"
    uri = "data:image/png;base64," + base64.b64encode(png.read_bytes()).decode()
    assert corners(write_gltf(tmp_path, {"uri": uri})) == CODES.reshape(4, 3).tolist()

    picture = png.read_bytes()
    doc = document(None, {"bufferView": 3, "mimeType": "image/png"})
    doc["bufferViews"].append({"buffer": 0, "byteOffset": 92, "byteLength": len(picture)})
    text = json.dumps(doc).encode()
    text += b" " * (-len(text) % 4)
    binary = data() + picture
    glb = b"glTF" + struct.pack("<II", 2, 28 + len(text) + len(binary))
    glb += struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    (tmp_path / "x.glb").write_bytes(glb)
    assert corners(tmp_path / "x.glb") == CODES.reshape(4, 3).tolist()


def test_faults_name_the_file(tmp_path):
    path = write_gltf(tmp_path)
    (tmp_path / "x.bin").write_bytes(data()[:-4])
    with pytest.raises(ArtefactError, match=r"x\.gltf: not readable.*past its buffer view"):
        exported.load(path)
    (tmp_path / "x.bin").unlink()
    with pytest.raises(ArtefactError, match=r"x\.bin: missing"):
        exported.load(path)
