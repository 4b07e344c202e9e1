"""The complete check of a scene folder: settings, geometry, materials, textures; what preflight keeps of it."""

from dataclasses import dataclass
from pathlib import Path

from lib.elements.lattice import MOST_ROOTS, roots_of
from lib.formats import (
    artefact,
    emission_pictures,
    geometry_file,
    pictures,
    scene,
    scene_import,
    scene_model,
    scene_table,
    settings,
)
from lib.formats.emission_pictures import EMBEDDED, colour_space
from lib.formats.mistakes import Mistakes, listed
from lib.maps.base_texture import rho_average
from lib.maps.budget import gpu_bytes, smallest_total
from lib.refusal import Refusal
from lib.surfaces.measure import extent
from lib.surfaces.mesh import Mesh
from lib.surfaces.tessellate import frame

DIGITS = 4  # of an average reflectance: a repainted texture whose average moves less re-bakes nothing
AUTO = "auto"  # the reconstruction of surfaces that ask for none
BRIGHT = 0.95  # reflectances above are allowed but rarely meant; shots grow as 1 / (1 - rho)


@dataclass(frozen=True)
class Found:
    """What preflight keeps.

    file : scene.yaml as messages name it
    outcome : fields of Preflight but folder, name and slices
    slices : {kind: content};  inputs : {path: SHA-256}
    """

    file: str
    outcome: dict
    slices: dict
    inputs: dict


def run(folder, overrides=None, pictures_folder=None):
    """Check the scene in `folder` under `overrides` and return what was Found; Refusal lists what is wrong.

    pictures_folder : where pictures embedded in geometry files are put, by their content
    """
    model = scene_model.read(
        folder, overrides, None if pictures_folder is None else Path(pictures_folder).parent / "cache"
    )
    source, wanted, placed, table, made = model.source, model.settings, model.placed, model.table, model.scene
    scene.check(made, source.file)
    keep_pictures(model.pictures, pictures_folder)
    warnings = [*made.warnings, *model.warnings]
    asked = [n for n, s in zip(made.names, made.surfaces, strict=True) if isinstance(s, Mesh) and _is_gouraud(table[n])]
    if asked:
        warnings.append(f"reconstruction: light in vertices is not for meshes; textures instead: {listed(asked)}")
    textures, rho_avg = _reflectances(source, wanted, made, pictures_folder, warnings)
    digests = {name: geometry_file.digest(source.folder / name) for name in _geometry_files(wanted, source.folder)}
    pictures_used = {row["file"]: geometry_file.digest(row["file"]) for row in textures.values()}
    shining = {name: row["glow"] for name, row in table.items() if "glow" in row}
    shine_paths = {
        row["file"]: str(emission_pictures.located(row["file"], source.folder, pictures_folder or ""))
        for row in shining.values()
    }
    shine_digests = {written: geometry_file.digest(path) for written, path in shine_paths.items()}
    pictures_used |= {path: shine_digests[written] for written, path in shine_paths.items()}
    largest = float(frame(made.surfaces)[1])
    resolved = settings.resolve(wanted, largest)
    _check_budget(resolved["budget"], source, made, shining)
    area = {one.name: one.area for one in placed}
    materials = wanted.get("materials", {})
    outcome = {
        "settings": resolved,
        "names": made.names,
        "files": made.files,
        "roles": made.role,
        "is_black": made.is_black.tolist(),
        "area": [area[name] for name in made.names],
        "groups": made.groups,
        "tolerances": {name: row["tolerance"] for name, row in table.items() if row["tolerance"] is not None},
        "reconstruction": {name: row["reconstruction"] for name, row in table.items() if row["reconstruction"] != AUTO},
        "textures": textures,
        "rho_avg": rho_avg,
        "geometry_files": [str(source.folder / name) for name in digests],
        "texture_files": sorted(pictures_used),
        "emission_files": sorted(shine_paths.values()),
        "has_meshes": any(isinstance(surface, Mesh) for surface in made.surfaces),
        "mesh_cells": sum(
            round(one.area / scene_import.finest_cell(one.area, largest) ** 2)
            for one in placed
            if isinstance(one.surface, Mesh)
            and not table[one.name]["is_black"]
            and table[one.name]["role"] != "cast_only"
        ),
        "largest": largest,
        "warnings": warnings,
    }
    slices = {
        "geometry": scene_import.geometry_slice(wanted, table, digests, shine_digests),
        "materials": {"rho_avg": rho_avg},
        "textures": {
            "textures": {
                name: {
                    **row,
                    "file": _relative(row["file"], materials[material]["texture"]),
                    "digest": pictures_used[row["file"]],
                }
                for name, material in zip(made.names, made.material, strict=True)
                if (row := textures.get(name))
            },
            "emission": {
                name: {
                    **row,
                    "file": _relative(shine_paths[row["file"]], row["file"]),
                    "digest": shine_digests[row["file"]],
                    **({"embedded": True} if row["file"].startswith(EMBEDDED) else {}),
                }
                for name, row in shining.items()
            },
        },
    }
    scene_file = source.folder / "scene.yaml"
    inputs = {str(source.folder / name): digest for name, digest in digests.items()}
    return Found(
        source.file, outcome, slices, {**inputs, **pictures_used, str(scene_file): geometry_file.digest(scene_file)}
    )


