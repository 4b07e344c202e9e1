"""What every reader of geometry files returns, and where it notes its mistakes."""

import fnmatch
from dataclasses import dataclass, field

from lib.formats import names
from lib.formats.mistakes import Mistakes, listed
from lib.nurbs.surface import NurbsSurface
from lib.surfaces.mesh import Flat, Mesh
from lib.surfaces.trimmed import TrimmedSurface

MAX_PATCHES = 100_000


def is_selected(labels, only):
    """Does one of a surface's labels match the pattern `only`?  All are selected where that is None."""
    return only is None or any(fnmatch.fnmatchcase(label, only) for label in labels)


@dataclass(frozen=True)
class Patch:
    """One surface of a file.

    number : from 1, its place in the file
    surface : NurbsSurface, TrimmedSurface or Mesh (without charts) in the file's unit and axes
    flip : the lit side is against S_u x S_v
    labels : texts that the entry's `only` may match (layer, object name, number)
    material : key of GeometryFile.materials, or None
    solid : part of a closed body (True), of an open sheet (False), or nobody said (None)
    area : of the surface [square of the file's unit], None where it was not measured yet
    shape : surfaces with the same text are one mesh moved about: the same triangles and corners in the same order
    """

    number: int
    surface: NurbsSurface | TrimmedSurface | Mesh
    flip: bool = False
    labels: tuple = ()
    material: str | None = None
    solid: bool | None = None
    shape: str | None = None
    area: float | None = None


@dataclass(frozen=True)
class GeometryFile:
    """Patches of a file in its order, with what was left out.

    total : how many patches the file counts, those that were not selected included; it fixes the padding of names
    metres : length of the file's unit [m], None if the file states none
    notes : one sentence per kind of thing that was skipped
    trimmed : numbers of the trimmed surfaces that were skipped
    materials : {name: as under `materials` of scene.yaml}; a texture is a path relative to the file's folder, or
        "embedded:KEY"
    pictures : {KEY: bytes} of embedded pictures
    up : axis that points up in the file ("y", "z"), None if the format states none
    """

    patches: list
    total: int
    metres: float | None = None
    notes: list = field(default_factory=list)
    trimmed: list = field(default_factory=list)
    materials: dict = field(default_factory=dict)
    pictures: dict = field(default_factory=dict)
    up: str | None = None


@dataclass
class Report:
    """Where a reader notes its mistakes: in `file`, about patch `number` of the entry `name`.

    flat, coloured : names of meshes without an area, which are left out, and of those with colours at their vertices
    """

    mistakes: Mistakes
    file: str
    name: str
    total: int = 1
    flat: list = field(default_factory=list)
    coloured: list = field(default_factory=list)

    def of(self, number):
        """The name of patch `number`."""
        return names.patch(self.name, number, self.total)

    def notes(self):
        """One sentence per kind of thing that is not taken over."""
        kinds = ((self.flat, "meshes without an area are left out:"), (self.coloured, "vertex colours are not used:"))
        return [f"{what} {listed(found)}" for found, what in kinds if found]

    def add(self, what, number=None, field=None, line=None):
        surface = None if number is None else self.of(number)
        self.mistakes.add(what, self.file, surface, field, line)

    def fatal(self, what, number=None, field=None, line=None):
        """Note a mistake after which reading can not go on, and stop."""
        self.add(what, number, field, line)
        self.mistakes.stop()

    def surface(self, make, number, line=None):
        """`make()`, or None with the reason noted where it raises a ValueError (`FIELD: what`) or Flat."""
        try:
            return make()
        except Flat:
            self.flat.append(self.of(number))
            return None
        except ValueError as error:
            where, _, what = str(error).partition(": ")
            self.add(what or where, number, where if what else None, line)
            return None
