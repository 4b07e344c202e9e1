"""Convert a STEP or IGES file to NURBS faces, in a process of its own: python -m lib.formats.step_faces FILE OUT

The one importer of OCP (Open CASCADE), which ends the process with a segmentation fault on some files.  Measured with
8.0.1.1: arrays that a method returns by value are freed twice, so numbers are fetched one by one; FindAttribute of an
attribute that is not there crashes, so it is asked for first; colours are linear RGB; lengths come in mm, whatever the
file's unit; converted arcs have the angle in their knots, but not in between (see step_parameters).
"""

import resource
import sys
from pathlib import Path

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepTools import BRepTools, BRepTools_WireExplorer
from OCP.collections import Array1_double, Sequence_TDF_Attribute, Sequence_TDF_Label
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.Geom import Geom_RectangularTrimmedSurface
from OCP.GeomAbs import GeomAbs_C2
from OCP.GeomConvert import GeomConvert
from OCP.IFSelect import IFSelect_RetDone
from OCP.IGESCAFControl import IGESCAFControl_Reader
from OCP.Interface import Interface_Static
from OCP.Quantity import Quantity_ColorRGBA
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_AsciiString, TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label, TDF_Tool
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_REVERSED,
    TopAbs_SHAPE,
    TopAbs_SHELL,
    TopAbs_SOLID,
    TopAbs_WIRE,
)
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS
from OCP.XCAFDoc import XCAFDoc_ColorGen, XCAFDoc_ColorSurf, XCAFDoc_DocumentTool

from lib.formats import step_edges, step_parameters, step_result
from lib.formats.mistakes import listed
from lib.nurbs.shape import size
from lib.nurbs.surface import from_points

MEMORY = 12 << 30  # address space; a file that needs more is refused, rather than the machine brought down
SECONDS = 600  # of the processor, should the process that waits for this one be gone
DEEPEST = 100  # assemblies in assemblies
IGES = (".iges", ".igs")


class Unreadable(Exception):
    """The file as a whole can not be converted."""


def main(argv):
    """Convert; exit status 0, or 2 with a last line on stderr that says why not."""
    source, out = argv
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        step_result.save(out, _Converter(_document(source)).result())
    except (Unreadable, MemoryError) as error:
        print(f"refused: {error or 'needs too much memory'}", file=sys.stderr)
        return 2
    return 0


def _document(source):
    document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
    is_iges = Path(source).suffix.lower() in IGES
    reader = IGESCAFControl_Reader() if is_iges else STEPCAFControl_Reader()
    Interface_Static.SetCVal_s("xstep.cascade.unit", "MM")
    reader.SetColorMode(True)
    reader.SetNameMode(True)
    reader.SetLayerMode(True)
    if is_iges:
        reader.SetReadVisible(True)
    else:
        reader.SetSHUOMode(True)
    if reader.ReadFile(source) != IFSelect_RetDone:
        raise Unreadable("is not a readable file of its kind (wrong kind, cut off or damaged)")
    if not reader.Transfer(document):
        raise Unreadable("holds no part that can be converted")
    return document


