"""Pictures that say how brightly the places of a surface shine: found, read once each, and their averages."""

import hashlib
import os
import tempfile
from pathlib import Path

from lib.formats import pictures
from lib.maps import emission
from lib.refusal import Refusal
from lib.surfaces.mesh import Mesh

EMBEDDED = "embedded:"
LINEAR = (".exr", ".hdr")


def row(material):
    """What a material says of its emission picture: file as written, colour_space, repeat.  None without one."""
    if "emission_texture" not in material:
        return None
    written = material["emission_texture"]
    return {
        "file": written,
        "colour_space": material.get("colour_space", colour_space(written)),
        "repeat": [float(n) for n in material.get("repeat", [1, 1])],
    }


def colour_space(written):
    """How a picture's numbers are taken where nothing is said."""
    return "linear" if Path(written).suffix.lower() in LINEAR else "srgb"


def located(written, folder, pictures_folder):
    """Path of a picture as written, of the scene's folder or embedded in a geometry file."""
    return Path(pictures_folder, written[len(EMBEDDED) :]) if written.startswith(EMBEDDED) else Path(folder, written)


class EmissionPictures:
    """The emission pictures of a scene in `folder`, whose scene.yaml messages call `file`.

    embedded : {KEY: bytes} of geometry files;  warnings : sentences, filled as pictures are read
    """

    def __init__(self, folder, file, embedded):
        self.folder, self.file, self.embedded, self.warnings = folder, file, embedded, []
        self._opened, self._averages = {}, {}

    def average(self, material, surface):
        """Area-weighted mean (3,) of a material's picture on a surface, linear.  Refusal: no line of its own, but what
        is wrong and the file it is wrong in, as text."""
        found = row(material)
        if isinstance(surface, Mesh) and surface.T is None:
            raise Refusal("the mesh has no texture coordinates")
        key = id(surface), found["file"], found["colour_space"], *found["repeat"]
        if key not in self._averages:
            picture = self._picture(found["file"], found["colour_space"])
            self._averages[key] = surface, emission.average(surface, picture, found["repeat"])  # surface: id stays its
        return self._averages[key][1]

    def _picture(self, written, space):
        if (written, space) not in self._opened:
            shown = str(Path(self.file).parent / written)
            try:
                self._opened[written, space] = self._read(written, space, shown)
            except Refusal as error:
                self._opened[written, space] = error
        found = self._opened[written, space]
        if isinstance(found, Refusal):
            raise found
        return found

    def _read(self, written, space, shown):
        data = self.embedded.get(written[len(EMBEDDED) :]) if written.startswith(EMBEDDED) else None
        path = str(self.folder / written)
        if data is not None:
            handle, path = tempfile.mkstemp()
            with os.fdopen(handle, "wb") as file:
                file.write(data)
        try:
            warn = lambda text: self.warnings.append(text.replace(path, shown))  # noqa: E731
            return pictures.read_linear(path, space, warn, most=pictures.ANY)
        except Refusal as error:
            raise Refusal(str(error).replace(path, shown)) from None
        finally:
            if data is not None:
                os.unlink(path)


def read_checked(found, folder, pictures_folder):
    """The picture of a row, linear; ValueError if it is no longer the one whose digest the row has."""
    path = located(found["file"], folder, pictures_folder)
    if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != found["digest"]:
        raise ValueError("changed")
    return pictures.read_linear(path, found["colour_space"], most=pictures.ANY)
