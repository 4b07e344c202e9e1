"""Surfaces of a Rhino .3dm: Breps, extrusions, bare surfaces, meshes and rectangular lights on visible layers.

The one importer of rhino3dm.  Blocks are imported once for each reference to them.  Curves, text, hatches, dimensions,
SubDs and lights without an area are left out and counted.
"""

from collections import Counter
from dataclasses import dataclass
from functools import partial

import numpy as np
import rhino3dm

from lib import forks
from lib.formats import names, threedm_materials
from lib.formats.mistakes import listed
from lib.formats.patches import MAX_PATCHES, GeometryFile, Patch, is_selected
from lib.formats.threedm_faces import Body, nurbs_surface
from lib.formats.threedm_materials import Materials
from lib.formats.threedm_objects import shown
from lib.nurbs.surface import bilinear
from lib.surfaces.measure import transformed
from lib.surfaces.mesh import Flat
from lib.surfaces.mesh_build import Dropped, mesh

METRES = {
    "Nanometers": 1e-9, "Microns": 1e-6, "Millimeters": 1e-3, "Centimeters": 1e-2, "Decimeters": 0.1, "Meters": 1.0,
    "Dekameters": 10.0, "Hectometers": 100.0, "Kilometers": 1000.0, "Microinches": 2.54e-8, "Mils": 2.54e-5,
    "Inches": 0.0254, "Feet": 0.3048, "Yards": 0.9144, "Miles": 1609.344,
}  # fmt: skip
_WORDS = {
    "SubD": "SubD", "Point": "point", "PointCloud": "point cloud", "Hatch": "hatch", "TextDot": "text dot",
    "Text": "text",
}  # fmt: skip
_PLURAL = {
    "hatch": "hatches", "object on a hidden layer": "objects on hidden layers",
    "light that is off": "lights that are off",
    "block reference without a definition": "block references without a definition",
    "extrusion without faces": "extrusions without faces",
}  # fmt: skip
NEXT = 8  # faces made one after the other by one process, since they share edges
TRIMMED = (
    "is a trimmed face; `trimmed: keep` reads it, `trimmed: skip` leaves trimmed faces out, `only` selects layers and "
    "objects"
)


def read(data, report, only=None, trimmed="keep", folder=".", root=None):
    """Read the bytes of a .3dm as a GeometryFile; mistakes go to `report` (see patches).

    trimmed : "keep", "skip" or "refuse" faces with trims
    folder : where the file lies;  root : the folder of the scene above it, or None: textures are looked for in both

    Faces are numbered in the order of the file over everything visible, whatever `only` and `trimmed` leave out, so
    that a name stays when they change.
    """
    model = rhino3dm.File3dm.FromByteArray(data)
    if model is None:
        report.fatal("is not a readable .3dm file (wrong kind, cut off or damaged)")
    metres = METRES.get(model.Settings.ModelUnitSystem.name)
    materials, skipped = Materials(model, folder, root), Counter()
    maker = _Parts(materials, skipped, metres or 1.0)
    parts = []
    for item in shown(model, materials, skipped):
        parts += maker.parts(item)
        if len(parts) > MAX_PATCHES:
            report.fatal(f"holds more than {MAX_PATCHES} faces")
    report.total = len(parts)
    if not parts:
        report.fatal(f"holds no visible surface{_found(skipped)}")
    patches, left_out = _patches(parts, materials, report, only, trimmed)
    skipped["trimmed face"] += len(left_out)
    if not patches and not len(report.mistakes):
        known = dict.fromkeys(label for part in parts for label in part.item.labels)
        if report.flat:
            what, where = "no mesh has an area", None
        elif only:
            what, where = f"no face matches '{only}'", "only"
        else:
            what, where = "every face is trimmed, and `trimmed: skip` leaves them out", "trimmed"
        report.add(f"{what}; layers and objects: {listed(known) or 'none are named'}", field=where)
    notes = [f"skipped: {_summary(skipped)}"] if +skipped else []
    notes += report.notes() + maker.dropped.sentences() + materials.notes()
    used = dict.fromkeys(patch.material for patch in patches if patch.material is not None)
    made = {key: materials.made[key] for key in used}
    embedded = {m["texture"].removeprefix("embedded:") for m in made.values() if "texture" in m}
    pictures = {key: data for key, data in materials.pictures.items() if key in embedded}
    return GeometryFile(patches, len(parts), metres, notes, left_out, made, pictures)


@dataclass(frozen=True)
class _Part:
    """One surface to be: its object, how it is made, `flip` and `solid` as of a Patch, and a light's material."""

    item: object
    make: object
    flip: bool = False
    is_whole: bool = True
    solid: bool | None = None
    material: str | None = None


def _patches(parts, materials, report, only, trimmed):
    """Patches of the selected parts, and the numbers of the trimmed ones that are skipped."""
    chosen, refused, patches, left_out = [], set(), [], []
    for number, part in enumerate(parts, 1):
        labels = (*part.item.labels, str(number), names.padded(number, len(parts)))
        if not is_selected(labels, only):
            continue
        if not part.is_whole and trimmed == "skip":
            left_out.append(number)
            continue
        chosen.append((number, part, labels))
        if not part.is_whole and trimmed == "refuse":
            refused.add(number)
    made = iter(_made([part for number, part, _ in chosen if number not in refused], trimmed == "skip"))
    for number, part, labels in chosen:
        if number in refused:
            report.add(f"{TRIMMED} (it is on layer {part.item.layer})", number)
            continue
        surface = report.surface(next(made), number)
        if surface is not None:
            if isinstance(part.item.geometry, rhino3dm.Mesh) and len(part.item.geometry.VertexColors):
                report.coloured.append(report.of(number))
            mirrored = part.item.M is not None and np.linalg.det(part.item.M[:3, :3]) < 0
            key = materials.key(part.item.material) if part.material is None else part.material
            patches.append(Patch(number, surface, part.flip ^ bool(mirrored), labels, key, part.solid))
    return patches, left_out