class _Converter:
    """Walks the assemblies, then converts each part once, however often it stands somewhere."""

    def __init__(self, document):
        self.document = document  # nothing in it lives longer than this reference
        self.shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
        self.colour_tool = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
        self.layers = XCAFDoc_DocumentTool.LayerTool_s(document.Main())
        self.parts, self.colours, self.see_through, self.instances = {}, {}, set(), []
        self.overridden = {}  # names of places where an assembly has a colour for one part of what stands there
        self.n_hidden, self.n_curves = 0, 0
        for label in _labels(self.shapes.GetFreeShapes):
            self._walk(label, np.eye(4), (), -1)

    def _walk(self, label, matrix, names, outer, depth=0):
        """Note the parts below a label with their places; `outer` is the colour of what holds it."""
        if depth > DEEPEST:
            raise Unreadable(f"holds assemblies nested deeper than {DEEPEST}")
        if not self.colour_tool.IsVisible_s(label):
            self.n_hidden += 1
            return
        names, colour = (*names, *self._names(label)), self._colour(label)
        if self._is_overridden(label):
            self.overridden[names[-1] if names else "a place without a name"] = None
        if self.shapes.IsReference_s(label):
            matrix = matrix @ _matrix(self.shapes.GetLocation_s(label))
            part = TDF_Label()
            self.shapes.GetReferredShape_s(label, part)
            label, names = part, (*names, *self._names(part))
            colour = colour if colour >= 0 else self._colour(part)
        colour = colour if colour >= 0 else outer
        if self.shapes.IsAssembly_s(label):
            for part in _labels(lambda found: self.shapes.GetComponents_s(label, found)):
                self._walk(part, matrix, names, colour, depth + 1)
            return
        number = self.parts.setdefault(_entry(label), (len(self.parts), label))[0]
        place = [float(a) for a in matrix[:3].ravel()]
        labels = list(dict.fromkeys(reversed(names)))
        self.instances.append({"shape": number, "matrix": place, "labels": labels, "colour": colour})

    def _names(self, label):
        """Layers of a label, then its name."""
        layers = self.layers.GetLayers(label)
        names = [layers.Value(k).ToExtString() for k in range(1, layers.Length() + 1)] if layers is not None else []
        if label.IsAttribute(TDataStd_Name.GetID_s()):
            name = TDataStd_Name()
            label.FindAttribute(TDataStd_Name.GetID_s(), name)
            names.append(name.Get().ToExtString())
        return [name.strip() for name in names if name.strip()]

    def _colour(self, label):
        """Index of a label's own colour, -1 if it has none."""
        for kind in (XCAFDoc_ColorSurf, XCAFDoc_ColorGen):
            found = Quantity_ColorRGBA()
            if self.colour_tool.IsSet(label, kind) and self.colour_tool.GetColor_s(label, kind, found):
                rgb = found.GetRGB()
                rgb = tuple(min(max(float(c), 0.0), 1.0) for c in (rgb.Red(), rgb.Green(), rgb.Blue()))
                index = self.colours.setdefault(rgb, len(self.colours))
                if found.Alpha() < 1.0:
                    self.see_through.add(index)
                return index
        return -1

    def _is_overridden(self, label):
        """Does what holds a placed part have a colour for one of the parts of that?"""
        uses = Sequence_TDF_Attribute()
        self.shapes.GetAllComponentSHUO_s(label, uses)
        found = (uses.Value(k).Label() for k in range(1, uses.Length() + 1))
        return any(self.colour_tool.IsSet(use, kind) for use in found for kind in (XCAFDoc_ColorSurf, XCAFDoc_ColorGen))

    def result(self):
        """Everything as StepFaces."""
        parts = [self._part(label) for _, label in self.parts.values()]
        counts = {"hidden part": self.n_hidden, "curve": self.n_curves}
        notes = [f"{n} {what}{'s' if n > 1 else ''}" for what, n in counts.items() if n]
        if self.overridden:
            notes.append(f"colours of single parts in {listed(self.overridden)}")
        see_through = sorted(self.see_through)
        return step_result.packed(parts, list(self.colours), see_through, self.instances, notes)

    def _part(self, label):
        """Name, faces and edges of one part."""
        shape, coloured, colours = self.shapes.GetShape_s(label), ShapeMap(), {}
        for sub in _labels(lambda found: self.shapes.GetSubShapes_s(label, found)):
            colours[coloured.Add(self.shapes.GetShape_s(sub))] = self._colour(sub)
        edges, faces = _Edges(), []
        for number, (body, is_solid) in enumerate(_bodies(shape)):
            outer = colours.get(coloured.FindIndex(body), -1)
            for face in map(TopoDS.Face, _explored(body, TopAbs_FACE)):
                own = colours.get(coloured.FindIndex(face), -1)
                kind = BRepAdaptor_Surface(face, False).GetType().name.removeprefix("GeomAbs_")
                is_reversed = face.Orientation() == TopAbs_REVERSED
                into = step_result.Face(number, is_solid, is_reversed, own if own >= 0 else outer, kind)
                faces.append((_Face(face, edges), into))
        self.n_curves += sum(1 for _ in _explored(shape, TopAbs_EDGE, TopAbs_FACE))
        edges.sample()
        for number, (face, into) in enumerate(faces, 1):
            print(f"at face {number} of {len(faces)}: {into.kind}", file=sys.stderr, flush=True)
            try:
                face.convert(edges, into)
            except Exception as error:  # OCP's own kinds of exception, and ValueError of NurbsSurface
                into.surface, into.loops = None, []
                into.why = str(error) if isinstance(error, ValueError) else type(error).__name__
        return (self._names(label) or [""])[-1], [into for _, into in faces], edges.S


