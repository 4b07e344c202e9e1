"""glTF in: accessors of every kind, nodes that mirror and repeat, materials and pictures, and files that are broken."""

import base64
import json
import math
import struct
from pathlib import Path

import numpy as np
import pytest

from lib.formats import geometry_file
from lib.formats.mesh_pictures import UNSEEN
from lib.refusal import Refusal
from lib.surfaces.mesh_build import normals_areas

DATA = Path(__file__).parents[1] / "data"
TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
KINDS = {0: "SCALAR", 2: "VEC2", 3: "VEC3"}
TETRA = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype="f4")  # volume 1/6
FACES = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], dtype="u2")
PNG = b"\x89PNG and so on"


class Doc:
    """A glTF document typed in: `add` puts an array into the buffer and gives its accessor."""

    def __init__(self, **content):
        self.json = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": [], "nodes": [{"mesh": 0}],
                     "scenes": [{"nodes": [0]}], **content}  # fmt: skip
        self.blob = b""

    def view(self, data, **more):
        self.blob += b"\0" * (-len(self.blob) % 4)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **more})
        self.blob += data
        return len(self.json["bufferViews"]) - 1

    def add(self, array, **more):
        array = np.asarray(array)
        columns = array.shape[1] if array.ndim == 2 else 0
        accessor = {"bufferView": self.view(array.tobytes()), "componentType": TYPES[array.dtype.str[1:]],
                    "count": len(array), "type": KINDS[columns], **more}  # fmt: skip
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def mesh(self, *primitives):
        self.json.setdefault("meshes", []).append({"primitives": list(primitives)})
        return self

    def glb(self):
        self.json.setdefault("buffers", [{"byteLength": len(self.blob)}])
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        blob = self.blob + b"\0" * (-len(self.blob) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def tetra(**content):
    doc = Doc(**content)
    return doc.mesh({"attributes": {"POSITION": doc.add(TETRA)}, "indices": doc.add(FACES)})


@pytest.fixture
def read(tmp_path):
    def make(data, only=None, name="part.glb", **files):
        for other, content in files.items():
            (tmp_path / other.replace("_DOT_", ".")).write_bytes(content)
        data = data.glb() if isinstance(data, Doc) else data
        (tmp_path / name).write_bytes(data)
        return geometry_file.read(tmp_path / name, name, "part", only)

    return make


def volume(m):
    return np.einsum("ij,ij->", m.V[m.F[:, 0]], np.cross(m.V[m.F[:, 1]], m.V[m.F[:, 2]])) / 6


def corners(patch):
    return patch.surface.V[patch.surface.F].tolist()


def test_a_car_with_mirrored_parts():
    """1828 triangles in 7 meshes of 9 materials; 12 have no area, 12 repeat others.  Box 4 x 4.1 x 6.3."""
    content = geometry_file.read(DATA / "car.glb", "car.glb", "car")
    assert content.total == len(content.patches) == 9
    assert sum(len(p.surface.F) for p in content.patches) == 1828 - 12 - 12
    assert content.notes == ["left out: 12 triangles without an area, 12 triangles listed before"]
    size = np.ptp(np.concatenate([p.surface.V for p in content.patches]), axis=0)
    assert size == pytest.approx([4.0, 4.08, 6.32], abs=0.005)
    assert (content.up, content.metres) == ("y", 1.0)
    assert content.materials["Back Light Material"]["two_sided"] == "auto"
    by_label = {p.labels[0]: p for p in content.patches}
    for name in ("Front Lights", "Back Lights"):  # negative scale: still lit outside
        m = by_label[name].surface
        face, area = normals_areas(m.V, m.F)
        assert (np.einsum("ijk,ik->ij", m.N, face) > 0).all()
        outward = m.V[m.F].mean(axis=1) - m.V.mean(axis=0)
        assert (area * np.einsum("ij,ij->i", face, outward)).sum() > 0


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4", None])
def test_indices_of_every_size_and_none(read, dtype):
    doc = Doc()
    attributes = {"POSITION": doc.add(TETRA if dtype else TETRA[FACES])}
    content = read(doc.mesh({"attributes": attributes, **({"indices": doc.add(FACES.astype(dtype))} if dtype else {})}))
    (patch,) = content.patches
    assert corners(patch) == TETRA[FACES.reshape(-1, 3)].tolist()
    assert volume(patch.surface) == pytest.approx(1 / 6)


@pytest.mark.parametrize("mode, expected", [
    (5, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
    (6, [[1, 2, 0], [2, 3, 0], [3, 4, 0]]),
])  # fmt: skip
def test_strips_and_fans(read, mode, expected):
    V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 1], [1, 1, 2], [0, 2, 5]], dtype="f4")
    doc = Doc()
    (patch,) = read(doc.mesh({"attributes": {"POSITION": doc.add(V)}, "mode": mode})).patches
    assert corners(patch) == V[expected].tolist()


