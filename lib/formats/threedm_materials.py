"""Materials of a Rhino file as under `materials` of scene.yaml.

Colours are what a picker shows, sRGB: diffuse colour, or the base colour of a physically based material (measured with
rhino3dm 8.35: the conversion keeps the numbers).  White emission counts as the radiance 1 W/(m2 sr), so the exitance
is pi times the linear colour; below FAINT of white it is there to brighten a picture, and no light.  A bitmap takes the
place of the diffuse colour.
"""

import base64
from pathlib import Path

import numpy as np

from lib.formats import names
from lib.formats.mesh_pictures import LFS, Pictures, pointer
from lib.formats.mistakes import listed
from lib.maps.colour import srgb_to_linear

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB (ITU-R BT.709)
FAINT = 0.05  # of white, linear
MOST_EMBEDDED = 256 << 20  # bytes of one picture in the file


class Materials:
    """Materials of a File3dm by the keys that patches name.

    folder : of the .3dm, where textures are looked for;  root : the folder above it up to which they are, or None
    """

    def __init__(self, model, folder, root=None):
        self._model, self._keys, self.made = model, {}, {}
        self._textures = _Textures(model, Path(folder), Path(root or folder))
        self._transparent, self._faint = {}, {}

    def index(self, attributes, layer, parent=None):
        """Index of an object's material, or None: its own, its layer's, or `parent`, the block reference's."""
        source = attributes.MaterialSource.name
        if source == "MaterialFromParent":
            return parent
        if source == "MaterialFromObject":
            return attributes.MaterialIndex
        return None if layer is None else layer.RenderMaterialIndex

    def key(self, index):
        """Key of the material of an index, or None if there is none."""
        if index is None or not 0 <= index < len(self._model.Materials):
            return None
        if index not in self._keys:
            self._keys[index] = self._read(self._model.Materials[index], index)
        return self._keys[index]

    def add(self, name, material):
        """Put a material under `name`, or under one made from it if that stands for another material: its key."""
        return names.add(self.made, name, material)

    def notes(self):
        """Sentences about textures that are not there and materials that are taken for others."""
        glass = [f"materials that let light through, opaque here: {listed(self._transparent)}"]
        faint = [f"materials with a faint glow, which gives no light here: {listed(self._faint)}"]
        return self._textures.notes() + (glass if self._transparent else []) + (faint if self._faint else [])

    def _read(self, found, index):
        name = (found.Name or "").strip() or f"material {index + 1}"
        physical = found.PhysicallyBased
        if physical is not None and physical.Supported:
            colour, glow = _linear(physical.BaseColor), _linear(physical.EmissionColor)
            opacity = physical.Opacity
        else:
            colour, glow = (_linear(np.array(c) / 255) for c in (found.DiffuseColor, found.EmissionColor))
            opacity = 1.0 - found.Transparency
        material, texture = {"reflectance": colour}, found.GetBitmapTexture()
        path = self._textures.find(texture, name)
        if path is not None:
            material = {"texture": path}
            repeat = [abs(float(texture.Repeat.X)), abs(float(texture.Repeat.Y))]
            if repeat != [1.0, 1.0] and min(repeat) > 0:
                material["repeat"] = repeat
        if max(glow) >= FAINT:
            material["emission"] = [np.pi * c for c in glow]
        key = self.add(name, material)
        if opacity < 0.999:
            self._transparent[key] = None
        if 0 < max(glow) < FAINT:
            self._faint[key] = None
        return key

    @property
    def pictures(self):
        """{KEY: bytes} of the pictures in the file that materials use."""
        return self._textures.embedded


def light(source, area):
    """Material of a rectangular light of `area` [m2]: its power over its area, else radiance by intensity and colour.

    Power in W counts 683 lm each, so its exitance is the luminance of the emission; without a power an intensity of 1
    is a white radiance of 1 W/(m2 sr).
    """
    colour = np.array(_linear(np.array(source.Diffuse) / 255)) * float(source.Intensity)
    watts = float(source.PowerWatts)
    brightness = float(LUMINANCE @ colour)
    scale = watts / (area * brightness) if watts > 0 and brightness > 0 else np.pi
    return {"reflectance": [0.0, 0.0, 0.0], "emission": (scale * colour).tolist()}


class _Textures:
    """Bitmaps a file names: beside it, in a folder above it, or in it."""

    def __init__(self, model, folder, root):
        self._model, self._folder, self._faults = model, folder, Pictures(folder)
        self.embedded, self._known = {}, None
        inside = [folder, *folder.parents]
        self._folders = inside[: inside.index(root) + 1] if root in inside else [folder]

    def find(self, texture, material):
        """Path relative to the folder, "embedded:KEY", or None (with the reason kept) for a rhino3dm Texture."""
        if texture is None or not texture.Enabled:
            return None
        name = (texture.FileName or "").replace("\\", "/").rstrip("/").split("/")[-1].strip()
        if not name:
            self._faults.fault(f"of material {material}", "no file name")
            return None
        for number, folder in enumerate(self._folders):
            found = _entry(folder, name)
            if found is None:
                continue
            with open(folder / found, "rb") as file:
                fault = pointer(file.read(len(LFS)))
            if fault:
                self._faults.fault(name, fault)
                return None
            return "../" * number + found
        return self._embedded(name)

    def _embedded(self, name):
        if self._known is None:
            files = (self._model.EmbeddedFiles[k] for k in range(len(self._model.EmbeddedFiles)))
            self._known = {file.Filename.replace("\\", "/").split("/")[-1].lower(): file for file in files}
        file = self._known.get(name.lower())
        if file is None:
            self._faults.fault(name, "no such file")
            return None
        if name not in self.embedded:
            if file.Length > MOST_EMBEDDED:
                self._faults.fault(name, f"{file.Length >> 20} MiB")
                return None
            self.embedded[name] = base64.b64decode(self._model.GetEmbeddedFileAsBase64(file.Filename))
        return f"embedded:{name}"

    def notes(self):
        return self._faults.notes()


def _entry(folder, name):
    """The file of that name in a folder, in whatever case it is written there, or None."""
    try:
        same = [entry.name for entry in folder.iterdir() if entry.name.lower() == name.lower() and entry.is_file()]
    except OSError:
        return None
    return name if name in same else min(same, default=None)


def _linear(colour):
    """Linear [r, g, b] of sRGB numbers in [0, 1]; what follows them (alpha) is left away."""
    encoded = np.clip(np.array(colour[:3], dtype=np.float64), 0.0, 1.0)
    return np.clip(srgb_to_linear(encoded), 0.0, 1.0).tolist()
