"""Materials and pictures of a glTF file, as a diffuse world can use them.

Base colour is taken as diffuse reflectance whatever metalness says.  Emission is a radiance; times pi it is the
exitance [W/m2].  Source: Khronos, glTF 2.0 specification, section 3.9, and the README files of the KHR extensions.
"""

import math
from pathlib import PurePosixPath
from urllib.parse import unquote

import numpy as np

from lib.formats import names
from lib.formats.gltf_buffers import Broken, data_uri, numbers, whole
from lib.formats.mesh_pictures import UNSEEN, pointer
from lib.formats.mistakes import listed

SPECULAR = "KHR_materials_pbrSpecularGlossiness"
UNLIT = "KHR_materials_unlit"
STRENGTH = "KHR_materials_emissive_strength"
TRANSFORM = "KHR_texture_transform"
REPEAT = 10497
_ENDINGS = {b"\x89PNG": "png", b"\xff\xd8\xff": "jpg", b"RIFF": "webp"}


class Materials:
    """Materials by index, read when first asked for.

    made : {name: as under `materials` of scene.yaml};  pictures : {key: bytes}
    """

    def __init__(self, container):
        self.container = container
        self.made, self.pictures = {}, {}
        self._names, self._textures = {}, {}
        self._glowing, self._unlit, self._see_through, self._clamped, self._unplaced = {}, {}, {}, {}, {}

    def name(self, index):
        """Name of material `index`, which stands in `made` from then on."""
        if not isinstance(index, int) or index not in self._names:
            self._names[index] = self._free_name(self.container.item("materials", index), index)
            self._read(index, self._names[index])
        return self._names[index]

    def coordinates(self, index):
        """Which TEXCOORD the texture of material `index` wants and the map (2, 3) to apply; None without texture."""
        return self._textures.get(index)

    def note_outside(self, index):
        """Note that a primitive uses places outside the picture of a texture that does not repeat."""
        if index in self._clamped:
            self._clamped[index] = True

    def note_unplaced(self, index):
        """Note that a primitive with a texture has no texture coordinates."""
        self._unplaced[self._names[index]] = None

    def notes(self):
        """One sentence per kind of thing that is not taken over."""
        clamped = [self._names[k] for k, is_outside in self._clamped.items() if is_outside]
        kinds = (
            (self._glowing, "emission textures that can not be used; no light comes from"),
            (self._unlit, "unlit materials are lit like others:"),
            (self._see_through, "see-through materials are opaque:"),
            (self._unplaced, "without texture coordinates, the picture's corner is taken:"),
            (dict.fromkeys(clamped), "textures that do not repeat in the file repeat here:"),
        )
        return [f"{what} {listed(found)}" for found, what in kinds if found]

    def _free_name(self, material, index):
        name = material.get("name")
        name = names.canonical(name)[:100] if isinstance(name, str) and name.strip() else "material"
        taken = [m.get("name") for m in self.container.items("materials")].count(material.get("name")) > 1
        return f"{name}.{index}" if taken or name == "material" else name

    def _read(self, index, name):
        material = self.container.item("materials", index)
        extensions = table(material, "extensions")
        glossy = table(extensions, SPECULAR)
        base = glossy or table(material, "pbrMetallicRoughness")
        factor, texture = ("diffuseFactor", "diffuseTexture") if glossy else ("baseColorFactor", "baseColorTexture")
        colour = np.clip(numbers(base, factor, 4, [1.0] * 4)[:3], 0.0, 1.0).tolist()
        found = {"reflectance": colour}
        if texture in base:
            path = self._texture(index, table(base, texture))
            if path:
                found["texture"] = path
                if colour == [1.0, 1.0, 1.0]:
                    del found["reflectance"]
            else:
                found["reflectance"] = [UNSEEN * c for c in colour]
        emission = np.maximum(numbers(material, "emissiveFactor", 3, [0.0] * 3), 0.0)
        strength = numbers({"x": [table(extensions, STRENGTH).get("emissiveStrength", 1.0)]}, "x", 1, None)[0]
        if emission.max() > 0 and strength > 0:
            path = self._emission_texture(index, material) if "emissiveTexture" in material else None
            if path:
                found["emission_texture"] = path
            if path or "emissiveTexture" not in material:
                found["emission"] = (math.pi * strength * emission).tolist()
            else:
                self._glowing[name] = None
        if material.get("doubleSided") is True:
            found["two_sided"] = "auto"
        if UNLIT in extensions:
            self._unlit[name] = None
        if material.get("alphaMode") in ("BLEND", "MASK") or table(extensions, "KHR_materials_transmission"):
            self._see_through[name] = None
        self.made[name] = found

    def _emission_texture(self, index, material):
        """Path or `embedded:KEY` of the picture that multiplies the emission; None if it lies on the surface otherwise
        than the base texture does, for a surface has one set of coordinates."""
        own = self._textures.pop(index, None)
        path = self._texture(index, table(material, "emissiveTexture"))
        found = self._textures.get(index)
        if own is not None:
            self._textures[index] = own
            if found and not (own[0] == found[0] and np.array_equal(own[1], found[1])):
                return None
        return path

    def _texture(self, index, info):
        """Path or `embedded:KEY` of a texture's picture, or None."""
        texture = self.container.item("textures", whole(info, "index", None))
        source = texture.get("source")
        for extension in ("EXT_texture_webp", "KHR_texture_basisu"):
            if source is None:
                source = table(table(texture, "extensions"), extension).get("source")
        if source is None:
            return None
        path = self._picture(source)
        if path:
            change = table(table(info, "extensions"), TRANSFORM)
            self._textures[index] = whole(change, "texCoord", whole(info, "texCoord", 0)), _map(change)
            if "sampler" in texture:
                sampler = self.container.item("samplers", texture["sampler"])
                if {sampler.get("wrapS", REPEAT), sampler.get("wrapT", REPEAT)} != {REPEAT}:
                    self._clamped[index] = False
        return path

    def _picture(self, source):
        image, files = self.container.item("images", source), self.container.files
        uri = image.get("uri")
        if isinstance(uri, str) and not uri.startswith("data:"):
            return files.usable(unquote(uri))
        if isinstance(uri, str):
            data = data_uri(uri)
        elif "bufferView" in image:
            data = bytes(self.container.view(image["bufferView"]))
        else:
            raise Broken(f"images[{source}] has no bytes")
        shown = image.get("name") if isinstance(image.get("name"), str) and image["name"] else f"images[{source}]"
        ending = next((end for magic, end in _ENDINGS.items() if data.startswith(magic)), None)
        if ending is None:
            files.fault(shown[:80], pointer(data) or "no PNG, JPEG or WebP picture")
            return None
        key = f"{source}-{names.cleaned(PurePosixPath(shown).stem)}.{ending}"
        self.pictures[key] = data
        return f"embedded:{key}"


def table(item, key):
    """The object under a key, an empty one if there is none."""
    value = item.get(key, {})
    if not isinstance(value, dict):
        raise Broken(f"{key} is not an object")
    return value


def _map(change):
    """(2, 3) what KHR_texture_transform makes of (u, v, 1): scaled, turned counterclockwise as seen with v down, moved.

    The matrix printed in the extension's README turns the other way; its test model and the viewers turn this way.
    """
    x, y = numbers(change, "scale", 2, [1.0, 1.0])
    (angle,) = numbers({"rotation": [change.get("rotation", 0.0)]}, "rotation", 1, None)
    c, s = math.cos(angle), math.sin(angle)
    return np.column_stack([[c * x, -s * x], [s * y, c * y], numbers(change, "offset", 2, [0.0, 0.0])])
