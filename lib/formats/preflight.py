"""Everything a run must know before its first job: settings, names, files, averages; and every refusal of bad input.

`load` is called while the Snakefile is parsed, `make` by it where something changed.  That imports the scene in full,
so that each mistake is refused before a job starts, and writes slices of the settings into results/<scene>/settings/,
named by their content: a rule that takes one as its input re-runs for what is in it and for nothing else.

    geometry-<hash>.json    what import_scene needs (see scene_import)
    materials-<hash>.json   {"rho_avg": {surface: [r, g, b]}}
    textures-<hash>.json    {"textures": {surface: {file (relative to the folder), colour_space, repeat, digest}},
                             "emission": the same of emission pictures, and factor [r, g, b]: W/m2 where it is white}
    folder.json             {"folder", "file", "warnings"}: where the scene lies, what was told of it; no rule's input

The outcome is kept in preflight.json under the content of all it was made from; a parse that finds nothing changed
reads that file alone.  So this module's head imports nothing heavy.
"""

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from lib.refusal import Refusal, refusal

VERSION = 7
ROOT = Path(__file__).resolve().parents[2]
_FIELDS = (
    "settings", "names", "files", "roles", "is_black", "area", "groups", "tolerances", "reconstruction", "textures",
    "rho_avg", "geometry_files", "texture_files", "emission_files", "has_meshes", "mesh_cells", "largest", "slices",
    "warnings",
)  # fmt: skip


@dataclass(frozen=True)
class Preflight:
    """A checked scene.

    folder : absolute Path of the scene;  file : its scene.yaml as the user named it, for messages
    name : its cleaned name, that of its results folder
    settings : nested dict with every default filled in and units resolved (see settings.resolve)
    names, files, roles, is_black, area : per surface, ordered by name (area in m^2)
    groups : names of the light groups
    tolerances, reconstruction : {surface: value} of those that ask for their own
    textures : {surface: {"file": absolute path, "colour_space", "repeat": [n, m]}} of the textured ones
    rho_avg : {surface: [r, g, b]}, the average reflectance it shoots with
    geometry_files, texture_files, emission_files : absolute paths; of pictures that shine, in both of the last
    has_meshes : some surfaces are triangle meshes
    mesh_cells : finest cells on the meshes, about
    largest : side of the scene [m]
    slices : {"geometry" | "materials" | "textures": path}
    warnings : sentences for the user
    """

    folder: Path
    file: str
    name: str
    settings: dict
    names: list
    files: list
    roles: list
    is_black: list
    area: list
    groups: list
    tolerances: dict
    reconstruction: dict
    textures: dict
    rho_avg: dict
    geometry_files: list
    texture_files: list
    emission_files: list
    has_meshes: bool
    mesh_cells: int
    largest: float
    slices: dict
    warnings: list


def load(folder, overrides=None, results_root="results", make_elsewhere=None):
    """Check the scene in `folder` and return its Preflight.

    overrides : what was typed, nested or with dotted keys (the key `scene` is left out)
    results_root : folder of all results; this scene's is results_root/<name>
    make_elsewhere : does what `make` does, with its arguments, where the libraries for it are at hand

    Raises Refusal, which lists every mistake, ArtefactError where results can not be written.
    """
    if folder in (None, ""):
        raise refusal("names no folder; expected scene=FOLDER", field="scene")
    at = _place(folder, overrides, results_root)
    _check_owner(at)
    kept = _kept(at)
    if kept is None:
        (make_elsewhere or make)(str(folder), overrides, results_root)
        kept = _kept(at)
    if kept is None:
        raise refusal("a file has changed while it was read; run again", file=at.given)
    file, fields = str(at.given / "scene.yaml"), {field: kept[field] for field in _FIELDS}
    return Preflight(at.absolute, file, at.home.name, **fields)


def make(folder, overrides=None, results_root="results"):
    """Import the scene, write its slices and the outcome; arguments and what it raises as of `load`.

    Returns the Path of the scene's results.
    """
    from lib.formats import artefact, scene_check

    at = _place(folder, overrides, results_root)
    found = scene_check.run(at.given, at.overrides, at.home / "pictures")
    here = {"folder": str(at.absolute), "file": found.file, "warnings": found.outcome["warnings"]}
    slices, texts = {}, {at.home / "settings" / "folder.json": _text(here)}
    for kind, content in found.slices.items():
        text = _text(content)
        path = at.home / "settings" / f"{kind}-{_digest(text)[:16]}.json"
        slices[kind], texts[path] = path.as_posix(), text
    for path, text in texts.items():
        if not path.is_file() or path.read_bytes() != text:
            with artefact.atomic(path) as file:
                file.write(text)
    written = {str(path): _digest(text) for path, text in texts.items()}
    outcome = {**found.outcome, "slices": slices}
    record = {"key": at.key, "folder": str(at.absolute), "inputs": found.inputs, "written": written, "outcome": outcome}
    artefact.write_json(at.home / "preflight.json", record)
    return at.home


class _Place(NamedTuple):
    """Where a scene lies, as given and on this machine, where its results go, and what all of them come from."""

    given: Path
    absolute: Path
    home: Path
    overrides: dict
    key: str


def _place(folder, overrides, results_root):
    given = Path(str(folder))
    given = given.parent if given.name == "scene.yaml" else given
    absolute = Path(os.path.realpath(given))
    overrides = json.loads(json.dumps(overrides or {}, default=str))  # the same for whoever is told them as text
    key = _digest(json.dumps([VERSION, str(given), overrides, _code()], sort_keys=True).encode())
    return _Place(given, absolute, Path(results_root) / _cleaned(absolute.name), overrides, key)


def _cleaned(name):
    from lib.formats.names import cleaned

    return cleaned(name)


def _check_owner(at):
    """Refuse results that belong to another folder, as long as that folder holds a scene."""
    try:
        owner = json.loads((at.home / "settings" / "folder.json").read_text(encoding="utf-8"))["folder"]
    except (OSError, ValueError, KeyError, TypeError):
        return
    if owner != str(at.absolute) and (Path(owner) / "scene.yaml").exists():
        where = f"rename one of the folders, or delete {at.home}"
        raise refusal(f"{at.home} holds the bake of {owner}; {where}", file=at.given)


def _code():
    """One digest of all code and defaults an import can depend on (4 ms)."""
    total = hashlib.sha256()
    config = [ROOT / "config" / "bake.yaml", ROOT / "config" / "scene.schema.json"]
    for path in [*sorted((ROOT / "lib").rglob("*.py")), *config]:
        total.update(path.read_bytes())
    return total.hexdigest()


def _kept(at):
    """The outcome kept from before if all it was made from is as it was, else None."""
    try:
        kept = json.loads((at.home / "preflight.json").read_text(encoding="utf-8"))
        if kept["key"] != at.key or kept["folder"] != str(at.absolute):
            return None
        unchanged = all(_digest_of(file) == digest for file, digest in kept["inputs"].items())
        whole = all(_digest_of(file) == digest for file, digest in kept["written"].items())
        return kept["outcome"] if unchanged and whole else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _text(content):
    return (json.dumps(content, indent=1, sort_keys=True, allow_nan=False) + "\n").encode()


def _digest(data):
    return hashlib.sha256(data).hexdigest()


def _digest_of(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


__all__ = ["Preflight", "Refusal", "load", "make"]