class _Edges:
    """Edges of a part, each sampled once for all faces beside it."""

    def __init__(self):
        self.map, self.edges, self.beside, self.t, self.S = ShapeMap(), [], [], [], []

    def add(self, edge, curve, box):
        """Number of an edge that runs along `curve` in the (u, v) of a face whose box has these two sides."""
        number = self.map.Add(edge) - 1
        if number == len(self.edges):
            self.edges.append(TopoDS.Edge(edge.Oriented(TopAbs_FORWARD)))
            self.beside.append([])
        self.beside[number].append((curve, box))
        return number

    def sample(self):
        """Polylines of all edges: parameters t (k,) from 0 to 1 along them, points S (k, 3) that end in vertices."""
        for edge, beside in zip(self.edges, self.beside, strict=True):
            t, S = np.array([0.0, 1.0]), np.zeros((2, 3))
            if not BRep_Tool.Degenerated_s(edge):
                curve = BRepAdaptor_Curve(edge)
                breaks = Array1_double(1, curve.NbIntervals(GeomAbs_C2) + 1)
                curve.Intervals(breaks, GeomAbs_C2)
                breaks = np.array([breaks.Value(k) for k in range(1, breaks.Length() + 1)])
                breaks = (breaks - breaks[0]) / (breaks[-1] - breaks[0])
                curves = [curve, *(beside_it for beside_it, _ in beside)]
                t = step_edges.sampled(
                    lambda t, curves=curves: np.hstack([_along(c, t) for c in curves]),
                    breaks,
                    [side for _, box in beside for side in box],
                )
                S = _along(curve, t)
            for end, vertex in ((0, TopExp.FirstVertex_s(edge)), (-1, TopExp.LastVertex_s(edge))):
                if not vertex.IsNull():
                    p = BRep_Tool.Pnt_s(vertex)
                    S[end] = p.X(), p.Y(), p.Z()
            self.t.append(t)
            self.S.append(S)


class _Face:
    """A face of the file with its loops of edges, as (number, runs backward, curve in u and v)."""

    def __init__(self, face, edges):
        self.face = TopoDS.Face(face.Oriented(TopAbs_FORWARD))  # loops run round its surface, not round its lit side
        u0, u1, v0, v1 = BRepTools.UVBounds_s(self.face)
        box = (max(u1 - u0, 1e-300), max(v1 - v0, 1e-300))
        self.loops, self.in_order = [], True
        for wire in map(TopoDS.Wire, _explored(self.face, TopAbs_WIRE)):
            explorer, loop = BRepTools_WireExplorer(wire, self.face), []
            while explorer.More():
                edge = TopoDS.Edge(explorer.Current())
                curve = BRepAdaptor_Curve2d(edge, self.face)
                loop.append((edges.add(edge, curve, box), edge.Orientation() == TopAbs_REVERSED, curve))
                explorer.Next()
            self.in_order &= len(loop) == sum(1 for _ in _explored(wire, TopAbs_EDGE))
            self.loops.append(loop)

    def convert(self, edges, into):
        """Fill in what a step_result.Face says of surface and loops."""
        if not self.in_order:
            raise ValueError("the edges of a loop do not follow one another")
        loops = [[(n, is_back, _along(curve, edges.t[n])) for n, is_back, curve in loop] for loop in self.loops]
        native = BRep_Tool.Surface_s(self.face)
        while isinstance(native, Geom_RectangularTrimmedSurface):
            native = native.BasisSurface()
        bounds = np.array(native.Bounds()).reshape(2, 2)
        period = (
            native.UPeriod() if native.IsUPeriodic() else None,
            native.VPeriod() if native.IsVPeriodic() else None,
        )
        outlines = [step_parameters.outline([(uv, is_back) for _, is_back, uv in loop]) for loop in loops]
        box, into.is_trimmed = step_parameters.box(outlines, bounds, period)
        part = Geom_RectangularTrimmedSurface(native, *box[0].tolist(), *box[1].tolist(), True, True)
        surface, knots = _nurbs(GeomConvert.SurfaceToBSplineSurface_s(part))
        map_uv = step_parameters.Map(surface, knots, box, period, lambda u, v: _on(native, u, v))
        S = [edges.S[n] for loop in loops for n, *_ in loop]
        extent = np.ptp(np.concatenate(S), axis=0).max() if S else size(surface)
        into.surface, into.gap = surface, map_uv.off
        for loop in loops:
            into.loops.append([])
            for n, is_back, uv in loop:
                uv, gap = map_uv(uv, edges.S[n], extent)
                into.loops[-1].append((n, is_back, uv))
                into.gap = max(into.gap, gap)


