"""What was read from a geometry file, or found out about a scene's sheets, kept so that the next to ask need not do it
again.

A scene is read while the Snakefile is parsed, and again by its first job.  A kept reading is found by the bytes of the
file, how it was read, what lies in its folder but scene.yaml, which no reader opens, and the code that read it.
"""

import hashlib
import json
from functools import cache
from pathlib import Path

import numpy as np

from lib.formats import artefact, surface_arrays
from lib.formats.artefact import ArtefactError
from lib.formats.patches import GeometryFile, Patch

KIND, VERSION = "geometry", 2
CODE = ("lib/formats", "lib/surfaces", "lib/nurbs", "lib/visibility")
SIDES = "sides.json"
ROOT = Path(__file__).resolve().parents[2]
MOST = 10_000  # files of a folder that are looked at
SETTINGS = "scene.yaml"
FACTS = ("number", "flip", "labels", "material", "solid", "shape", "area")
KEPT = 16  # readings in one folder, the newest


def key(path, data, *how):
    """Name of a reading of the file at `path` with the bytes `data`; how : the options it is read with, JSON-able."""
    digest = hashlib.sha256(data)
    digest.update(json.dumps([path.name, how, fingerprint(path.parent), _code()], default=str).encode())
    return digest.hexdigest()[:32]


def fingerprint(folder):
    """Names, sizes and times of the files below a folder: [[relative path, bytes, ns], ...], SETTINGS and results left
    out.
    """
    found, folder = [], Path(folder)
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder)
        is_hidden = any(part.startswith(".") for part in inside.parts)
        if "results" in inside.parts or is_hidden or path.name == SETTINGS or not path.is_file():
            continue
        stat = path.stat()
        found.append([inside.as_posix(), stat.st_size, stat.st_mtime_ns])
        if len(found) == MOST:
            break
    return found


@cache
def _code():
    digest = hashlib.sha256()
    for folder in CODE:
        for path in sorted((ROOT / folder).glob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()


def load(folder, name):
    """The GeometryFile kept as `name` in `folder`, or None."""
    try:
        header, arrays = artefact.read(Path(folder) / f"{name}.npz", KIND, VERSION)
        pictures = {k: arrays.pop(f"picture {n}").tobytes() for n, k in enumerate(header["pictures"])}
        surfaces = list(surface_arrays.Surfaces(arrays, np.full(len(header["patches"]), -1)))
        rows = [{**dict(zip(FACTS, row, strict=True)), "labels": tuple(row[2])} for row in header["patches"]]
        patches = [Patch(surface=surface, **row) for surface, row in zip(surfaces, rows, strict=True)]
        return GeometryFile(patches, pictures=pictures, **header["file"])
    except (ArtefactError, KeyError, TypeError, ValueError, IndexError):
        return None


def save(folder, name, content):
    """Keep a GeometryFile as `name` in `folder`, and forget the oldest of many."""
    patches = content.patches
    arrays = surface_arrays.packed([patch.surface for patch in patches], [-1] * len(patches))
    pictures = {f"picture {n}": np.frombuffer(data, np.uint8) for n, data in enumerate(content.pictures.values())}
    fields = ("total", "metres", "notes", "trimmed", "materials", "up")
    header = {
        "patches": [[_plain(getattr(patch, fact)) for fact in FACTS] for patch in patches],
        "pictures": list(content.pictures),
        "file": {field: getattr(content, field) for field in fields},
    }
    artefact.write(Path(folder) / f"{name}.npz", KIND, VERSION, header, {**arrays, **pictures})
    kept = sorted(Path(folder).glob("*.npz"), key=lambda path: path.stat().st_mtime_ns)
    for path in kept[:-KEPT]:
        path.unlink(missing_ok=True)


def sides(folder, home, settings, find):
    """What `find` returns, two sets of names, kept in `folder` with what it hangs on: the settings given, the files
    in `home`, and the code.
    """
    text = json.dumps([settings, fingerprint(home), _code()], sort_keys=True, default=str)
    key, path = hashlib.sha256(text.encode()).hexdigest(), Path(folder) / SIDES
    try:
        kept = artefact.read_json(path)
        if kept["key"] == key:
            return tuple(set(kept[name]) for name in ("both", "turned"))
    except (ArtefactError, KeyError, TypeError):
        pass
    both, turned = find()
    artefact.write_json(path, {"key": key, "both": sorted(both), "turned": sorted(turned)})
    return both, turned


def _plain(value):
    return bool(value) if isinstance(value, np.bool_) else value