def test_quantised_strided_and_sparse_positions(read):
    doc = Doc()
    wide = np.zeros((4, 4), dtype="i2")
    wide[:, :3] = TETRA * 32767
    view = doc.view(wide.tobytes(), byteStride=8)
    at, values = (
        doc.view(np.array([3], dtype="u1").tobytes()),
        doc.view(np.array([[0, 0, -32767]], dtype="i2").tobytes()),
    )
    sparse = {"count": 1, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values}}
    doc.json["accessors"].append({"bufferView": view, "componentType": 5122, "count": 4, "type": "VEC3",
                                  "normalized": True, "sparse": sparse})  # fmt: skip
    (patch,) = read(doc.mesh({"attributes": {"POSITION": 0}, "indices": doc.add(FACES)})).patches
    assert patch.surface.V[patch.surface.F[1, 2]].tolist() == [0, 0, -1]
    assert volume(patch.surface) == pytest.approx(-1 / 6)


def test_an_accessor_without_bytes_is_zero_but_for_its_sparse_part(read):
    doc = Doc()
    at = doc.view(np.array([1, 2], dtype="u2").tobytes())
    values = doc.view(np.array([[1, 0, 0], [0, 1, 0]], dtype="f4").tobytes())
    sparse = {"count": 2, "indices": {"bufferView": at, "componentType": 5123}, "values": {"bufferView": values}}
    doc.json["accessors"].append({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse})
    (patch,) = read(doc.mesh({"attributes": {"POSITION": 0}})).patches
    assert corners(patch) == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]


def test_nodes_place_mirror_and_repeat(read):
    half = math.sqrt(0.5)
    nodes = [
        {"name": "all", "children": [1, 2, 3, 4], "scale": [2, 2, 2]},
        {"name": "plain", "mesh": 0, "translation": [1, 0, 0]},
        {"name": "turned", "mesh": 0, "rotation": [0, 0, half, half]},
        {"name": "mirrored", "mesh": 0, "scale": [1, 1, -1]},
        {"name": "tiny", "mesh": 0, "matrix": [1e-4, 0, 0, 0, 0, 1e-4, 0, 0, 0, 0, 1e-4, 0, 5, 6, 7, 1]},
    ]
    content = read(tetra(nodes=nodes))
    assert [p.labels[0] for p in content.patches] == ["plain", "turned", "mirrored", "tiny"]
    plain, turned, mirrored, tiny = (p.surface for p in content.patches)
    assert plain.V.tolist() == (2 * TETRA + [2, 0, 0])[[0, 2, 1, 3]].tolist()
    assert np.allclose(turned.V, 2 * np.array([[0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 0, 1]]), atol=1e-15)
    assert [volume(m) for m in (plain, turned, mirrored)] == pytest.approx([8 / 6] * 3)
    assert volume(tiny) == pytest.approx(8e-12 / 6, rel=1e-6)
    for m in (plain, turned, mirrored, tiny):
        assert np.abs(m.N - normals_areas(m.V, m.F)[0][:, None]).max() < 1e-6
    shapes = [p.shape for p in content.patches]
    assert shapes[0] == shapes[1]
    assert len(set(shapes)) == 3
    assert np.array_equal(plain.F, turned.F)
    assert [p.number for p in read(tetra(nodes=nodes), "t*").patches] == [2, 4]
    with pytest.raises(Refusal, match="nothing matches 'x'; nodes, meshes and materials: plain, all"):
        read(tetra(nodes=nodes), "x")


