"""Untrimmed surfaces of a Rhino .3dm: bare NURBS surfaces and whole faces of Breps on visible layers.

The one importer of rhino3dm.  Measured with 8.35: GetControlPoint returns (w x, w y, w z, w); knot vectors lack the
first and the last knot, which do not touch the domain; definition objects of blocks stand in the object table too.
"""

import fnmatch
from collections import Counter

import numpy as np
import rhino3dm

from lib.formats import names
from lib.formats.mistakes import listed
from lib.formats.patches import GeometryFile, Patch
from lib.nurbs.surface import NurbsSurface

METRES = {
    "Nanometers": 1e-9, "Microns": 1e-6, "Millimeters": 1e-3, "Centimeters": 1e-2, "Decimeters": 0.1, "Meters": 1.0,
    "Dekameters": 10.0, "Hectometers": 100.0, "Kilometers": 1000.0, "Microinches": 2.54e-8, "Mils": 2.54e-5,
    "Inches": 0.0254, "Feet": 0.3048, "Yards": 0.9144, "Miles": 1609.344,
}  # fmt: skip
_SURFACES = ("Brep", "Extrusion", "Surface", "NurbsSurface", "PlaneSurface", "RevSurface", "SumSurface")
_WORDS = {
    "Mesh": "mesh", "SubD": "SubD", "InstanceReference": "block reference", "Light": "light", "Point": "point",
    "PointCloud": "point cloud", "Hatch": "hatch", "TextDot": "text dot", "Text": "text",
}  # fmt: skip


def read(data, report, only=None, trimmed="refuse"):
    """Read the bytes of a .3dm as a GeometryFile; mistakes go to `report` (see patches).

    Faces are numbered in the order of the file over everything visible, whatever `only` and `trimmed` leave out, so
    that a name stays when they change.
    """
    model = rhino3dm.File3dm.FromByteArray(data)
    if model is None:
        report.fatal("is not a readable .3dm file (wrong kind, cut off or damaged)")
    layers = _Layers(model)
    skipped, faces = Counter(), []
    for item in model.Objects:
        attributes, geometry = item.Attributes, item.Geometry
        if attributes.IsInstanceDefinitionObject or geometry is None:
            skipped["part of a block definition"] += geometry is not None
            continue
        if not attributes.Visible or attributes.Mode == rhino3dm.ObjectMode.Hidden:
            skipped["hidden object"] += 1
        elif not layers.is_visible(attributes.LayerIndex):
            skipped["object on a hidden layer"] += 1
        elif type(geometry).__name__ not in _SURFACES:
            skipped[_kind(geometry)] += 1
        else:
            labels = (*layers.names(attributes.LayerIndex), *([attributes.Name] if attributes.Name else []))
            faces += [(face, labels) for face in _faces(geometry)]
    report.total = len(faces)
    if not faces:
        report.fatal(f"holds no visible surface{_found(skipped)}")
    patches, left_out = _patches(faces, report, only, trimmed)
    skipped["trimmed face"] += len(left_out)
    if not patches and not len(report.mistakes):
        known = dict.fromkeys(label for _, labels in faces for label in labels)
        what = f"no face matches '{only}'" if only else "every face is trimmed, and `trimmed: skip` leaves them out"
        report.add(
            f"{what}; layers and objects: {listed(known) or 'none are named'}", field="only" if only else "trimmed"
        )
    notes = [f"skipped: {_summary(skipped)}"] if +skipped else []
    return GeometryFile(patches, len(faces), METRES.get(model.Settings.ModelUnitSystem.name), notes, left_out)


def _patches(faces, report, only, trimmed):
    """Patches of the selected whole faces, and the numbers of the trimmed ones that are skipped."""
    patches, left_out = [], []
    for number, (face, labels) in enumerate(faces, 1):
        labels = (*labels, str(number), names.padded(number, len(faces)))
        if only is not None and not any(fnmatch.fnmatchcase(label, only) for label in labels):
            continue
        if not _is_whole(face):
            if trimmed == "skip":
                left_out.append(number)
            else:
                what = "is a trimmed face; `trimmed: skip` leaves trimmed faces out, `only` selects layers and objects"
                report.add(f"{what} (it is on layer {labels[0]})", number)
            continue
        surface = report.surface(lambda face=face: _nurbs(face), number)
        if surface is not None:
            patches.append(Patch(number, surface, bool(getattr(face, "OrientationIsReversed", False)), labels))
    return patches, left_out


class _Layers:
    """Layers of a model by index: a layer shows if it and everything above it does."""

    def __init__(self, model):
        self.by_index = {layer.Index: layer for layer in model.Layers}
        self.by_id = {layer.Id: layer for layer in model.Layers}

    def is_visible(self, index):
        layer, steps = self.by_index.get(index), 0
        while layer is not None and steps < 100:
            if not layer.Visible:
                return False
            layer, steps = self.by_id.get(layer.ParentLayerId), steps + 1
        return True

    def names(self, index):
        layer = self.by_index.get(index)
        return () if layer is None else tuple(dict.fromkeys((layer.FullPath, layer.Name)))


def _faces(geometry):
    """Faces of a Brep or an extrusion; a bare surface is its own face."""
    if isinstance(geometry, rhino3dm.Extrusion):
        geometry = geometry.ToBrep(True)
        if geometry is None:
            return []
    if not isinstance(geometry, rhino3dm.Brep):
        return [geometry]
    return [geometry.Faces[index] for index in range(len(geometry.Faces))]


def _is_whole(face):
    """True if the face is its surface from border to border."""
    if not isinstance(face, rhino3dm.BrepFace):
        return True
    alone = face.DuplicateFace(False)
    return alone is not None and alone.IsSurface


def _nurbs(face):
    """The NurbsSurface of a face in the file's units; ValueError if it has none."""
    surface = face.UnderlyingSurface() if isinstance(face, rhino3dm.BrepFace) else face
    nurbs = surface if isinstance(surface, rhino3dm.NurbsSurface) else surface.ToNurbsSurface()
    if nurbs is None:
        raise ValueError("the surface has no NURBS form")
    points = nurbs.Points
    Pw = np.empty((points.CountU, points.CountV, 4))
    for i in range(points.CountU):
        for j in range(points.CountV):
            point = points.GetControlPoint(i, j)
            Pw[i, j] = point.X, point.Y, point.Z, point.W
    if not nurbs.IsRational:
        Pw[..., 3] = 1.0
    return NurbsSurface(nurbs.OrderU - 1, nurbs.OrderV - 1, _knots(nurbs.KnotsU), _knots(nurbs.KnotsV), Pw)


def _knots(stored):
    """All knots: the first and last, which Rhino leaves out, doubled; their value does not reach the domain."""
    knots = [stored[index] for index in range(len(stored))]
    return np.array([knots[0], *knots, knots[-1]])


def _kind(geometry):
    name = type(geometry).__name__
    if name.endswith("Curve"):
        return "curve"
    return "dimension" if name.startswith("Dim") else _WORDS.get(name, name)


def _summary(skipped):
    """`3 curves, 1 mesh` from counts."""
    plural = {"mesh": "meshes", "hatch": "hatches", "part of a block definition": "parts of block definitions"}
    plural["object on a hidden layer"] = "objects on hidden layers"
    items = [(kind, n) for kind, n in sorted(skipped.items()) if n]
    return ", ".join(f"{n} {kind if n == 1 else plural.get(kind, kind + 's')}" for kind, n in items)


def _found(skipped):
    return f"; it holds {_summary(skipped)}" if +skipped else ""
