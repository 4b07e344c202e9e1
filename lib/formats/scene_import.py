"""Puts a Scene together from the geometry slice of its settings: the same in preflight and in the stage import_scene.

The slice is a JSON-able dict: units, up, geometry (entries as in scene.yaml, without what is for surfaces), digests
(SHA-256 of each geometry file), surfaces (see scene_table.resolve).  It does not say where the scene lies, so that a
folder that moves, or is typed differently, re-bakes nothing.  A surface with an emission picture has its row, with the
digest of its file, under `glow`.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from lib import forks
from lib.formats import geometry_file, names, scene_geometry
from lib.formats.mistakes import listed
from lib.formats.scene import Scene
from lib.nurbs.coincident import coincident
from lib.nurbs.surface import NurbsSurface
from lib.refusal import refusal
from lib.surfaces import tessellate
from lib.surfaces.measure import area, hull, transformed
from lib.surfaces.mesh import Mesh

GEOMETRY_KEYS = (
    "name", "rectangle", "quadrangle", "triangle", "nurbs", "file", "units", "place", "only", "trimmed", "flip", "uv",
)  # fmt: skip
SURFACE_KEYS = (
    "role",
    "turn",
    "material",
    "E",
    "group",
    "is_black",
    "front",
)  # not how finely it is refined or exported
FINEST = 1 / 640  # of the scene's largest side: finest cell of a mesh's map
MOST_CELLS = 64  # across a small mesh
NO_LIGHT = (
    "no surface emits light, every map will be black. Add to scene.yaml the line `light: studio` for a soft lamp"
    " overhead, or let a material shine: under `materials:` a line like `NAME: {{lumens: 2000}}` (here are: {})"
)
OWN_REFUSED = "{}: `uv: own`: no texture coordinates, or they fold, overlap or stretch; charts are made for {}"
MOST_TOLD = 8  # pairs of surfaces a warning names


def geometry_slice(settings, table, digests, pictures=None):
    """The slice of `settings` that import_scene needs; a change of anything else leaves it as it is.

    digests : {geometry file: SHA-256};  pictures : {emission picture as written: SHA-256}
    """
    return {
        "units": settings["units"],
        "up": settings["up"],
        "geometry": [{key: entry[key] for key in GEOMETRY_KEYS if key in entry} for entry in settings["geometry"]],
        "digests": digests,
        "surfaces": {
            name: {key: row[key] for key in SURFACE_KEYS} | _glow_row(row, pictures) for name, row in table.items()
        },
    }


def _glow_row(row, pictures):
    """The part of a row that says how unevenly a surface shines: its power is in E."""
    if "glow" not in row:
        return {}
    own = {key: row["glow"][key] for key in ("file", "colour_space", "repeat")}
    return {"glow": {**own, "digest": pictures[own["file"]]}}


def read(piece, folder, file, cache=None, pictures_folder=None, charts=True):
    """Read the geometry a slice names and return its Scene.

    folder : of the scene;  file : scene.yaml as messages name it
    pictures_folder : where pictures embedded in geometry files are
    charts : make those of meshes; a Scene without is for looking at, can not be saved, and does not shine unevenly

    Raises Refusal for bad input, and if a geometry file is no longer the one the slice was made from.
    """
    for written, digest in piece["digests"].items():
        path = Path(folder) / written
        if not path.is_file() or geometry_file.digest(path) != digest:
            shown = Path(file).parent / written
            raise refusal("changed while the bake ran; start it again", file=shown)
    placed, notes, *_ = scene_geometry.load(
        piece["geometry"], piece["units"], folder, file, up=piece["up"], cache=cache
    )
    front = {one.name: one for one in placed}
    for name, row in piece["surfaces"].items():
        if row["front"] is not None:
            one = front[row["front"]]
            placed.append(replace(one, name=name, flip=not one.flip, front=one.name))
    if not charts:
        return assemble(placed, notes, piece["surfaces"], piece["up"])
    placed, refused = with_charts(placed, piece["geometry"])
    made = assemble(placed, [*notes, *refused], piece["surfaces"], piece["up"])
    return replace(made, glow=glow(made, piece["surfaces"], folder, pictures_folder, file))


def glow(made, table, folder, pictures_folder, file):
    """{index: Glow} of the surfaces of a Scene that shine unevenly, by their emission pictures."""
    lit = [s for s, name in enumerate(made.names) if "glow" in table[name] and made.E[s].any()]
    if not lit:
        return {}
    from lib.formats import emission_pictures  # pictures, which few scenes shine by
    from lib.maps import emission

    opened, out = {}, {}
    for s in lit:
        row = table[made.names[s]]["glow"]
        key = row["file"], row["colour_space"]
        try:
            if key not in opened:
                opened[key] = emission_pictures.read_checked(row, folder, pictures_folder)
        except ValueError:
            shown = Path(file).parent / row["file"]
            raise refusal("changed while the bake ran; start it again", file=shown) from None
        found = emission.glow(made.surfaces[s], opened[key], row["repeat"])
        if found is not None:
            out[s] = found
    return out


def with_charts(placed, entries):
    """(The placed surfaces with charts on their meshes: made once for all copies of one size, and for both sides; notes
    on those whose own coordinates do not serve).

    A finest cell of a mesh's map is FINEST of the scene's largest side, less on meshes of less than MOST_CELLS of these
    across.
    """
    meshes = [one for one in placed if isinstance(one.surface, Mesh)]
    if not meshes:
        return placed, []
    from lib.surfaces import charts  # xatlas, for meshes alone

    scale = tessellate.frame([one.surface for one in placed])[1]
    asked, out, refused = {}, {}, {}
    for one in meshes:
        size, entry, mesh = float(np.cbrt(abs(np.linalg.det(one.M[:3, :3])))), entries[one.entry], one.part.surface
        shape = (entry["file"], one.part.shape) if one.part.shape else id(one.part)
        key = shape, round(size, 12), round(area(mesh), 12), entry.get("uv", "charts")
        asked.setdefault(key, (mesh, finest_cell(one.area, scale) / size, []))[2].append(one)

    def atlas(of):
        mesh, texel, _ = asked[of]
        own = charts.own_charts(mesh, texel) if of[-1] == "own" else None
        return own or charts.charted(mesh, texel), of[-1] == "own" and own is None

    largest_first = sorted(asked, key=lambda of: -len(asked[of][0].F))
    for of, (laid, is_refused) in zip(largest_first, forks.mapped(atlas, largest_first, few=1), strict=True):
        for one in asked[of][2]:
            if one.front is None:
                refused[one.name] = is_refused
                flat = replace(one.part.surface, uv=laid.uv, chart=laid.chart, level=laid.level)
                out[one.name] = transformed(flat, one.M)
    placed = [
        replace(one, surface=out[one.front or one.name]) if isinstance(one.surface, Mesh) else one for one in placed
    ]
    found = {}
    for one in meshes:
        if refused.get(one.name):
            found.setdefault(entries[one.entry]["file"], []).append(one.name)
    return placed, [OWN_REFUSED.format(file, listed(names)) for file, names in found.items()]


def finest_cell(area, scale):
    """Side [m] of the finest cells of the map of a mesh of `area` [m2] in a scene whose largest side is `scale` [m]."""
    return min(FINEST * scale, float(np.sqrt(area)) / MOST_CELLS)


def assemble(placed, notes, table, up):
    """The Scene of placed surfaces and their rows: ordered by name, light groups in the order of theirs."""
    placed = sorted(placed, key=lambda one: one.name)
    rows = [table[one.name] for one in placed]
    E = np.array([row["E"] for row in rows], dtype=np.float64)
    emits = E.max(axis=1) > 0
    groups = sorted({row["group"] for row, lit in zip(rows, emits, strict=True) if lit}) or [rows[0]["group"]]
    group = [groups.index(row["group"]) if lit else 0 for row, lit in zip(rows, emits, strict=True)]
    flip = np.array([one.flip ^ row["turn"] for one, row in zip(placed, rows, strict=True)], dtype=bool)
    warnings = list(notes) + (
        [] if emits.any() else [NO_LIGHT.format(", ".join(sorted({r["material"] for r in rows})[:4]))]
    )
    warnings += _coincident(placed, flip)
    index = {one.name: k for k, one in enumerate(placed)}
    front = np.array([-1 if one.front is None else index[one.front] for one in placed], dtype=np.int32)
    return Scene(
        names=[one.name for one in placed],
        files=names.numbered_stems([one.name for one in placed]),
        surfaces=[one.surface for one in placed],
        front=front,
        flip=flip,
        role=[row["role"] for row in rows],
        E=E,
        group=np.array(group, dtype=np.int32),
        groups=groups,
        is_black=np.array([row["is_black"] for row in rows], dtype=bool),
        material=[row["material"] for row in rows],
        up=up,
        warnings=warnings,
    )


def _coincident(placed, flip):
    """Warnings about surfaces that lie in one another, the first few by name."""
    low = np.min([hull(one.surface).min(axis=0) for one in placed], axis=0)
    high = np.max([hull(one.surface).max(axis=0) for one in placed], axis=0)
    whole = [k for k, one in enumerate(placed) if isinstance(one.surface, NurbsSurface)]
    pairs = coincident([placed[k].surface for k in whole], flip[whole], float((high - low).max()))
    pairs = [(whole[a], whole[b]) for a, b in pairs]
    told = [
        f"surfaces {placed[a].name} and {placed[b].name} lie in one another, lit on the same side: move one a little"
        for a, b in pairs[:MOST_TOLD]
    ]
    rest = len(pairs) - len(told)
    return told + ([f"... and {rest} more pairs of surfaces that lie in one another"] if rest else [])