def test_copies_are_of_one_shape_to_six_digits(read):
    """What products of placements round makes no other shape; a tenth of a millimetre in a metre does."""
    nodes = [{"mesh": 0, "scale": [1, 1, z]} for z in (1.0, 1 + 2e-8, 1.0001)]
    plain, rounded, other = (p.shape for p in read(tetra(nodes=nodes, scenes=[{"nodes": [0, 1, 2]}])).patches)
    assert plain == rounded != other


def test_normals_and_texture_coordinates_follow(read):
    """Mirrored in x, scaled in z; T runs from the picture's lower left, v of the file from its upper left."""
    V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="f4")
    N = np.array([[0, 0, 1], [0.6, 0, 0.8], [0, 0, -1]], dtype="f4")
    uv = np.array([[0, 0], [65535, 0], [0, 13107]], dtype="u2")
    doc = Doc(nodes=[{"mesh": 0, "scale": [-1, 1, 2]}])
    attributes = {"POSITION": doc.add(V), "NORMAL": doc.add(N), "TEXCOORD_0": doc.add(uv, normalized=True)}
    content = read(doc.mesh({"attributes": attributes}))
    m = content.patches[0].surface
    assert corners(content.patches[0]) == [[[0, 0, 0], [0, 1, 0], [-1, 0, 0]]]
    assert np.allclose(m.T, [[[0, 1], [0, 0.8], [1, 1]]])
    tilted = np.array([-0.6, 0, 0.4]) / math.hypot(0.6, 0.4)
    assert np.allclose(m.N, [[[0, 0, 1], [0, 0, 1], tilted]], atol=1e-6)
    assert content.notes == ["1 triangle with a normal against the winding: the winding counts"]


def textured(texture=None, image=None, extra=None, **material):
    """A triangle whose texture coordinates 1 are its x and y, with a material."""
    base = {
        "baseColorFactor": [0.5, 0.25, 2.0, 0.1],
        "baseColorTexture": {"index": 0, "texCoord": 1, **(texture or {})},
    }
    doc = Doc(materials=[{"name": "paint", "pbrMetallicRoughness": base, **material}], textures=[{"source": 0}],
              images=[image or {"uri": "wall%20one.png"}], **(extra or {}))  # fmt: skip
    V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="f4")
    attributes = {"POSITION": doc.add(V), "TEXCOORD_1": doc.add(V[:, :2].copy())}
    return doc.mesh({"attributes": attributes, "material": 0})


def test_materials(read):
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 10}}
    doc = textured(emissiveFactor=[1, 0.5, 0], extensions=strength, doubleSided=True)
    content = read(doc, **{"wall one_DOT_png": PNG})
    assert content.materials == {
        "paint": {"reflectance": [0.5, 0.25, 1.0], "texture": "wall one.png", "two_sided": "auto",
                  "emission": pytest.approx([10 * math.pi, 5 * math.pi, 0])}
    }  # fmt: skip
    assert content.patches[0].material == "paint"
    assert content.patches[0].surface.T.tolist() == [[[0, 1], [1, 1], [0, 0]]]
    assert content.notes == []


def test_texture_transform_is_baked_in(read):
    change = {"KHR_texture_transform": {"offset": [0.5, 0.25], "scale": [2, 4], "rotation": math.pi / 2}}
    content = read(textured({"extensions": change}), **{"wall one_DOT_png": PNG})
    # Scaled, turned counterclockwise on the screen (u to the right goes up, v down goes right), moved.
    file = np.array([[0.5, 0.25], [0.5, 0.25 - 2], [0.5 + 4, 0.25]])
    assert np.allclose(content.patches[0].surface.T[0], np.stack([file[:, 0], 1 - file[:, 1]], axis=1))


