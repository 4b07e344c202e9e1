"""Geometry entries of a scene, inline or from files, as named surfaces in world metres."""

import hashlib
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np

from lib.formats import geometry_file, names, placement
from lib.formats.mistakes import Mistakes
from lib.formats.patches import Patch
from lib.formats.quantities import METRES
from lib.formats.scene_rules import entry_name
from lib.nurbs.surface import bilinear, from_points
from lib.refusal import Refusal, refusal
from lib.surfaces.measure import area, hull, transformed

BRIGHTEST = 0.9  # reflectance of a file's material: files say how white a thing looks, and nothing reflects all light
TRIMMED = "keep"  # what happens to trimmed faces of a file
FLAT = 1e-13  # area over squared size below which a surface is a line or a point: rounding of its coordinates


UPRIGHT = {  # turns from a file's own up to the scene's
    ("y", "z"): [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    ("z", "y"): [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
}


@dataclass(frozen=True, eq=False)
class Placed:
    """One surface of the scene.

    name : its name;  object : name of the placed entry it belongs to;  entry : index of that entry
    surface : of any kind, world metres;  flip : the lit side is against S_u x S_v;  area : [m^2]
    material : name of the file's material, or None;  solid : as lib.formats.patches.Patch has it
    part, M : the file's Patch and the map (4, 4) that made this surface of it
    front : name of the surface whose back this is, or None
    """

    name: str
    object: str
    entry: int
    surface: object
    flip: bool
    area: float
    material: str | None = None
    solid: bool | None = None
    part: object = None
    M: np.ndarray | None = None
    front: str | None = None


class Loaded(NamedTuple):
    """Surfaces in the entries' order, notes, and what files bring: materials {name: as in scene.yaml, with the texture
    relative to the scene's folder, or "embedded:KEY"}, pictures {KEY: bytes}."""

    placed: list
    notes: list
    materials: dict
    pictures: dict


@dataclass
class _Brought:
    """Materials and pictures of the files read so far, under names that differ where materials do."""

    materials: dict = field(default_factory=dict)
    pictures: dict = field(default_factory=dict)

    def add(self, file, content):
        """{name in the file: name in the scene} of the materials of a file."""
        names_of, folder = {}, PurePosixPath(file).parent
        for name, material in content.materials.items():
            material = dict(material)
            if "reflectance" in material:
                material["reflectance"] = np.minimum(material["reflectance"], BRIGHTEST).tolist()
            for which in ("texture", "emission_texture"):
                if which in material:
                    material[which] = self._picture(material[which], folder, content)
            own = names.canonical(name) if names.complaint(name) is None else "material"
            names_of[name] = names.add(self.materials, own, material)
        return names_of

    def _picture(self, written, folder, content):
        """What the scene calls a picture of a file in `folder`: its path, or embedded:KEY by its content."""
        if not written.startswith("embedded:"):
            return str(folder / written)
        data = content.pictures[written.removeprefix("embedded:")]
        key = hashlib.sha256(data).hexdigest()[:16]
        self.pictures[key] = data
        return f"embedded:{key}"


def load(entries, units, folder, file, where=None, up="z", cache=None):
    """Read and place all geometry: Loaded.

    entries : geometry of scene.yaml;  units : the scene's unit
    folder : where files lie;  file : scene.yaml as messages name it
    where : function of a path of keys to (file, line), or None;  up : the scene's, "y" or "z": files that state
        theirs are turned
    cache : folder where readings of files are kept, or None

    Raises Refusal listing every mistake of all entries.
    """
    mistakes, notes, placed, contents, areas = Mistakes(), [], [], {}, {}
    brought, named = _Brought(), {}
    where = where or (lambda path: (file, None))
    for index, entry in enumerate(entries):
        try:
            if "file" in entry:
                key = (entry["file"], entry.get("only"), entry.get("trimmed", TRIMMED))
                if key not in contents:
                    contents[key] = _read(entry, folder, file, cache)
                    named[key] = brought.add(entry["file"], contents[key])
                    notes += [f"{entry['file']}: {note}" for note in contents[key].notes]
                parts, total = contents[key].patches, contents[key].total
                turn = UPRIGHT.get((contents[key].up, up))
                unit = METRES[entry["units"]] if "units" in entry else contents[key].metres
                if unit is None and entry["file"].lower().endswith(".3dm"):
                    raise refusal("states no unit; say it with `units`", entry["file"], entry_name(entry), "units")
                unit = METRES[units] if unit is None else unit
            else:
                parts, total, unit, turn, key = [Patch(0, inline(entry))], 0, METRES[units], None, None
        except Refusal as error:
            for line in str(error).splitlines():
                mistakes.add_text(line)
            continue
        except ValueError as error:
            field, _, what = str(error).partition(": ")
            source, line = where(("geometry", index, *field.split("[")[0].split(".")))
            mistakes.add(what, source, entry_name(entry), field, line)
            continue
        to_units = (unit / METRES[units], METRES[units])
        own = (named.get(key, {}), np.eye(3) if turn is None else np.array(turn, dtype=np.float64))
        placed += _placed(entry, index, parts, total, to_units, own, areas, mistakes, where)
    _check_names(placed, mistakes, where)
    mistakes.stop()
    return Loaded(placed, list(dict.fromkeys(notes)), brought.materials, brought.pictures)


def _read(entry, folder, file, cache):
    shown = str(Path(file).parent / entry["file"])
    name, only, trimmed = entry_name(entry), entry.get("only"), entry.get("trimmed", TRIMMED)
    return geometry_file.read(Path(folder) / entry["file"], shown, name, only, trimmed, Path(folder), cache)


def inline(entry):
    """The NurbsSurface of an entry with rectangle, quadrangle, triangle or nurbs; ValueError `FIELD: what`."""
    if "rectangle" in entry:
        o, u, v = (np.array(entry["rectangle"][key], dtype=np.float64) for key in ("origin", "u", "v"))
        return bilinear(o, o + u, o + u + v, o + v)
    if "triangle" in entry:
        a, b, c = entry["triangle"]
        return bilinear(a, b, c, c)
    if "quadrangle" in entry:
        corners = np.array(entry["quadrangle"], dtype=np.float64)
        _check_corners(corners)
        return bilinear(*corners)
    net = entry["nurbs"]
    n_v = len(net["points"][0])
    ragged = next((i for i, row in enumerate(net["points"]) if len(row) != n_v), None)
    if ragged is not None:
        raise ValueError(f"nurbs.points[{ragged}]: {len(net['points'][ragged])} points, the first row has {n_v}")
    rows = net.get("weights")
    if rows is not None and [len(row) for row in rows] != [n_v] * len(net["points"]):
        raise ValueError(f"nurbs.weights: expected {len(net['points'])} rows of {n_v} weights, as the points")
    knots = [
        net.get(key) or _uniform(degree, n)
        for key, degree, n in (("knots_u", net["degree_u"], len(net["points"])), ("knots_v", net["degree_v"], n_v))
    ]
    try:
        return from_points(net["degree_u"], net["degree_v"], *knots, net["points"], rows)
    except ValueError as error:
        raise ValueError(f"nurbs.{error}") from None


def _uniform(degree, n):
    """Clamped knots with equal spans; too few points are left for NurbsSurface to name."""
    return [0.0] * degree + list(np.linspace(0.0, 1.0, max(n - degree + 1, 2))) + [1.0] * degree


def _check_corners(corners):
    """ValueError if the corners of a quadrangle are concave or cross: it would fold over itself."""
    corners = (corners - corners[0]) / max(np.abs(corners - corners[0]).max(), 1e-300)
    ahead, back = np.roll(corners, -1, axis=0) - corners, np.roll(corners, 1, axis=0) - corners
    N = np.cross(ahead, back)
    crossed = np.linalg.norm(N.sum(axis=0)) < 1e-9 * np.linalg.norm(N, axis=1).sum()
    if crossed or (N @ N.sum(axis=0) < -1e-9).any():
        raise ValueError("quadrangle: the corners cross or are concave; expected a convex round trip of four corners")


def _placed(entry, index, parts, total, to_units, own, areas, mistakes, where):
    """Every copy of an entry's patches, in world metres; to_units = (file to scene, scene to metres), own = (names of
    the file's materials, turn from its axes to the scene's)."""
    (to_scene, to_metres), (material_of, turn) = to_units, own
    places = entry.get("place", {})
    places = places if isinstance(places, list) else [places]
    result = []
    for number, place in enumerate(places, 1):
        name = names.copy(entry_name(entry), number, len(places))
        try:
            M = placement.matrix(place)
        except ValueError as error:
            field, _, what = str(error).partition(": ")
            source, line = where(("geometry", index, "place"))
            mistakes.add(what, source, name, field, line)
            continue
        M[:3, :3] = M[:3, :3] @ turn * (to_metres * to_scene)
        M[:3, 3] *= to_metres
        mirrored = np.linalg.slogdet(M[:3, :3])[0] < 0
        for part in parts:
            full = names.patch(name, part.number, total) if total else name
            made = _world(part, M, full, index, areas, mistakes, where)
            if made is not None:
                flip = bool(part.flip) ^ bool(mirrored) ^ bool(entry.get("flip", False))
                facts = (material_of.get(part.material), part.solid, part, M)
                result.append(Placed(full, name, index, made[0], flip, made[1], *facts))
    return result


def _world(patch, M, name, index, areas, mistakes, where):
    """(surface in metres, its area), or None with the reason noted; `areas` keeps those of the parts by identity."""
    part = patch.surface
    file, line = where(("geometry", index))
    try:
        surface = part if np.array_equal(M, np.eye(4)) else transformed(part, M)
    except ValueError as error:
        field, _, what = str(error).partition(": ")
        mistakes.add(what, file, name, f"place ({field})", line)
        return None
    P = hull(surface)
    size = float(np.ptp(P, axis=0).max())
    scale = _similarity(M)
    if not size > 0:
        found = 0.0
    elif scale is None:
        found = area(surface)
    else:  # copies by the thousand: one integral
        if id(part) not in areas:
            own = area(part) if patch.area is None else patch.area
            areas[id(part)] = (own, part)  # the part too: an identity lasts as long as what it names
        found = areas[id(part)][0] * scale**2
    rounding = 16 * np.finfo(np.float64).eps * float(np.abs(P).max()) * size
    if not found > max(FLAT * size * size, rounding):
        mistakes.add("the surface has no area (it is a line or a point)", file, name, line=line)
        return None
    return surface, found


def _similarity(M):
    """The scale of a map that keeps angles, else None."""
    A = M[:3, :3]
    scale = float(np.linalg.norm(A[0]))
    return scale if scale > 0 and np.abs(A @ A.T / scale**2 - np.eye(3)).max() < 1e-12 else None


def _check_names(placed, mistakes, where):
    first = {}
    for one in placed:
        file, line = where(("geometry", one.entry))
        fault = names.complaint(one.name)
        if fault:
            mistakes.add(fault, file, one.name[:80], "name", line)
        if one.name in first:
            other = where(("geometry", first[one.name]))[1]
            what = f"another surface has this name too (entry in line {other}); names are different"
            mistakes.add(what, file, one.name, "name", line)
        first.setdefault(one.name, one.entry)
