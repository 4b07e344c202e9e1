"""Everything a run must know before its first job: settings, names, files, averages; and every refusal of bad input.

`load` is called while the Snakefile is parsed.  It imports the scene in full, so that each mistake is refused before a
job starts, and writes slices of the settings into results/<scene>/settings/, named by their content: a rule that takes
one as its input re-runs for what is in it and for nothing else.

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

from lib.refusal import Refusal, refusal

VERSION = 6
ROOT = Path(__file__).resolve().parents[2]
_FIELDS = (
    "settings", "names", "files", "roles", "is_black", "area", "groups", "tolerances", "reconstruction", "textures",
    "rho_avg", "geometry_files", "texture_files", "emission_files", "has_meshes", "mesh_cells", "slices", "warnings",
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
    slices: dict
    warnings: list


def load(folder, overrides=None, results_root="results"):
    """Check the scene in `folder` and return its Preflight.

    overrides : what was typed, nested or with dotted keys (the key `scene` is left out)
    results_root : folder of all results; this scene's is results_root/<name>

    Raises Refusal, which lists every mistake, ArtefactError where results can not be written.
    """
    if folder in (None, ""):
        raise refusal("names no folder; expected scene=FOLDER", field="scene")
    given = Path(str(folder))
    given = given.parent if given.name == "scene.yaml" else given
    absolute = Path(os.path.realpath(given))
    name = _cleaned(absolute.name)
    home = Path(results_root) / name
    _check_owner(home, given, absolute)
    key = _digest(json.dumps([VERSION, str(given), overrides or {}, _code()], sort_keys=True, default=str).encode())
    kept = _kept(home / "preflight.json", key, absolute)
    if kept is None:
        kept = _make(given, overrides, home, key, absolute)
    return Preflight(absolute, str(given / "scene.yaml"), name, **{field: kept[field] for field in _FIELDS})


def _cleaned(name):
    from lib.formats.names import cleaned

    return cleaned(name)


def _check_owner(home, given, absolute):
    """Refuse results that belong to another folder, as long as that folder holds a scene."""
    try:
        owner = json.loads((home / "settings" / "folder.json").read_text(encoding="utf-8"))["folder"]
    except (OSError, ValueError, KeyError, TypeError):
        return
    if owner != str(absolute) and (Path(owner) / "scene.yaml").exists():
        raise refusal(f"{home} holds the bake of {owner}; rename one of the folders, or delete {home}", file=given)


def _code():
    """One digest of all code and defaults an import can depend on (4 ms)."""
    total = hashlib.sha256()
    config = [ROOT / "config" / "bake.yaml", ROOT / "config" / "scene.schema.json"]
    for path in [*sorted((ROOT / "lib").rglob("*.py")), *config]:
        total.update(path.read_bytes())
    return total.hexdigest()


def _kept(path, key, absolute):
    """The outcome kept in `path` if all it was made from is as it was, else None."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept["key"] != key or kept["folder"] != str(absolute):
            return None
        unchanged = all(_digest_of(file) == digest for file, digest in kept["inputs"].items())
        whole = all(_digest_of(file) == digest for file, digest in kept["written"].items())
        return kept["outcome"] if unchanged and whole else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _make(given, overrides, home, key, absolute):
    """Import the scene, write its slices and the outcome."""
    from lib.formats import artefact, scene_check

    found = scene_check.run(given, overrides, home / "pictures")
    here = {"folder": str(absolute), "file": found.file, "warnings": found.outcome["warnings"]}
    slices, texts = {}, {home / "settings" / "folder.json": _text(here)}
    for kind, content in found.slices.items():
        text = _text(content)
        path = home / "settings" / f"{kind}-{_digest(text)[:16]}.json"
        slices[kind], texts[path] = path.as_posix(), text
    for path, text in texts.items():
        if not path.is_file() or path.read_bytes() != text:
            with artefact.atomic(path) as file:
                file.write(text)
    written = {str(path): _digest(text) for path, text in texts.items()}
    outcome = {**found.outcome, "slices": slices}
    record = {"key": key, "folder": str(absolute), "inputs": found.inputs, "written": written, "outcome": outcome}
    artefact.write_json(home / "preflight.json", record)
    return json.loads(json.dumps(outcome))  # the same types as a second parse reads


def _text(content):
    return (json.dumps(content, indent=1, sort_keys=True, allow_nan=False) + "\n").encode()


def _digest(data):
    return hashlib.sha256(data).hexdigest()


def _digest_of(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


__all__ = ["Preflight", "Refusal", "load"]
