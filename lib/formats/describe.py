"""Lists what a geometry file or a scene folder holds, for a user who has to name or light it."""

from pathlib import Path

import numpy as np

from lib.formats import geometry_file, scene_model
from lib.formats.scene_table import reflectance
from lib.nurbs.shape import area, collapsed_sides, is_closed


def lines(path):
    """Lines of text about a geometry file or a scene folder; Refusal if it can not be read."""
    path = Path(path)
    return _folder(path) if path.is_dir() or path.name == "scene.yaml" else _file(path)


def _file(path):
    content = geometry_file.read(path, str(path), path.stem, trimmed="skip")
    unit = "states no unit" if content.metres is None else f"its unit is {content.metres:g} m"
    head = f"{path}: {geometry_file.KINDS[path.suffix.lower()]}, {content.total} surfaces, {unit}"
    rows = [("number", *_SHAPE, "layer or name")]
    for patch in content.patches:
        labels = ", ".join(patch.labels[:-2])  # the last two are its number
        rows.append((patch.labels[-1], *_shape(patch.surface, patch.flip), labels))
    return [head, *_table(rows), *_trimmed(content.trimmed), *content.notes]


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


_SHAPE = ("degrees", "points", "rational", "closed", "poles", "turned", "area")


def _shape(surface, flip, size=None):
    """Cells about the shape of a surface, in the order of _SHAPE."""
    closed = "".join(letter for letter, shut in zip("uv", is_closed(surface), strict=True) if shut)
    return (
        f"{surface.degree_u} x {surface.degree_v}",
        "{} x {}".format(*surface.Pw.shape[:2]),
        "yes" if np.ptp(surface.w) > 0 else "",
        closed,
        str(int(collapsed_sides(surface).sum()) or ""),
        "yes" if flip else "",
        f"{area(surface) if size is None else size:.4g}",
    )


def _material(material):
    """One material in words."""
    rho = material.get("texture") or " ".join(f"{x:g}" for x in reflectance(material))
    parts = [f"texture {rho}" if "texture" in material else f"reflectance {rho}"]
    parts += [f"{key} {material[key]}" for key in ("emission", "power", "lumens", "group") if key in material]
    return ", ".join(parts)


def _trimmed(numbers):
    if not numbers:
        return []
    listed = ", ".join(map(str, numbers[:40])) + (", ..." if len(numbers) > 40 else "")
    return [f"trimmed, read only with `trimmed: skip`, which leaves them out: {listed}"]


def _table(rows):
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
