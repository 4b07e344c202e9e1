"""One geometry file, of any kind that is read, as surfaces in the file's own unit."""

import hashlib
import re
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

from lib import forks
from lib.formats.mistakes import Mistakes
from lib.formats.patches import Report
from lib.refusal import refusal

MAX_BYTES = 512 << 20
MAX_TEXT = 48 << 20  # text takes some ten times its size in memory while it is read
MOST = {".bpt": MAX_TEXT, ".txt": MAX_TEXT, ".json": MAX_TEXT, ".obj": 192 << 20}  # an OBJ takes twelve times its size
KINDS = {
    ".bpt": "Bezier patches", ".txt": "Bezier patches (teaset)", ".json": "geomdl JSON", ".3dm": "Rhino",
    ".obj": "Wavefront", ".glb": "glTF", ".gltf": "glTF",
    ".step": "STEP", ".stp": "STEP", ".iges": "IGES", ".igs": "IGES",
}  # fmt: skip
SLOW = (".3dm", ".obj", ".glb", ".gltf", ".step", ".stp", ".iges", ".igs")  # worth keeping what was read
PACKED = (".zip", ".gz", ".7z", ".rar", ".tar", ".tgz", ".bz2", ".xz", ".zst")


def read(path, file, name, only=None, trimmed="keep", root=None, cache=None):
    """Read the geometry file at `path` as a GeometryFile.

    file, name : the path and the entry's name as the user wrote them, for messages
    only : pattern of layers, groups, objects, materials or patch numbers, or None
    trimmed : "keep", "skip" or "refuse" faces with trims
    root : the scene's folder, where textures of a .3dm may lie too, or None
    cache : folder where readings of SLOW kinds are kept (see geometry_cache), or None

    Raises Refusal, listing every mistake found in the file.
    """
    path, how = Path(path), (only, trimmed, str(root))
    if cache is None or path.suffix.lower() not in SLOW or not path.is_file():
        return _read(path, file, name, only, trimmed, root)
    from lib.formats import geometry_cache
    from lib.surfaces.measure import area

    key = geometry_cache.key(path, path.read_bytes(), *how)
    content = geometry_cache.load(cache, key)
    if content is None:
        content = _read(path, file, name, only, trimmed, root)
        areas = forks.mapped(lambda patch: area(patch.surface), content.patches)
        measured = [replace(patch, area=own) for patch, own in zip(content.patches, areas, strict=True)]
        content = replace(content, patches=measured)
        geometry_cache.save(cache, key, content)
    return content


def companions(path):
    """Names of the files that a geometry file draws on, below its folder: material libraries, buffers."""
    path = Path(path)
    if path.suffix.lower() == ".obj":
        lines = re.findall(rb"^[ \t]*mtllib[ \t]+(.+?)[ \t]*\r?$", path.read_bytes(), re.MULTILINE)
        lines = [line.decode("utf-8", "replace") for line in lines]
        found = [name for line in lines for name in (line, *line.split())]
    elif path.suffix.lower() == ".gltf":
        found = re.findall(r'"uri"\s*:\s*"([^":]+\.bin)"', path.read_text(encoding="utf-8", errors="replace"))
        found = [unquote(name) for name in found]
    else:
        found = []
    return sorted({name for name in found if (path.parent / name).is_file()})


def _read(path, file, name, only, trimmed, root):
    kind = path.suffix.lower()
    if kind in PACKED:
        raise refusal(f"is packed ({kind}): unpack it and name the file inside", file, name, "file")
    if kind not in KINDS:
        allowed = ", ".join(f"{suffix} ({what})" for suffix, what in KINDS.items())
        raise refusal(f"files of kind '{kind}' are not read; allowed: {allowed}", file, name, "file")
    data = read_bytes(path, file, name, MOST.get(kind, MAX_BYTES))
    report = Report(Mistakes(), file, name)
    if kind == ".3dm":
        from lib.formats import threedm

        content = threedm.read(data, report, only, trimmed, path.parent, root)
    elif kind == ".obj":
        from lib.formats import obj

        content = obj.read(data, report, only, path.parent)
    elif kind in (".glb", ".gltf"):
        from lib.formats import gltf_mesh

        content = gltf_mesh.read(data, report, only, path.parent)
    elif KINDS[kind] in ("STEP", "IGES"):
        from lib.formats import step

        content = step.read(path, data, report, only, trimmed)
    elif kind == ".json":
        from lib.formats import geomdl_json

        content = geomdl_json.read(text(data, file), report, only, trimmed)
    else:
        from lib.formats import bezier_patches

        content = bezier_patches.read(text(data, file), report, only, teaset=kind == ".txt")
    report.mistakes.stop()
    return content


def read_bytes(path, file, name, most=MAX_BYTES):
    """The bytes of a file; Refusal if it is missing, not a file, empty or larger than `most` (checked first)."""
    try:
        if not path.is_file():
            raise refusal("is not a file" if path.exists() else "no such file", file, name, "file")
        size = path.stat().st_size
        if size == 0:
            raise refusal("is empty", file, name, "file")
        if size > most:
            raise refusal(f"{size >> 20} MiB; allowed: at most {most >> 20} MiB", file, name, "file")
        return path.read_bytes()
    except OSError as error:
        raise refusal(f"cannot be read: {error.strerror}", file, name, "file") from None


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
