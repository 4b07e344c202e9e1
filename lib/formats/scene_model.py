"""A scene folder read in full, the same way by all who need it: settings, surfaces, what each is for.

What the settings leave to the geometry is decided here: materials that files bring, a studio lamp, and which open
sheets get light on both sides.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from lib.formats import geometry_cache, scene_folder, scene_geometry, scene_import, scene_rules, scene_table
from lib.formats.emission_pictures import EmissionPictures
from lib.formats.mistakes import listed
from lib.formats.quantities import METRES
from lib.surfaces.measure import points

STUDIO = "studio light"
STUDIO_WIDTH, STUDIO_HEIGHT = 1.5, 0.75  # of the model's largest side: the lamp's side, and its height above the model
STUDIO_EMISSION = 10.0  # W/m2 a channel
LATER = ("bake", "budget", "lods", "export", "camera")  # settings that say nothing about surfaces and light
BACK = "back"  # name of the surface on the other side of x: x/back


@dataclass(frozen=True)
class Model:
    """source : SceneFolder; settings : its settings, with the files' materials and what was decided here filled in;
    placed : list of Placed;  table : rows of scene_table;  scene : Scene;  pictures : {KEY: bytes} embedded in files
    warnings : about emission pictures, for the user
    """

    source: object
    settings: dict
    placed: list
    table: dict
    scene: object
    pictures: dict
    warnings: list


def read(folder, overrides=None, cache=None):
    """Read the scene in `folder`; Refusal lists what is wrong.  cache : folder where readings of files are kept."""
    source = scene_folder.read(folder, overrides)
    scene_rules.check(source)
    settings, where = dict(source.settings), source.where
    told = {name: value for name, value in source.settings.items() if name not in LATER}

    def load(entries):
        return scene_geometry.load(entries, settings["units"], source.folder, source.file, where, settings["up"], cache)

    placed, notes, brought, pictures = load(settings["geometry"])
    settings["materials"] = {**brought, **settings.get("materials", {})}
    if settings.get("light") == "studio":
        entry = studio(placed, settings["units"], settings["up"])
        index = len(settings["geometry"])
        settings["geometry"] = [*settings["geometry"], entry]
        settings["materials"] = {STUDIO: {"emission": STUDIO_EMISSION}, **settings["materials"]}
        settings.setdefault("camera", before(placed, settings["units"], settings["up"]))
        placed = placed + [replace(one, entry=index) for one in load([entry]).placed]
    shining = EmissionPictures(source.folder, source.file, pictures)
    table = scene_table.resolve(settings, placed, where, strict=False, average=shining.average)
    kept = partial(geometry_cache.sides, cache, source.folder, told) if cache else None
    both, turned = both_sides(placed, table, kept)
    backs = with_backs(placed, both)
    table = scene_table.resolve(settings, backs, where, average=shining.average)
    for name in turned:
        table[name]["turn"] = not table[name]["turn"]
    if turned:
        notes = [*notes, f"open sheets turned towards the light: {listed(sorted(turned))}"]
    made = scene_import.assemble(backs, notes, table, settings["up"])
    return Model(source, settings, backs, table, made, pictures, shining.warnings)


def studio(placed, units, up):
    """The geometry entry of the lamp of `light: studio`: a square above everything, facing down."""
    S = np.concatenate([points(one.surface) for one in placed]) / METRES[units]
    low, high = S.min(axis=0), S.max(axis=0)
    size = float((high - low).max())
    across = [0, 1] if up == "z" else [2, 0]  # u x v points up; the lamp's sides are given the other way round
    origin, u, v = (low + high) / 2, np.zeros(3), np.zeros(3)
    origin[2 if up == "z" else 1] = high[2 if up == "z" else 1] + STUDIO_HEIGHT * size
    u[across[1]] = v[across[0]] = STUDIO_WIDTH * size
    origin = origin - (u + v) / 2
    return {
        "name": STUDIO,
        "rectangle": {"origin": origin.tolist(), "u": u.tolist(), "v": v.tolist()},
        "material": STUDIO,
    }


def before(placed, units, up):
    """The camera of a model that stands alone: outside, a little above, from where all of it is in the picture."""
    S = np.concatenate([points(one.surface) for one in placed]) / METRES[units]
    low, high = S.min(axis=0), S.max(axis=0)
    eye = np.array([0.8, -1.15, 0.7] if up == "z" else [0.8, 0.7, 1.15])
    centre = (low + high) / 2
    eye = centre + eye * float(np.linalg.norm(high - low))
    return {"eye": eye.tolist(), "target": centre.tolist(), "fov": 40}


def both_sides(placed, table, kept=None):
    """Names of the surfaces that are lit on both sides, and of those that are lit on their back alone.

    Both: those said to be, and open sheets where it turns out so.  The side an open sheet faces says little in a file.
    kept : asks its argument only if the answer is not known from before
    """
    said = {one.name for one in placed if table[one.name]["two_sided"] is True}
    asked = [k for k, one in enumerate(placed) if table[one.name]["two_sided"] == "auto" and may_be_open(one, table)]
    if not asked or not any(max(row["E"]) > 0 for row in table.values()):
        return said, set()
    from lib.formats.open_sheets import lit_sides  # rays, which few scenes need while they are read

    def find():
        return [{placed[k].name for k in found} for found in lit_sides(placed, table, asked)]

    both, turned = kept(find) if kept else find()
    return said | both, turned


def may_be_open(one, table):
    """Could this surface have light on both sides?  Not part of a solid, reflects, and shines not."""
    row = table[one.name]
    return not one.solid and row["role"] == "full" and not row["is_black"] and max(row["E"]) == 0


def with_backs(placed, both):
    """The surfaces and, for those whose names are in `both`, their other sides."""
    out = list(placed)
    for one in placed:
        if one.name in both:
            out.append(replace(one, name=f"{one.name}/{BACK}", flip=not one.flip, front=one.name))
    return out