def _nurbs(made):
    """A Geom_BSplineSurface as a NurbsSurface, and its distinct knots in u and in v."""
    made.SetUNotPeriodic()
    made.SetVNotPeriodic()
    n, m = made.NbUPoles(), made.NbVPoles()
    P, w = np.empty((n, m, 3)), np.empty((n, m))
    for i in range(n):
        for j in range(m):
            p = made.Pole(i + 1, j + 1)
            P[i, j], w[i, j] = (p.X(), p.Y(), p.Z()), made.Weight(i + 1, j + 1)
    all_knots, distinct = [], []
    for direction in "UV":
        knot, times = getattr(made, f"{direction}Knot"), getattr(made, f"{direction}Multiplicity")
        count = getattr(made, f"Nb{direction}Knots")()
        values = [knot(k) for k in range(1, count + 1)]
        all_knots.append(np.repeat(values, [times(k) for k in range(1, count + 1)]))
        first, last = (getattr(made, f"{end}{direction}KnotIndex")() for end in ("First", "Last"))
        distinct.append(np.array(values[first - 1 : last]))
    return from_points(made.UDegree(), made.VDegree(), *all_knots, P, w), distinct


def _along(curve, t):
    """Points (m, 2 or 3) of an edge's curve, t (m,) from 0 to 1."""
    first, last = curve.FirstParameter(), curve.LastParameter()
    found = [curve.Value(a) for a in (first + t * (last - first)).tolist()]
    is_flat = isinstance(curve, BRepAdaptor_Curve2d)
    return np.array([(p.X(), p.Y()) if is_flat else (p.X(), p.Y(), p.Z()) for p in found])


def _on(native, u, v):
    found = [native.Value(a, b) for a, b in zip(u.tolist(), v.tolist(), strict=True)]
    return np.array([(p.X(), p.Y(), p.Z()) for p in found])


def _bodies(shape):
    """(solid, True), then (shell or face outside of any, False)."""
    yield from ((body, True) for body in _explored(shape, TopAbs_SOLID))
    yield from ((body, False) for body in _explored(shape, TopAbs_SHELL, TopAbs_SOLID))
    yield from ((body, False) for body in _explored(shape, TopAbs_FACE, TopAbs_SHELL))


def _explored(shape, kind, avoid=TopAbs_SHAPE):
    explorer = TopExp_Explorer(shape, kind, avoid)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def _labels(fill):
    found = Sequence_TDF_Label()
    fill(found)
    return [found.Value(k) for k in range(1, found.Length() + 1)]


def _entry(label):
    text = TCollection_AsciiString()
    TDF_Tool.Entry_s(label, text)
    return text.ToCString()


def _matrix(location):
    place = location.Transformation()
    return np.array([[place.Value(i, j) for j in range(1, 5)] for i in range(1, 4)] + [[0.0, 0.0, 0.0, 1.0]])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
