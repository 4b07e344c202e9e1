"""Lists what a geometry file or a scene folder holds, for a user who has to name or light it."""

from collections import Counter
from pathlib import Path

import numpy as np

from lib.formats import geometry_file, scene_model
from lib.formats.scene_table import reflectance
from lib.surfaces import measure
from lib.surfaces.frames import whole
from lib.surfaces.mesh import Mesh
from lib.surfaces.trimmed import TrimmedSurface


def lines(path):
    """Lines of text about a geometry file or a scene folder; Refusal if it can not be read."""
    path = Path(path)
    return _folder(path) if path.is_dir() or path.name == "scene.yaml" else _file(path)


def _file(path):
    content = geometry_file.read(path, str(path), path.stem)
    unit = "states no unit" if content.metres is None else f"its unit is {content.metres:g} m"
    axis = f", {content.up} up" if content.up else ""
    kinds = Counter(_kind(patch.surface) for patch in content.patches)
    sheets = sum(patch.solid is False for patch in content.patches)
    counted = [f"{n} {kind}" for kind, n in sorted(kinds.items())] + ([f"{sheets} of open sheets"] if sheets else [])
    kind = geometry_file.KINDS[path.suffix.lower()]
    head = f"{path}: {kind}, {content.total} surfaces ({', '.join(counted)}), {unit}{axis}"
    rows = [("number", *_SHAPE, "material", "layer or name")]
    for patch in content.patches:
        labels = ", ".join(patch.labels[:-2])  # the last two are its number
        number = patch.labels[-1] if patch.labels else str(patch.number)
        rows.append((number, *_shape(patch.surface, patch.flip), patch.material or "", labels))
    materials = [f"material {name}: {_material(material)}" for name, material in sorted(content.materials.items())]
    shining = [name for name, material in content.materials.items() if max(_rgb(material.get("emission", 0.0))) > 0]
    light = f"materials that shine: {', '.join(sorted(shining))}" if shining else "no material shines"
    return [head, *_table(rows), *materials, light, *_trimmed(content.trimmed), *content.notes]


def _folder(path):
    model = scene_model.read(path)
    source, settings, placed, made = model.source, model.settings, model.placed, model.scene
    areas = {one.name: one.area for one in placed}
    head = f"{source.file}: {len(made.names)} surfaces, {sum(areas.values()):.4g} m2, units {settings['units']}"
    rows = [("surface", *_SHAPE, "role", "material", "light W")]
    for k, name in enumerate(made.names):
        power = float(made.E[k].sum()) * areas[name]
        light = f"{power:.4g}" if power else ""
        rows.append((name, *_shape(made.surfaces[k], made.flip[k], areas[name]), made.role[k], made.material[k], light))
    used = sorted(set(made.material))
    materials = [f"material {name}: {_material(settings.get('materials', {}).get(name, {}))}" for name in used]
    return [f"{head}, {made.up} up, light groups: {', '.join(made.groups)}", *_table(rows), *materials, *made.warnings]


_SHAPE = ("kind", "degrees", "points", "rational", "loops", "closed", "poles", "turned", "area")


def _kind(surface):
    return {TrimmedSurface: "trimmed", Mesh: "mesh"}.get(type(surface), "whole")


def _shape(surface, flip, size=None):
    """Cells about the shape of a surface, in the order of _SHAPE: a mesh has triangles instead of degrees."""
    area = f"{measure.area(surface) if size is None else size:.4g}"
    turned = "yes" if flip else ""
    if isinstance(surface, Mesh):
        return "mesh", f"{len(surface.F)} tri", str(len(surface.V)), "", "", "", "", turned, area
    closed = "".join(letter for letter, shut in zip("uv", measure.is_closed(surface), strict=True) if shut)
    nurbs = whole(surface)
    return (
        _kind(surface),
        f"{nurbs.degree_u} x {nurbs.degree_v}",
        "{} x {}".format(*nurbs.Pw.shape[:2]),
        "yes" if np.ptp(nurbs.w) > 0 else "",
        str(len(surface.loop_start) - 1) if isinstance(surface, TrimmedSurface) else "",
        closed,
        str(int(measure.collapsed_sides(surface).sum()) or ""),
        turned,
        area,
    )


def _rgb(value):
    return value if isinstance(value, list) else [value] * 3


def _material(material):
    """One material in words."""
    rho = material.get("texture") or " ".join(f"{x:g}" for x in reflectance(material))
    parts = [f"texture {rho}" if "texture" in material else f"reflectance {rho}"]
    light = ("emission", "power", "lumens", "emission_texture", "group")
    parts += [f"{key} {material[key]}" for key in light if key in material]
    return ", ".join(parts)


def _trimmed(numbers):
    if not numbers:
        return []
    listed = ", ".join(map(str, numbers[:40])) + (", ..." if len(numbers) > 40 else "")
    return [f"left out: {listed}"]


def _table(rows):
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