def _check_budget(T, source, made, shining):
    """Refuse a texture budget [bytes] that the smallest maps of these surfaces exceed."""
    mapped = [
        s
        for s, role in enumerate(made.role)
        if made.names[s] in shining or (role != "cast_only" and not made.is_black[s])
    ]
    if T >= len(mapped) * gpu_bytes(MOST_ROOTS + 1, 2):  # spares measuring them
        return
    smallest = smallest_total([roots_of(extent(made.surfaces[s])) for s in mapped])
    if T < smallest:
        file, line = source.where(("budget",))
        mistakes = Mistakes()
        possible = f"the smallest possible total of these {len(mapped)} textures is {smallest} bytes"
        mistakes.add(f"{T} bytes can not be met; {possible}", file, field="budget", line=line)
        mistakes.stop()


def _geometry_files(wanted, folder):
    """The files that geometry is read from, and those they draw on, relative to the scene's folder."""
    named = {entry["file"] for entry in wanted["geometry"] if "file" in entry}
    beside = {str(Path(name).parent / other) for name in named for other in geometry_file.companions(folder / name)}
    return sorted(named | beside)


def _is_gouraud(row):
    return row["reconstruction"] == "gouraud"


def keep_pictures(found, folder):
    """Put embedded pictures {KEY: bytes} into `folder`, where textures `embedded:KEY` are read from."""
    for key, data in found.items() if folder is not None else ():
        if not (Path(folder) / key).is_file():
            with artefact.atomic(Path(folder) / key) as file:
                file.write(data)


def _relative(path, written):
    return path if written.startswith(EMBEDDED) else written


def _reflectances(source, wanted, made, pictures_folder, warnings):
    """Textures {surface: {file, colour_space, repeat}} and average reflectances {surface: [r, g, b]}."""
    mistakes, textures, rho_avg, opened = Mistakes(), {}, {}, {}
    materials = wanted.get("materials", {})
    for index, name in enumerate(made.names):
        material = materials.get(made.material[index], {})
        if "texture" not in material:
            rho_avg[name] = scene_table.reflectance(material)
            continue
        embedded = material["texture"].startswith(EMBEDDED)
        row = {
            "file": str(emission_pictures.located(material["texture"], source.folder, pictures_folder or "")),
            "colour_space": material.get("colour_space", colour_space(material["texture"])),
            "repeat": [float(n) for n in material.get("repeat", [1, 1])],
        }
        if embedded:
            row["embedded"] = True
        if "reflectance" in material:  # of a file: a factor on its picture
            row["factor"] = scene_table.reflectance(material)
        key = (row["file"], row["colour_space"])
        if key not in opened:
            opened[key] = _picture(source, name, material["texture"], row, mistakes, warnings)
        if opened[key] is not None:
            surface = made.surfaces[index]
            if isinstance(surface, Mesh) and surface.T is None:
                mistakes.add("the mesh has no texture coordinates", source.file, name, "texture")
                continue
            textures[name] = row
            rho = rho_average(surface, opened[key], tuple(row["repeat"])) * row.get("factor", 1.0)
            rho_avg[name] = [min(round(float(x), DIGITS), 1.0) for x in rho]
    mistakes.stop()
    _warn_bright(made, rho_avg, warnings)
    return textures, rho_avg


def _picture(source, name, written, row, mistakes, warnings):
    """The picture in linear light, or None with the reason noted."""
    shown, path = str(Path(source.file).parent / written), row["file"]

    def warn(text):
        warnings.append(text.replace(path, shown))

    try:
        return pictures.read_linear(path, row["colour_space"], warn)
    except Refusal as error:
        what = str(error).removeprefix(f"{path}: ")
        mistakes.add(what, shown, name, "texture")
        return None


def _warn_bright(made, rho_avg, warnings):
    bright = {}
    for name, material in zip(made.names, made.material, strict=True):
        if max(rho_avg[name]) > BRIGHT:
            bright.setdefault(material, []).append(name)
    for material, found in bright.items():
        rest = f" and {len(found) - 1} more" if len(found) > 1 else ""
        warnings.append(f"material {material}: reflectance above {BRIGHT} (surface {found[0]}{rest}) converges slowly")
