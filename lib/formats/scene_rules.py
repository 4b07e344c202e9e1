"""Rules over a scene's settings that a schema can not say: names, references, combinations, paths."""

import re
from pathlib import Path, PurePosixPath

from lib.formats import names
from lib.formats.mistakes import Mistakes, listed, nearest

INLINE = ("rectangle", "quadrangle", "triangle", "nurbs")
DEFAULT_MATERIAL = "default"


def check(scene):
    """Raise Refusal listing everything in a SceneFolder that breaks a rule; no geometry or picture is read."""
    mistakes = Mistakes()

    def add(what, path, surface=None, field=None):
        file, line = scene.where(path)
        mistakes.add(what, file, surface, field, line)

    settings = scene.settings
    materials = settings.get("materials", {})
    for name, material in materials.items():
        for field, what in material_faults(material):
            add(what, ("materials", name, field), field=f"materials.{name}.{field}")
        if names.complaint(name):
            add(names.complaint(name), ("materials", name), field="materials")
        for field in ("texture", "emission_texture"):
            fault = path_fault(scene.folder, material[field]) if field in material else None
            if fault:
                add(fault, ("materials", name, field), field=f"materials.{name}.{field}")
    known = [*materials, DEFAULT_MATERIAL]
    _check_geometry(scene, known, add)
    if not any(brings_materials(entry) for entry in settings["geometry"]):  # else known when the files are read
        for pattern, override in settings.get("surfaces", {}).items():
            if override.get("material", DEFAULT_MATERIAL) not in known:
                what = unknown_material(override["material"], known)
                add(what, ("surfaces", pattern, "material"), field=f"surfaces.{pattern}.material")
    rays = settings["bake"]["shadow_rays"]
    if rays != "auto" and rays[0] > rays[1]:
        add(f"{rays}; expected [n0, n1] with n0 <= n1", ("bake", "shadow_rays"), field="bake.shadow_rays")
    camera = settings.get("camera")
    if camera and camera["eye"] == camera["target"]:
        add("eye and target are one point", ("camera",), field="camera")
    mistakes.stop()


def _check_geometry(scene, known, add):
    first = {}
    for index, entry in enumerate(scene.settings["geometry"]):
        name, path = entry_name(entry), ("geometry", index)
        if name is None:
            add("the name is missing", path, field=f"geometry[{index}].name")
            continue
        fault = names.complaint(name)
        if fault:
            add(fault, (*path, "name"), name if name.isprintable() and len(name) < 80 else None, "name")
        elif name in first:
            line = scene.where(("geometry", first[name]))[1]
            add(f"two entries have this name, the first in line {line}; names are different", path, name, "name")
        first.setdefault(name, index)
        if entry.get("material", DEFAULT_MATERIAL) not in known and not brings_materials(entry):
            add(unknown_material(entry["material"], known), (*path, "material"), name, "material")
        if "file" in entry:
            fault = path_fault(scene.folder, entry["file"])
            if fault:
                add(fault, (*path, "file"), name, "file")
            continue
        for field in ("units", "only", "trimmed", "uv"):
            if field in entry:
                add("is for entries with a `file`", (*path, field), name, field)


def brings_materials(entry):
    """Is the geometry entry a file of a kind that holds materials of its own?"""
    return PurePosixPath(entry.get("file", "")).suffix.lower() not in ("", ".bpt", ".txt", ".json")


def entry_name(entry):
    """Name of a geometry entry: its own, else its file's without the ending, else None."""
    if "name" in entry:
        return names.canonical(entry["name"])
    return names.canonical(PurePosixPath(entry["file"]).stem) if "file" in entry else None


def unknown_material(name, known):
    """The complaint about a material that is not defined."""
    return f"no material '{name}' is defined{nearest(name, known) or '; there are ' + listed(known)}"


def material_faults(material):
    """(field, sentence) for every contradiction in a material."""
    lights = [key for key in ("emission", "power", "lumens") if key in material]
    if len(lights) > 1:
        yield lights[1], f"a material has only one of emission, power, lumens; it has {listed(lights)}"
    if "texture" in material and "reflectance" in material:
        yield "reflectance", "a material has a texture or a reflectance, not both"
    for field in ("colour_space", "repeat"):
        if field in material and not {"texture", "emission_texture"} & set(material):
            yield field, "is for a material with a texture or an emission_texture"
    if "emission_texture" in material and not lights:
        yield "emission_texture", "is for a material with emission, power or lumens, which it multiplies"
    if "colour" in material:
        if not {"power", "lumens"} & set(lights):
            yield "colour", "is for a material with power or lumens"
        elif not max(material["colour"]) > 0:
            yield "colour", "one channel at least must be > 0"
    if "group" in material and not lights:
        yield "group", "is for a material with emission, power or lumens"


def path_fault(folder, written):
    """Why a path of scene.yaml does not name a file inside the scene's folder, or None."""
    if any(ord(c) < 32 for c in written):
        return "the path holds a control character"
    path = PurePosixPath(written)
    if path.is_absolute() or re.match(r"[A-Za-z]:[\\/]", written):
        return f"'{written}' is an absolute path; expected one relative to scene.yaml, inside its folder"
    if names.is_outside(path):
        return f"'{written}' lies outside the scene's folder"
    try:
        target = Path(folder) / path
        if not target.exists():
            return f"no file '{written}' in the scene's folder{nearest(written, _files(folder))}"
        if not target.is_file():
            return f"'{written}' is not a file"
    except OSError as error:
        return f"'{written}' cannot be read: {error.strerror}"
    return None


def _files(folder):
    return [entry.name for entry in Path(folder).iterdir()]
