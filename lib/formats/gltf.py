"""Writing glTF 2.0: surfaces with their baked light as unlit materials.  The one importer of pygltflib.

Conventions: y up; images are what a viewer shows, row 0 at t = 0; texture coordinates follow the texel-centre rule, a
map of w samples puts u at s = (u (w - 1) + 0.5) / w, because samples lie on grid crossings, borders included.
Colours are linear: images are sRGB files, factors and vertex colours are linear numbers, as glTF has it.
"""

import json
from dataclasses import dataclass
from urllib.parse import quote

import numpy as np
import pygltflib as g

from lib.formats.artefact import atomic

UNLIT, LOD = "KHR_materials_unlit", "MSFT_lod"
GENERATOR = "patchlight"
KEY = "moeller_bake"  # what our extras are filed under


@dataclass(frozen=True)
class Material:
    """How one surface looks: a picture, or one linear RGB colour in [0, 1]; both None where vertices carry the colour.

    uri is the picture's path beside the .gltf; png its bytes, for files that hold their pictures.
    """

    name: str
    colour: tuple | None = None
    uri: str | None = None
    png: bytes | None = None


@dataclass(frozen=True)
class Piece:
    """One surface's triangles in one level: V, N (k, 3); ST (k, 2) or None; colour (k, 3) linear or None; F (m, 3)."""

    name: str
    material: int
    V: np.ndarray
    N: np.ndarray
    F: np.ndarray
    ST: np.ndarray | None = None
    colour: np.ndarray | None = None


def texture_coordinates(uv, w, h):
    """(k, 2) texture coordinates of parameters uv (k, 2) on a map of w x h samples: texel centres.

    >>> texture_coordinates(np.array([[0.0, 1.0]]), 2, 5).tolist()
    [[0.25, 0.9]]
    """
    size = np.array([w, h])
    return (np.asarray(uv) * (size - 1) + 0.5) / size


def y_up(vectors, up):
    """Vectors (..., 3) of a world whose `up` is "y" or "z", in glTF's frame: z becomes y, and -y becomes z."""
    vectors = np.asarray(vectors)
    return vectors if up == "y" else np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], axis=-1)


def _accessor(view, at, component, count, kind, low, high):
    return g.Accessor(
        bufferView=view, byteOffset=at, componentType=component, count=count, type=kind, min=low, max=high
    )


class _Gltf(g.GLTF2):
    """The library's document, written as JSON in one pass: its own way copies every object, 0.2 s for 70 surfaces.

    A file that people read has a line for each element of its lists: json's encoder is ten times slower with indents.
    """

    def gltf_to_json(self, separators=None, indent=None):
        def filled(part):
            return {k: v for k, v in vars(part).items() if k[0] != "_" and v is not None and v != [] and v != {}}

        encode = json.JSONEncoder(default=filled, separators=separators, allow_nan=False).encode
        if indent is None:
            return encode(self)
        listed = {
            key: "[\n" + ",\n".join(map(encode, value)) + "\n]" if isinstance(value, list) else encode(value)
            for key, value in filled(self).items()
        }
        return "{\n" + ",\n".join(f"{encode(key)}: {text}" for key, text in listed.items()) + "\n}"