@pytest.mark.parametrize("mode", ["BLEND", "MASK"])
def test_textures_that_do_not_repeat_and_lights_without_pictures_are_noted(read, mode):
    extra = {"samplers": [{"wrapS": 33071}], "cameras": [{}], "animations": [{}]}
    wide = {"extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}
    look = {"emissiveTexture": {"index": 0, "texCoord": 0}, "emissiveFactor": [1, 1, 1], "alphaMode": mode}
    doc = textured(wide, extra=extra, extensions={"KHR_materials_unlit": {}}, **look)
    doc.json["textures"][0]["sampler"] = 0
    doc.json["nodes"] += [{"camera": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}]
    doc.json["scenes"][0]["nodes"] += [1, 2]
    content = read(doc, **{"wall one_DOT_png": PNG})
    assert content.notes == [
        "skipped: 1 animation, 1 camera, 1 light (KHR_lights_punctual)",
        "emission textures that can not be used; no light comes from paint",
        "unlit materials are lit like others: paint",
        "see-through materials are opaque: paint",
        "textures that do not repeat in the file repeat here: paint",
    ]
    assert "emission" not in content.materials["paint"]


def test_emission_textures(read):
    """The picture multiplies the factor; alone, it brings its own coordinates."""
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 10}}
    look = {"emissiveTexture": {"index": 0, "texCoord": 1}, "emissiveFactor": [1, 0.5, 0], "extensions": strength}
    doc = textured(**look)
    del doc.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
    content = read(doc, **{"wall one_DOT_png": PNG})
    assert content.materials["paint"]["emission_texture"] == "wall one.png"
    assert content.materials["paint"]["emission"] == pytest.approx([10 * math.pi, 5 * math.pi, 0])
    assert content.patches[0].surface.T.tolist() == [[[0, 1], [1, 1], [0, 0]]] and content.notes == []


