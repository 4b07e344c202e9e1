"""Puts a Scene together from the geometry slice of its settings: the same in preflight and in the stage import_scene.

The slice is a JSON-able dict: units, up, geometry (entries as in scene.yaml, without what is for surfaces), digests
(SHA-256 of each geometry file), surfaces (see scene_table.resolve).  It does not say where the scene lies, so that a
folder that moves, or is typed differently, re-bakes nothing.
"""

from pathlib import Path

import numpy as np

from lib.formats import geometry_file, names, scene_geometry
from lib.formats.scene import Scene
from lib.nurbs.coincident import coincident
from lib.refusal import refusal

GEOMETRY_KEYS = (
    "name", "rectangle", "quadrangle", "triangle", "nurbs", "file", "units", "place", "only", "trimmed", "flip",
)  # fmt: skip
SURFACE_KEYS = ("role", "turn", "material", "E", "group", "is_black")  # not how finely it is refined or exported
MOST_TOLD = 8  # pairs of surfaces a warning names


def geometry_slice(settings, table, digests):
    """The slice of `settings` that import_scene needs; a change of anything else leaves it as it is."""
    return {
        "units": settings["units"],
        "up": settings["up"],
        "geometry": [{key: entry[key] for key in GEOMETRY_KEYS if key in entry} for entry in settings["geometry"]],
        "digests": digests,
        "surfaces": {name: {key: row[key] for key in SURFACE_KEYS} for name, row in table.items()},
    }


def read(piece, folder, file):
    """Read the geometry a slice names and return its Scene.

    folder : of the scene;  file : scene.yaml as messages name it

    Raises Refusal for bad input, and if a geometry file is no longer the one the slice was made from.
    """
    for written, digest in piece["digests"].items():
        path = Path(folder) / written
        if not path.is_file() or geometry_file.digest(path) != digest:
            shown = Path(file).parent / written
            raise refusal("changed while the bake ran; start it again", file=shown)
    placed, notes = scene_geometry.load(piece["geometry"], piece["units"], folder, file)
    return assemble(placed, notes, piece["surfaces"], piece["up"])


def assemble(placed, notes, table, up):
    """The Scene of placed surfaces and their rows: ordered by name, light groups in the order of theirs."""
    placed = sorted(placed, key=lambda one: one.name)
    rows = [table[one.name] for one in placed]
    E = np.array([row["E"] for row in rows], dtype=np.float64)
    emits = E.max(axis=1) > 0
    groups = sorted({row["group"] for row, lit in zip(rows, emits, strict=True) if lit}) or [rows[0]["group"]]
    group = [groups.index(row["group"]) if lit else 0 for row, lit in zip(rows, emits, strict=True)]
    flip = np.array([one.flip ^ row["turn"] for one, row in zip(placed, rows, strict=True)], dtype=bool)
    warnings = list(notes) + ([] if emits.any() else ["no surface emits light: every map will be black"])
    warnings += _coincident(placed, flip)
    return Scene(
        names=[one.name for one in placed],
        files=names.numbered_stems([one.name for one in placed]),
        surfaces=[one.surface for one in placed],
        front=np.full(len(placed), -1, dtype=np.int32),
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
    low = np.min([one.surface.P.min(axis=(0, 1)) for one in placed], axis=0)
    high = np.max([one.surface.P.max(axis=(0, 1)) for one in placed], axis=0)
    pairs = coincident([one.surface for one in placed], flip, float((high - low).max()))
    told = [
        f"surfaces {placed[a].name} and {placed[b].name} lie in one another, lit on the same side: move one a little"
        for a, b in pairs[:MOST_TOLD]
    ]
    rest = len(pairs) - len(told)
    return told + ([f"... and {rest} more pairs of surfaces that lie in one another"] if rest else [])