class _Document:
    """A glTF document under construction, and the bytes of its one buffer."""

    def __init__(self, extras):
        self.gltf = _Gltf(asset=g.Asset(version="2.0", generator=GENERATOR, extras={KEY: extras}), scenes=[], scene=0)
        self.blob = bytearray()
        self.extras = extras

    def view(self, data, target=None, stride=None):
        """Append bytes as a buffer view, on a multiple of four."""
        self.blob += b"\0" * (-len(self.blob) % 4)
        view = g.BufferView(buffer=0, byteOffset=len(self.blob), byteLength=len(data), target=target, byteStride=stride)
        self.blob += data
        self.gltf.bufferViews.append(view)
        return len(self.gltf.bufferViews) - 1

    def materials(self, materials, is_embedded):
        """Add materials, their textures and images, in order; one sampler for all."""
        if any(m.uri for m in materials):
            self.gltf.samplers.append(
                g.Sampler(
                    magFilter=g.LINEAR, minFilter=g.LINEAR_MIPMAP_LINEAR, wrapS=g.CLAMP_TO_EDGE, wrapT=g.CLAMP_TO_EDGE
                )
            )
        for m in materials:
            base = g.PbrMetallicRoughness(metallicFactor=0.0, roughnessFactor=1.0)
            if m.uri:
                image = g.Image(name=m.name, uri=None if is_embedded else quote(m.uri))
                if is_embedded:
                    image.bufferView, image.mimeType = self.view(m.png), "image/png"
                self.gltf.images.append(image)
                self.gltf.textures.append(g.Texture(source=len(self.gltf.images) - 1, sampler=0, name=m.name))
                base.baseColorTexture = g.TextureInfo(index=len(self.gltf.textures) - 1, texCoord=0)
            elif m.colour is not None:
                base.baseColorFactor = [*(float(x) for x in m.colour), 1.0]
            self.gltf.materials.append(
                g.Material(name=m.name, pbrMetallicRoughness=base, extensions={UNLIT: {}}, extras={KEY: self.extras})
            )
        self.use(UNLIT)

    def use(self, extension):
        if extension not in self.gltf.extensionsUsed:
            self.gltf.extensionsUsed.append(extension)

    def level(self, pieces, suffix=""):
        """Add one mesh and node a piece; the node numbers."""
        pieces = [p for p in pieces if len(p.F)]
        packed = {
            "POSITION": self._packed([p.V for p in pieces]),
            "NORMAL": self._packed([p.N for p in pieces]),
            "TEXCOORD_0": self._packed([p.ST for p in pieces]),
            "COLOR_0": self._packed([p.colour for p in pieces]),
        }
        short = all(len(p.V) < 65535 for p in pieces)
        indices = self._indices([p.F for p in pieces], np.uint16 if short else np.uint32)
        nodes = []
        for k, piece in enumerate(pieces):
            attributes = {name: accessors[k] for name, accessors in packed.items() if accessors[k] is not None}
            primitive = g.Primitive(attributes=g.Attributes(**attributes), indices=indices[k], material=piece.material)
            self.gltf.meshes.append(g.Mesh(name=piece.name + suffix, primitives=[primitive]))
            self.gltf.nodes.append(g.Node(name=piece.name + suffix, mesh=len(self.gltf.meshes) - 1))
            nodes.append(len(self.gltf.nodes) - 1)
        return nodes

    def _packed(self, arrays):
        """Float accessors of arrays (k, c), None kept, in one buffer view."""
        arrays = [None if a is None else np.ascontiguousarray(a, dtype="<f4") for a in arrays]
        present = [a for a in arrays if a is not None]
        if not present:
            return [None] * len(arrays)
        width = present[0].shape[1]
        view = self.view(b"".join(a.tobytes() for a in present), g.ARRAY_BUFFER, 4 * width)
        out, at = [], 0
        for a in arrays:
            if a is None:
                out.append(None)
                continue
            low, high = a.min(axis=0).tolist(), a.max(axis=0).tolist()
            self.gltf.accessors.append(_accessor(view, at, g.FLOAT, len(a), f"VEC{width}", low, high))
            out.append(len(self.gltf.accessors) - 1)
            at += a.nbytes
        return out

    def _indices(self, arrays, dtype):
        data = [np.ascontiguousarray(a, dtype=dtype).tobytes() for a in arrays]
        view, at, out = self.view(b"".join(data), g.ELEMENT_ARRAY_BUFFER), 0, []
        kind = g.UNSIGNED_SHORT if dtype is np.uint16 else g.UNSIGNED_INT
        for a, raw in zip(arrays, data, strict=True):
            high, low = [int(a.max())], [int(a.min())]
            self.gltf.accessors.append(_accessor(view, at, kind, a.size, g.SCALAR, low, high))
            out.append(len(self.gltf.accessors) - 1)
            at += len(raw)
        return out

    def root(self, name, nodes, origin):
        """A node above `nodes`, moved to `origin` (3,)."""
        far = [float(x) for x in origin] if np.any(origin) else None
        self.gltf.nodes.append(g.Node(name=name, children=nodes, translation=far))
        return len(self.gltf.nodes) - 1


def write_level(path, pieces, materials, origin, extras):
    """Write one level as `path` (.gltf) and its .bin beside it; return their bytes together.

    pieces : list of Piece, positions relative to `origin` (3,);  materials : list of Material with `uri`
    extras : dict, put under "moeller_bake" in the asset and in every material
    """
    document = _Document(extras)
    document.materials(materials, is_embedded=False)
    root = document.root("scene", document.level(pieces), origin)
    document.gltf.scenes.append(g.Scene(nodes=[root]))
    binary = path.with_suffix(".bin")
    document.gltf.buffers.append(g.Buffer(uri=quote(binary.name), byteLength=len(document.blob)))
    text = (document.gltf.gltf_to_json(indent=1) + "\n").encode()
    for target, data in ((binary, bytes(document.blob)), (path, text)):
        with atomic(target) as file:
            file.write(data)
    return len(document.blob) + len(text)


def write_combined(path, levels, materials, coverage, origin, extras):
    """Write all levels in one .glb, pictures inside: the finest is the scene, the others hang on it by MSFT_lod.

    levels : list of lists of Piece, finest first;  coverage : smallest screen coverage of each level
    All levels name the same materials and textures.  Viewers without the extension show the finest level.  Returns
    bytes.
    """
    document = _Document(extras)
    document.materials(materials, is_embedded=True)
    roots = []
    for k, pieces in enumerate(levels):
        suffix = f"_LOD{k}" if k else ""
        roots.append(document.root(f"scene{suffix}", document.level(pieces, suffix), origin))
    if len(roots) > 1:
        document.use(LOD)
        finest = document.gltf.nodes[roots[0]]
        finest.extensions = {LOD: {"ids": roots[1:]}}
        finest.extras = {"MSFT_screencoverage": [float(c) for c in coverage]}
    document.gltf.scenes.append(g.Scene(nodes=[roots[0]]))
    document.blob += b"\0" * (-len(document.blob) % 4)
    document.gltf.buffers.append(g.Buffer(byteLength=len(document.blob)))
    document.gltf.set_binary_blob(bytes(document.blob))
    data = b"".join(document.gltf.save_to_bytes())
    with atomic(path) as file:
        file.write(data)
    return len(data)