def _made(parts, plain):
    """Functions that return the surface of each part, or raise what was wrong with it; faces of bodies are made here,
    by several processes.
    """
    faces = [k for k, part in enumerate(parts) if not isinstance(part.item.geometry, rhino3dm.Mesh)]
    out = [partial(_placed, part, plain) for part in parts]  # meshes are kept, so that references to one share it
    for k, made in zip(faces, forks.mapped(lambda k: _outcome(out[k]), faces, together=NEXT), strict=True):
        out[k] = made
    return out


def _outcome(make):
    """What `make` returns or raises, as a function that can be sent."""
    try:
        return partial(_same, make())
    except ValueError as error:
        return partial(_raised, error)


def _same(surface):
    return surface


def _raised(error):
    raise error


def _placed(part, plain):
    try:
        surface = part.make(plain)
        return surface if part.item.M is None else transformed(surface, part.item.M)
    except Flat:
        raise
    except ValueError as error:
        more = "" if part.is_whole else "; `trimmed: skip` leaves trimmed faces out"
        raise ValueError(f"{error} (on layer {part.item.layer}{more})") from None


class _Parts:
    """Takes shown objects apart; bodies and meshes are kept, so that references to a block share them."""

    def __init__(self, materials, skipped, metres):
        self.materials, self.skipped, self.metres, self._known = materials, skipped, metres, {}
        self.dropped = Dropped()

    def parts(self, item):
        """List of _Part of a Shown, empty (and counted) if it is of no use."""
        kind = type(item.geometry).__name__
        if kind in ("Brep", "Extrusion"):
            return self._body(item, kind)
        if kind == "Mesh":
            return [_Part(item, lambda _: self._mesh(item), solid=bool(item.geometry.IsClosed))]
        if kind == "Light":
            return self._light(item)
        if isinstance(item.geometry, rhino3dm.Surface):
            return [_Part(item, lambda _: nurbs_surface(item.geometry))]
        self.skipped[_kind(kind)] += 1
        return []

    def _body(self, item, kind):
        if item.id not in self._known:
            brep = item.geometry if kind == "Brep" else item.geometry.ToBrep(True)
            self._known[item.id] = None if brep is None else Body(brep)
        body = self._known[item.id]
        if body is None:
            self.skipped["extrusion without faces"] += 1
            return []
        return [
            _Part(item, lambda plain, k=k: body.surface(k, plain), body.flip(k), body.is_whole[k], body.is_solid)
            for k in range(len(body))
        ]

    def _mesh(self, item):
        if item.id not in self._known:
            self._known[item.id], dropped = mesh(*_arrays(item.geometry))
            self.dropped += dropped
        return self._known[item.id]

    def _light(self, item):
        source = item.geometry
        style = source.LightStyle.name.removeprefix("World").removeprefix("Camera").lower()
        if not source.IsEnabled or not source.Intensity > 0:
            self.skipped["light that is off"] += 1
            return []
        if style != "rectangular":
            self.skipped[f"{style} light"] += 1
            return []
        corner, length, width, ahead = (
            np.array([a.X, a.Y, a.Z]) for a in (source.Location, source.Length, source.Width, source.Direction)
        )
        across = np.cross(length, width)
        area = float(np.linalg.norm(across)) * self.metres**2
        if not area > 0:
            self.skipped["light without an area"] += 1
            return []
        key = self.materials.add(source.Name or "light", threedm_materials.light(source, area))
        corners = (corner, corner + length, corner + length + width, corner + width)
        return [_Part(item, lambda _: bilinear(*corners), bool(across @ ahead < 0), solid=False, material=key)]


def _arrays(found):
    """V, F, N, T of a rhino3dm Mesh, as mesh_build.mesh takes them; quadrangles cut along their shorter diagonal."""
    V = np.array([(p.X, p.Y, p.Z) for p in found.Vertices.ToPoint3dArray()]).reshape(-1, 3)
    Q = np.array([found.Faces[k] for k in range(len(found.Faces))], dtype=np.int64).reshape(-1, 4)
    is_quad = Q[:, 2] != Q[:, 3]
    a, b, c, d = (V[Q[:, k]] for k in range(4))
    other = is_quad & (np.linalg.norm(c - a, axis=1) > np.linalg.norm(d - b, axis=1))
    Q[other] = np.roll(Q[other], -1, axis=1)
    F = np.concatenate([Q[:, None, :3], Q[:, None, [0, 2, 3]]], axis=1).reshape(-1, 3)
    F = F[np.stack([np.ones(len(Q), dtype=bool), is_quad], axis=1).ravel()]
    N = np.array([(p.X, p.Y, p.Z) for p in (found.Normals[k] for k in range(len(found.Normals)))]).reshape(-1, 3)
    T = found.TextureCoordinates
    T = np.array([(p.X, p.Y) for p in (T[k] for k in range(len(T)))]).reshape(-1, 2)
    return V, F, N[F] if len(N) == len(V) else None, T[F] if len(T) == len(V) else None


def _kind(name):
    if name.endswith("Curve"):
        return "curve"
    return "dimension" if name.startswith("Dim") else _WORDS.get(name, name)


def _summary(skipped):
    """`3 curves, 1 hatch` from counts."""
    items = [(kind, n) for kind, n in sorted(skipped.items()) if n]
    return ", ".join(f"{n} {kind if n == 1 else _PLURAL.get(kind, kind + 's')}" for kind, n in items)


def _found(skipped):
    return f"; it holds {_summary(skipped)}" if +skipped else ""
