"""Reading back the exported files: what a viewer finds in a .gltf or .glb, as parts and textures of a picture.

Written against the glTF 2.0 specification and not with the library the files are written with, so that a fault of ours
in the files shows in the picture. Read: nodes with matrix, TRS or lod children, triangle primitives, float positions
and texture coordinates of any set, vertex colours, base colour texture and factor, sampler wrap, images by file, data
URI or buffer view. Ignored: everything that does not change an unlit picture.
"""

import base64
import json
import os
import struct
import tempfile
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from lib.formats import pictures
from lib.formats.artefact import ArtefactError
from lib.refusal import Refusal
from lib.report.picture import Part, Texture

COMPONENT = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
COUNT = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
WRAP = {33071: "clamp", 10497: "repeat", 33648: "mirror"}


def load(path, known=None):
    """(list of Part, list of Texture) of a .gltf or .glb file. Raises ArtefactError naming the file and the fault.

    known : {picture file: its texels and their light} of files read before, added to; levels that name the same
        pictures read them once
    """
    path, known = Path(path), {} if known is None else known
    try:
        document, buffers = _open(path)
        textures = [_texture(document, buffers, path, t, known) for t in document.get("textures", [])]
        scene = document["scenes"][document.get("scene", 0)]
        parts = []
        for node in scene["nodes"]:
            _walk(document, buffers, node, np.eye(4), parts)
    except FileNotFoundError as error:
        raise ArtefactError(f"{error.filename or path}: missing") from error
    except Refusal as error:  # an exported texture is a file of ours
        raise ArtefactError(str(error)) from error
    except (OSError, ValueError, KeyError, IndexError, TypeError, struct.error) as error:
        raise ArtefactError(f"{path}: not readable as glTF ({type(error).__name__}: {error})") from error
    return parts, textures


def _open(path):
    """The JSON document and the bytes of every buffer."""
    data = path.read_bytes()
    binary = None
    if data[:4] == b"glTF":
        document, at = None, 12
        while at < len(data):
            length, kind = struct.unpack_from("<I4s", data, at)
            chunk = data[at + 8 : at + 8 + length]
            if kind == b"JSON":
                document = json.loads(chunk)
            elif kind == b"BIN\0":
                binary = chunk
            at += 8 + length
    else:
        document = json.loads(data)
    buffers = [_bytes(path, b["uri"]) if "uri" in b else binary for b in document.get("buffers", [])]
    return document, buffers


def _bytes(path, uri):
    if uri.startswith("data:"):
        return base64.b64decode(uri.split(",", 1)[1])
    return (path.parent / unquote(uri)).read_bytes()


def _view(document, buffers, index):
    view = document["bufferViews"][index]
    start = view.get("byteOffset", 0)
    return buffers[view["buffer"]][start : start + view["byteLength"]], view.get("byteStride", 0)


def _accessor(document, buffers, index):
    """Values (n, components) of an accessor; normalised integers become [0, 1] or [-1, 1]."""
    accessor = document["accessors"][index]
    dtype, width, n = np.dtype(COMPONENT[accessor["componentType"]]), COUNT[accessor["type"]], accessor["count"]
    data, stride = _view(document, buffers, accessor["bufferView"])
    start, item = accessor.get("byteOffset", 0), dtype.itemsize * width
    stride = stride or item
    if start + (n - 1) * stride + item > len(data):
        raise ValueError(f"accessor {index} reaches past its buffer view")
    values = np.ndarray((n, width), dtype, data, start, (stride, dtype.itemsize))
    if accessor.get("normalized"):
        return np.maximum(values / np.iinfo(dtype).max, -1.0)
    return values.astype(float if dtype.kind == "f" else np.int64)


def _walk(document, buffers, index, above, parts):
    node = document["nodes"][index]
    matrix = above @ _matrix(node)
    if "mesh" in node:
        mesh = document["meshes"][node["mesh"]]
        for primitive in mesh["primitives"]:
            if primitive.get("mode", 4) == 4:
                name = node.get("name") or mesh.get("name") or ""
                parts.append(_part(document, buffers, primitive, matrix, name))
    for child in node.get("children", []):
        _walk(document, buffers, child, matrix, parts)


def _matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(node.get("scale", (1, 1, 1)), float)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _part(document, buffers, primitive, matrix, name):
    attributes = primitive["attributes"]
    V = _accessor(document, buffers, attributes["POSITION"]) @ matrix[:3, :3].T + matrix[:3, 3]
    F = (
        _accessor(document, buffers, primitive["indices"])[:, 0] if "indices" in primitive else np.arange(len(V))
    ).reshape(-1, 3)
    if np.linalg.det(matrix[:3, :3]) < 0:
        F = F[:, ::-1]
    colour = _accessor(document, buffers, attributes["COLOR_0"])[:, :3] if "COLOR_0" in attributes else None
    material = document["materials"][primitive["material"]] if "material" in primitive else {}
    base = material.get("pbrMetallicRoughness", {})
    slot = base.get("baseColorTexture")
    ST = None
    if slot is not None:
        ST = _accessor(document, buffers, attributes[f"TEXCOORD_{slot.get('texCoord', 0)}"])
        ST = _transformed(ST, slot.get("extensions", {}).get("KHR_texture_transform", {}))
    return Part(
        V,
        F,
        ST,
        colour,
        tuple(base.get("baseColorFactor", (1, 1, 1, 1))[:3]),
        -1 if slot is None else slot["index"],
        bool(material.get("doubleSided")),
        name,
    )


def _transformed(st, how):
    """KHR_texture_transform: offset + rotation (scale st)."""
    angle = how.get("rotation", 0.0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return (st * how.get("scale", (1, 1))) @ turn.T + how.get("offset", (0, 0))


def _texture(document, buffers, path, texture, known):
    image = document["images"][texture["source"]]
    sampler = document["samplers"][texture["sampler"]] if "sampler" in texture else {}
    wrap = tuple(WRAP[sampler.get(key, 10497)] for key in ("wrapS", "wrapT"))
    if "uri" in image and not image["uri"].startswith("data:"):
        file = path.parent / unquote(image["uri"])
        if file not in known:
            known[file] = pictures.read_codes(file)
        texels, light = known[file]
    else:
        data = _bytes(path, image["uri"]) if "uri" in image else _view(document, buffers, image["bufferView"])[0]
        handle, name = tempfile.mkstemp(suffix=".jpg" if data[:2] == b"\xff\xd8" else ".png")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            texels, light = pictures.read_codes(name)
        finally:
            os.unlink(name)
    return Texture(texels, wrap, light)


def inlined(path, largest=1 << 27):
    """What the report's viewer needs of a .gltf: (document with its buffers as data URIs, {picture uri: data URI}).

    The document's images keep their uri, so that levels which name the same picture get the same one.
    Raises ArtefactError naming the file; returns None where buffers and pictures exceed `largest` bytes.
    """
    path = Path(path)
    try:
        document = json.loads(path.read_bytes())
        total, pictures_found = 0, {}
        for buffer in document.get("buffers", []):
            data = _bytes(path, buffer["uri"])
            total += len(data)
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        for image in document.get("images", []):
            if not image["uri"].startswith("data:"):
                data = _bytes(path, image["uri"])
                total += len(data)
                kind = "jpeg" if data[:2] == b"\xff\xd8" else "png"
                pictures_found[image["uri"]] = f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
            if total > largest:
                return None
    except FileNotFoundError as error:
        raise ArtefactError(f"{error.filename or path}: missing") from error
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ArtefactError(f"{path}: not readable as glTF ({type(error).__name__}: {error})") from error
    return document, pictures_found