@pytest.mark.parametrize("way", ["view", "data"])
def test_pictures_inside_the_file(read, way):
    doc = textured()
    if way == "view":
        doc.json["images"] = [{"bufferView": doc.view(PNG), "mimeType": "image/png", "name": "../my wall"}]
        key = "0-my-wall.png"
    else:
        doc.json["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(PNG).decode()}]
        key = "0-images-0.png"
    content = read(doc)
    assert content.materials["paint"]["texture"] == f"embedded:{key}"
    assert content.pictures == {key: PNG}


@pytest.mark.parametrize("data, what", [
    (b"version https://git-lfs.github.com/spec/v1\noid", "a Git LFS pointer"),
    (None, "no such file"),
])  # fmt: skip
def test_pictures_that_are_not_there(read, data, what):
    content = read(textured(), **({"wall one_DOT_png": data} if data else {}))
    assert content.materials["paint"]["reflectance"] == [0.5 * UNSEEN, 0.25 * UNSEEN, UNSEEN]
    assert "texture" not in content.materials["paint"]
    (note,) = content.notes
    assert note.startswith(f"textures that are not used, a plain colour instead: wall one.png ({what}")


def test_gltf_with_files_and_data_uris(read):
    doc = tetra()
    for uri in ("my%20part.bin", "data:application/octet-stream;base64," + base64.b64encode(doc.blob).decode()):
        doc.json["buffers"] = [{"byteLength": len(doc.blob), "uri": uri}]
        text = json.dumps(doc.json).encode()
        content = read(text, name="part.gltf", **{"my part_DOT_bin": doc.blob})
        assert volume(content.patches[0].surface) == pytest.approx(1 / 6)


def test_lines_and_flat_things_are_passed_over(read):
    doc = tetra()
    flat = {"attributes": {"POSITION": doc.add(TETRA[:2].repeat(3, axis=0))}}
    doc.json["meshes"][0]["primitives"] += [{"attributes": {"POSITION": 0}, "mode": 1}, flat]
    content = read(doc)
    assert len(content.patches) == 1
    assert content.notes == ["skipped: 1 set of lines or points", "meshes without an area are left out: part/2"]


def test_vertex_colours_are_told_of_the_surfaces_that_have_them(read):
    doc = tetra()
    painted = {"attributes": {"POSITION": 0, "COLOR_0": doc.add(TETRA)}, "indices": 1}
    doc.json["meshes"][0]["primitives"] += [painted, dict(painted, mode=1)]
    assert read(doc).notes == ["skipped: 1 set of lines or points", "vertex colours are not used: part/2"]
    assert read(doc, "1").notes == ["skipped: 1 set of lines or points"]


def broken(**change):
    doc = tetra()
    for path, value in change.items():
        *keys, last = path.split("__")
        item = doc.json
        for key in keys:
            item = item[int(key) if key.isdigit() else key]
        item[int(last) if last.isdigit() else last] = value
    return doc.glb()


@pytest.mark.parametrize("data, what", [
    (b"glTF", "is cut off in its header"),
    (b"hello", "is not JSON"),
    (b"[" * 100_000, "is not JSON, or nested too deep"),
    (b'{"asset": {"version": "1.0"}}', "is no glTF 2 file"),
    (b'{"asset": {"version": "2.0"}, "x": NaN}', "NaN is not a finite number"),
    (tetra().glb()[:-20], "is cut off"),
    (tetra().glb()[:4] + b"\1" + tetra().glb()[5:], "is of version 1"),
    (broken(buffers=[{"byteLength": 10**9}]), r"buffers\[0\] holds .* bytes of 1000000000"),
    (broken(bufferViews__0__byteLength=10**6), r"bufferViews\[0\] ends at byte 1000000 .*cut off"),
    (broken(accessors__0__count=2 * 10**9), r"accessors\[0\]"),
    (broken(accessors__0__count=1000), r"accessors\[0\] reaches beyond its bufferView"),
    (broken(accessors__0__count=-1), "count: expected a whole number"),
    (broken(accessors__1__componentType=5122), r"accessors\[1\]: indices of type 5122"),
    (broken(accessors__0__type="VEC2"), r"accessors\[0\]: VEC2"),
    (broken(accessors__0__count=3), "an index is 3; there are 3 positions"),
    (broken(meshes__0__primitives__0__attributes={}), r"meshes\[0\].primitives\[0\]: has no POSITION"),
    (broken(nodes=[{"mesh": 7}]), r"meshes\[7\] is not there"),
    (broken(nodes=[{"mesh": 0, "children": [0]}]), "stands twice in the scene"),
    (broken(nodes=[{"mesh": 0, "scale": [1, 0, 1]}]), "no triangle has an area"),
    (broken(nodes=[{"mesh": 0, "scale": [1, "a", 1]}]), "scale: expected 3 finite numbers"),
    (broken(nodes=[{"mesh": 0, "rotation": [0, 0, 0, 0]}]), "quaternion of length 0"),
    (broken(nodes=[]), r"nodes\[0\] is not there"),
    (broken(scenes=[{"nodes": []}]), "holds no triangles"),
    (broken(scene=[0]), "is not there"),
    (broken(extensionsUsed=["KHR_draco_mesh_compression"]), "compressed with KHR_draco_mesh_compression"),
    (broken(extensionsRequired=["EXT_meshopt_compression"]), "compressed with EXT_meshopt_compression"),
    (broken(extensionsRequired=["ACME_shapes"]), "needs ACME_shapes"),
    (broken(extensionsUsed=["EXT_mesh_gpu_instancing"]), "EXT_mesh_gpu_instancing"),
    (broken(buffers=[{"byteLength": 9, "uri": "../../etc/passwd"}]), "outside the file's folder"),
    (broken(buffers=[{"byteLength": 9, "uri": "no.bin"}]), r"'no.bin' can not be read \(no such file\)"),
    (broken(buffers=[{"byteLength": 9, "uri": "data:,x"}]), "a data URI is not in base64"),
    (broken(nodes=5), "nodes is not a list"),
    (broken(meshes__0__primitives__0__indices=[1]), "is not there"),
])  # fmt: skip
def test_broken_files_are_refused(read, data, what):
    with pytest.raises(Refusal, match=what):
        read(data)


def test_positions_that_are_no_numbers_are_refused(read):
    doc = Doc()
    with pytest.raises(Refusal, match="positions: NaN"):
        read(doc.mesh({"attributes": {"POSITION": doc.add(TETRA[:3] * np.float32(np.nan))}}))


def test_damaged_documents_never_end_in_a_traceback(read):
    """Every value of the JSON in turn made something else: read, or refused."""
    original = json.loads(json.dumps(textured(emissiveFactor=[1, 1, 1]).json))
    blob = textured().blob

    def places(item, path=()):
        for key in item if isinstance(item, dict) else range(len(item)):
            yield (*path, key)
            if isinstance(item[key], dict | list):
                yield from places(item[key], (*path, key))

    for path in places(original):
        for value in (None, -1, 1e9, "x", [], {}, [[]], True):
            doc = Doc()
            doc.json, doc.blob = json.loads(json.dumps(original)), blob
            item = doc.json
            for key in path[:-1]:
                item = item[key]
            item[path[-1]] = value
            try:
                read(doc)
            except Refusal:
                pass
