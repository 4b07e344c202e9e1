"""One geometry file, of any kind that is read, as NURBS patches in the file's own unit."""

import hashlib
from dataclasses import dataclass, field
from pathlib import Path

from lib.formats import names
from lib.formats.mistakes import Mistakes
from lib.nurbs.surface import NurbsSurface
from lib.refusal import refusal

MAX_BYTES = 512 << 20
MAX_PATCHES = 100_000
KINDS = {".bpt": "Bezier patches", ".txt": "Bezier patches (teaset)", ".json": "geomdl JSON", ".3dm": "Rhino"}


@dataclass(frozen=True)
class Patch:
    """One surface of a file.

    number : from 1, its place in the file
    surface : NurbsSurface in the file's unit and axes
    flip : the lit side is against S_u x S_v
    labels : texts that the entry's `only` may match (layer, object name, number)
    """

    number: int
    surface: NurbsSurface
    flip: bool = False
    labels: tuple = ()


@dataclass(frozen=True)
class GeometryFile:
    """Patches of a file in its order, with what was left out.

    total : how many patches the file counts, those that were not selected included; it fixes the padding of names
    metres : length of the file's unit [m], None if the file states none
    notes : one sentence per kind of thing that was skipped
    """

    patches: list
    total: int
    metres: float | None = None
    notes: list = field(default_factory=list)


@dataclass
class Report:
    """Where a reader notes its mistakes: in `file`, about patch `number` of the entry `name`."""

    mistakes: Mistakes
    file: str
    name: str
    total: int = 1

    def add(self, what, number=None, field=None, line=None):
        surface = None if number is None else names.patch(self.name, number, self.total)
        self.mistakes.add(what, self.file, surface, field, line)

    def fatal(self, what, number=None, field=None, line=None):
        """Note a mistake after which reading can not go on, and stop."""
        self.add(what, number, field, line)
        self.mistakes.stop()

    def surface(self, make, number, line=None):
        """`make()`, or None with the reason noted where it raises the ValueError of NurbsSurface (`FIELD: what`)."""
        try:
            return make()
        except ValueError as error:
            where, _, what = str(error).partition(": ")
            self.add(what or where, number, where if what else None, line)
            return None


def read(path, file, name, only=None, trimmed="refuse"):
    """Read the geometry file at `path` as a GeometryFile.

    file, name : the path and the entry's name as the user wrote them, for messages
    only : pattern of layers, object names or patch numbers, or None
    trimmed : "refuse" or "skip" faces with trims

    Raises Refusal, listing every mistake found in the file.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in KINDS:
        allowed = ", ".join(f"{suffix} ({what})" for suffix, what in KINDS.items())
        raise refusal(f"files of kind '{kind}' are not read; allowed: {allowed}", file, name, "file")
    data = read_bytes(path, file, name)
    report = Report(Mistakes(), file, name)
    if kind == ".3dm":
        from lib.formats import threedm

        content = threedm.read(data, report, only, trimmed)
    elif kind == ".json":
        from lib.formats import geomdl_json

        content = geomdl_json.read(text(data, file), report, only, trimmed)
    else:
        from lib.formats import bezier_patches

        content = bezier_patches.read(text(data, file), report, only, teaset=kind == ".txt")
    report.mistakes.stop()
    return content


def read_bytes(path, file, name, what="file"):
    """The bytes of a file; Refusal if it is missing, not a file, empty or too large (checked before reading)."""
    try:
        if not path.is_file():
            raise refusal("is not a file" if path.exists() else "no such file", file, name, what)
        size = path.stat().st_size
        if size == 0:
            raise refusal("is empty", file, name, what)
        if size > MAX_BYTES:
            raise refusal(f"{size >> 20} MiB; allowed: at most {MAX_BYTES >> 20} MiB", file, name, what)
        return path.read_bytes()
    except OSError as error:
        raise refusal(f"cannot be read: {error.strerror}", file, name, what) from None


def text(data, file):
    """Bytes as UTF-8 text; Refusal if they are not."""
    try:
        decoded = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise refusal("is not text in UTF-8", file=file) from None
    if "\0" in decoded:
        raise refusal("is not text (it holds zero bytes)", file=file)
    return decoded


def digest(path):
    """SHA-256 of a file, hex."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
