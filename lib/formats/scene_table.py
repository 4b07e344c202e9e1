"""What each surface of a scene is for: role, material, light; patterns resolved, totals spread over exact areas."""

import fnmatch
import math

from lib.formats import emission_pictures
from lib.formats.mistakes import Mistakes, listed, nearest
from lib.formats.scene_rules import DEFAULT_MATERIAL, brings_materials, unknown_material
from lib.refusal import Refusal

REFLECTANCE = 0.7  # of a material that states neither a reflectance, a texture nor a light
LUMENS_PER_WATT = 683.0  # of the green the eye sees best; luminance weights of linear Rec. 709
LUMINANCE = (0.2126, 0.7152, 0.0722)
MAIN_GROUP = "main"
FIELDS = ("role", "reconstruction", "tolerance", "material", "two_sided")


def resolve(settings, placed, where, strict=True, average=None):
    """Per surface name: role, reconstruction, tolerance (None: the scene's), turn, two_sided, material, E, group,
    is_black, front; and glow of those with an emission picture: its row (see emission_pictures) and `factor` [r, g, b],
    the exitance in W/m2 where it is white.

    settings : of a SceneFolder;  placed : list of scene_geometry.Placed;  where : function of a path to (file, line)

    Materials that only a file may bring are looked up here.
    `turn` is the override's `flip`: it comes on top of what file, placement and entry say.
    strict : a pattern that matches nothing is a mistake
    average : function of (material, surface) to the mean (3,) of the material's emission picture; may raise Refusal
    Raises Refusal for a pattern that matches no surface, and for a light too strong to be a number.
    """
    mistakes = Mistakes()
    table = {one.name: _of_entry(settings["geometry"][one.entry], one) for one in placed}
    known = [*settings.get("materials", {}), DEFAULT_MATERIAL]
    for pattern, override in settings.get("surfaces", {}).items():
        hit = [name for name in table if name == pattern or fnmatch.fnmatchcase(name, pattern)]
        if override.get("material", DEFAULT_MATERIAL) not in known:
            file, line = where(("surfaces", pattern, "material"))
            what = unknown_material(override["material"], known)
            mistakes.add(what, file, field=f"surfaces.{pattern}.material", line=line)
        if strict and not hit:
            file, line = where(("surfaces", pattern))
            what = f"matches no surface{nearest(pattern, table) or '; there are ' + listed(table)}"
            mistakes.add(what, file, field=f"surfaces.{pattern}", line=line)
        for name in hit:
            table[name].update({field: override[field] for field in FIELDS if field in override})
            table[name]["turn"] = override.get("flip", table[name]["turn"])
    mistakes.stop()
    _light(settings, placed, table, where, average)
    return table


def _of_entry(entry, one):
    return {
        "role": entry.get("role", "full"),
        "reconstruction": entry.get("reconstruction", "auto"),
        "tolerance": entry.get("tolerance"),
        "material": entry.get("material", one.material or DEFAULT_MATERIAL),
        "turn": False,
        "two_sided": entry.get("two_sided", "auto" if brings_materials(entry) else False),
        "front": one.front,
    }


def _light(settings, placed, table, where, average):
    """Add E, group, is_black and glow to the rows: a total is spread over the surfaces of one placed object and
    material."""
    mistakes, materials = Mistakes(), settings.get("materials", {})
    of = {one.name: materials.get(table[one.name]["material"], {}) for one in placed}
    mean = _means(placed, of, table, where, average, mistakes)
    total, light = {}, {}  # of an object's surfaces of one material: area, and area times the mean of their picture
    for one in placed:
        key = (one.object, table[one.name]["material"])
        total[key] = total.get(key, 0.0) + one.area
        own = [one.area * m for m in mean[one.name]]
        light[key] = [a + b for a, b in zip(light.get(key, [0.0] * 3), own, strict=True)]
    for one in placed:
        row, material = table[one.name], of[one.name]
        area, bright = (found[one.object, row["material"]] for found in (total, light))
        file, line = where(("materials", row["material"]))
        field = f"materials.{row['material']}"
        factor = exitance(material, area, [b / area for b in bright])
        if factor is None:
            mistakes.add("is black where its light has a colour", file, one.name, f"{field}.emission_texture", line)
            continue
        row["E"] = [e * m for e, m in zip(factor, mean[one.name], strict=True)]
        row["group"] = material.get("group", MAIN_GROUP)
        row["is_black"] = "texture" not in material and reflectance(material) == [0.0, 0.0, 0.0]
        if "emission_texture" in material:
            row["glow"] = {**emission_pictures.row(material), "factor": factor}
        if not all(math.isfinite(e) and e <= 1e30 for e in [*row["E"], *factor]):
            mistakes.add("its light is more than 1e30 W/m2", file, one.name, field, line)
    mistakes.stop()


def _means(placed, of, table, where, average, mistakes):
    """{surface: mean [r, g, b] of its emission picture, 1 without one}."""
    mean = {one.name: [1.0] * 3 for one in placed}
    for one in placed:
        if "emission_texture" in of[one.name]:
            try:
                mean[one.name] = [float(m) for m in average(of[one.name], one.surface)]
            except Refusal as error:
                name = table[one.name]["material"]
                file, line = where(("materials", name))
                mistakes.add(str(error), file, one.name, f"materials.{name}.emission_texture", line)
    mistakes.stop()
    return mean


def reflectance(material):
    """Declared reflectance [r, g, b] of a material without texture; 0 if it only emits, REFLECTANCE if it says nothing.

    >>> reflectance({"reflectance": 0.5}), reflectance({"power": 40})
    ([0.5, 0.5, 0.5], [0.0, 0.0, 0.0])
    """
    return _rgb(material.get("reflectance", 0.0 if has_light(material) else REFLECTANCE))


def has_light(material):
    """Does the material say how much light it gives?"""
    return any(key in material for key in ("emission", "power", "lumens"))


def exitance(material, area, mean=(1.0, 1.0, 1.0)):
    """Exitance [r, g, b] in W/m2 of a material spread over `area` [m2]; with an emission picture, that of its white.

    mean : [r, g, b] of the picture on that area.  None where the picture is too black for the total that is asked.
    `power` is the sum over the channels [W]; `lumens` counts 683 lm/W times the luminance of linear RGB.

    >>> exitance({"power": 6, "colour": [1, 2, 0]}, 2.0)
    [1.0, 2.0, 0.0]
    >>> exitance({"lumens": 683, "colour": [1, 1, 1]}, 1.0, [0.5, 0.5, 0.5])
    [2.0, 2.0, 2.0]
    """
    if "emission" in material:
        return _rgb(material["emission"])
    if not has_light(material):
        return [0.0, 0.0, 0.0]
    colour = _rgb(material.get("colour", 1.0))
    largest = max(colour)
    colour = [c / largest for c in colour]
    seen = [c * m for c, m in zip(colour, mean, strict=True)]
    if max(seen) <= 0:
        return None
    if "power" in material:
        scale = material["power"] / (area * math.fsum(seen))
    else:
        luminance = math.fsum(weight * c for weight, c in zip(LUMINANCE, seen, strict=True))
        scale = material["lumens"] / (area * LUMENS_PER_WATT * luminance)
    return [scale * c for c in colour]


def _rgb(value):
    return [float(x) for x in value] if isinstance(value, list) else [float(value)] * 3
