"""Faces of a Rhino Brep as surfaces, whole or trimmed.

Measured with rhino3dm 8.35: GetControlPoint returns (w x, w y, w z, w); knot vectors lack the first and the last knot,
which do not touch the domain; loops and trims tell which edge is used, in which direction and between which vertices,
but not the curves in u, v: these are found by inverting the edges.  openNURBS runs every loop with the face's part of
the surface on its left (seen in u, v, whether or not the face is reversed), which tells the two sides of a seam apart:
u = 1 is run along upwards, u = 0 downwards, v = 0 along u, v = 1 against it.
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs.curve import NurbsCurve, polyline
from lib.nurbs.evaluate import point
from lib.nurbs.invert import Inverter
from lib.nurbs.surface import NurbsSurface
from lib.surfaces.loops import signed_area
from lib.surfaces.significance import significance
from lib.surfaces.trim_build import EdgeUse, trimmed

CURVED = 9  # least points of an edge: straight in space may be bent in u, v
ON_SIDE = 1e-5  # of the surface's size: an edge that stays so near a side lies on it
ON_SEAM = 1e-3  # likewise for an edge that the face uses twice
ALMOST_CLOSED = 5e-3  # likewise between two sides that the file does not join, though a pot's wall ends where it began
OFF = 1e-2  # of the surface's size: an edge farther away does not belong to the face


class Body:
    """The faces of one Brep; each edge is sampled once, and only when a face asks for it.

    is_whole : [bool] of the faces, their surface from border to border
    """

    def __init__(self, brep):
        self.brep = brep
        self.faces = [brep.Faces[index] for index in range(len(brep.Faces))]
        self.is_whole = [_is_whole(face) for face in self.faces]
        self.is_solid = bool(brep.IsSolid)
        self._edges, self._surfaces = {}, {}

    def __len__(self):
        return len(self.faces)

    def flip(self, index):
        """True if the face's lit side is against S_u x S_v."""
        return bool(self.faces[index].OrientationIsReversed)

    def surface(self, index, plain=False):
        """NurbsSurface of a face if every face of the body is whole (or `plain`), else its TrimmedSurface.

        Raises ValueError, `FIELD: what`, if it has none.
        """
        if index not in self._surfaces:
            surface = nurbs_surface(self.faces[index].UnderlyingSurface())
            if not plain and not all(self.is_whole):
                surface = trimmed(surface, _Face(surface, self.faces[index], self._edge, self._vertex).loops())
            self._surfaces[index] = surface
        return self._surfaces[index]

    def _vertex(self, index):
        return _xyz(self.brep.Vertices[index].Location)

    def _edge(self, index, vertices):
        """Points (k, 3) and significances (k,) of an edge from its first to its last vertex."""
        if index not in self._edges:
            edge = self.brep.Edges[index]
            S = polyline(_nurbs_curve(edge), least=CURVED)
            S[0], S[-1] = (self._vertex(vertex) for vertex in vertices)
            self._edges[index] = S, significance(S)
        return self._edges[index]


@dataclass
class _Trim:
    """One trim of a loop: its edge (None at a pole), whether it runs against it, its points and their u, v."""

    edge: int | None
    backwards: bool
    S: np.ndarray
    significance: np.ndarray
    uv: np.ndarray | None = None


class _Face:
    """A face on its way to loops of EdgeUse."""

    def __init__(self, surface, face, edge, vertex):
        self.inverter = Inverter(surface)
        self.trims, self.is_outer = [], []
        for number in range(len(face.Loops)):
            loop = face.Loops[number]
            self.is_outer.append(loop.LoopType.name == "Outer")
            self.trims.append([_trim(loop.Trims[k], edge, vertex) for k in range(loop.TrimCount)])
        used = [trim.edge for loop in self.trims for trim in loop if trim.edge is not None]
        self.twice = {edge for edge in used if used.count(edge) > 1}

    def loops(self):
        """[[EdgeUse]], outer and inner loops in the file's order; ValueError `loop 2: what`."""
        self._invert()
        result = []
        for number, loop in enumerate(self.trims, 1):
            for k, trim in enumerate(loop):
                if trim.edge is None:
                    before, after = loop[k - 1], loop[(k + 1) % len(loop)]
                    if before.edge is None or after.edge is None:
                        raise ValueError(f"loop {number}: has no edge between two poles")
                    trim.uv = self._along_pole(before.uv[-1], after.uv[0])
                    trim.S = np.repeat(trim.S, len(trim.uv), axis=0)
                    trim.significance = np.full(len(trim.uv), np.inf)
            if (signed_area(np.concatenate([trim.uv for trim in loop])) > 0) != self.is_outer[number - 1]:
                raise ValueError(f"loop {number}: runs the wrong way around in u, v; its edges were not found there")
            result.append([EdgeUse(trim.uv, trim.S, trim.significance) for trim in loop])
        return result

    def _invert(self):
        """Give every trim along an edge its u, v: each edge is inverted once."""
        first = {}
        for loop in self.trims:
            for trim in loop:
                if trim.edge is not None:
                    first.setdefault(trim.edge, trim)
        lines = [trim.S[::-1] if trim.backwards else trim.S for trim in first.values()]
        found = dict(zip(first, self.inverter.polylines(lines), strict=True)) if lines else {}
        for number, loop in enumerate(self.trims, 1):
            for k, trim in enumerate(loop):
                if trim.edge is None:
                    continue
                uv, distance = found[trim.edge]
                if distance.max() > OFF * self.inverter.size:
                    raise ValueError(f"loop {number}: edge {trim.edge} leaves the surface by {distance.max():.3g}")
                uv = (uv[::-1] if trim.backwards else uv).copy()
                for is_pole, end, inner in (
                    (loop[k - 1].edge is None, 0, 1),
                    (loop[k + 1 - len(loop)].edge is None, -1, -2),
                ):
                    if is_pole:
                        uv[end] = self._at_pole(uv[end], uv[inner])
                trim.uv = self._on_sides(uv, trim.S, distance.max(), trim.edge in self.twice)

    def _at_pole(self, uv, inner):
        """u, v (2,) of a trim's end that the file says is at a pole: its free parameter is that of the point before."""
        for side in np.flatnonzero(self.inverter.collapsed):
            if abs(uv[side // 2] - side % 2) < 1e-2:
                uv = inner.copy()
                uv[side // 2] = side % 2
                break
        return uv

    def _on_sides(self, uv, S, distance, is_twice):
        """u, v of a trim; one on a side or seam is put there exactly, at a seam by its direction."""
        uv, size, best = uv.copy(), self.inverter.size, None
        for axis in (0, 1):
            closed, gap, x = self.inverter.closed[axis], self.inverter.gap[axis], uv[:, axis]
            if closed:
                x = uv[:, axis] = x - np.floor(np.median(x))
            is_seam = closed or gap <= ALMOST_CLOSED * size
            if np.abs(x - np.round(x)).max() > 0.1 or (not is_seam and np.ptp(np.round(x))):
                continue
            side = np.zeros(len(x)) if is_seam else np.round(x)
            there = [side, uv[:, 1]] if axis == 0 else [uv[:, 0], side]
            there = [a - np.floor(a) if c else a for a, c in zip(there, self.inverter.closed, strict=True)]
            off = float(np.linalg.norm(point(self.inverter.surface, *there) - S, axis=1).max())
            ahead = uv[-1, 1 - axis] - uv[0, 1 - axis]
            if off <= max(ON_SIDE * size, min(2 * distance, 10 * ON_SIDE * size), 2 * gap * is_seam):
                uv[:, axis] = (ahead > 0) == (axis == 0) if is_seam else side
            elif is_seam and is_twice and off <= ON_SEAM * size and (best is None or off < best[0]):
                best = off, axis, ahead
        if best is not None:
            _, axis, ahead = best
            uv[:, axis] = (ahead > 0) == (axis == 0)
        return uv

    def _along_pole(self, a, b):
        """u, v of a trim that stays at a pole, from a to b: the side's parameter goes on in the side's direction."""
        for side in np.flatnonzero(self.inverter.collapsed):
            across, end = side // 2, float(side % 2)
            if np.abs([a[across] - end, b[across] - end]).max() > 1e-4:
                continue
            a, b = a.copy(), b.copy()
            a[across] = b[across] = end
            along, forwards = 1 - across, (side in (1, 2))  # u = 1 upwards, v = 0 along u
            step = b[along] - a[along]
            if self.inverter.closed[along] and (step > 0) != forwards:
                b[along] += 1.0 if forwards else -1.0
            return np.stack([a, b])
        raise ValueError("loops: a trim without an edge is not at a pole of the surface")


def _trim(trim, edge, vertex):
    start, end, is_reversed = trim.StartVertexIndex, trim.EndVertexIndex, bool(trim.IsReversed)
    if trim.EdgeIndex < 0:
        return _Trim(None, False, vertex(start)[None], np.array([np.inf]))
    S, sharp = edge(trim.EdgeIndex, (end, start) if is_reversed else (start, end))
    return _Trim(trim.EdgeIndex, is_reversed, *((S[::-1], sharp[::-1]) if is_reversed else (S, sharp)))


def _is_whole(face):
    """True if the face is its surface from border to border."""
    alone = face.DuplicateFace(False)
    return alone is not None and bool(alone.IsSurface)


def nurbs_surface(surface):
    """NurbsSurface of a Rhino surface of any kind, in the file's units; ValueError if it has none."""
    nurbs = surface if type(surface).__name__ == "NurbsSurface" else surface.ToNurbsSurface()
    if nurbs is None:
        raise ValueError("the surface has no NURBS form")
    points, (n_u, n_v) = nurbs.Points, (nurbs.Points.CountU, nurbs.Points.CountV)
    at = [points.GetControlPoint(i, j) for i in range(n_u) for j in range(n_v)]
    Pw = np.array([(p.X, p.Y, p.Z, p.W) for p in at]).reshape(n_u, n_v, 4)
    if not nurbs.IsRational:
        Pw[..., 3] = 1.0
    return NurbsSurface(nurbs.OrderU - 1, nurbs.OrderV - 1, _knots(nurbs.KnotsU), _knots(nurbs.KnotsV), Pw)


def _nurbs_curve(curve):
    """NurbsCurve of a Rhino curve of any kind."""
    nurbs = curve.ToNurbsCurve()
    if nurbs is None:
        raise ValueError("an edge has no NURBS form")
    Pw = np.array([(p.X, p.Y, p.Z, p.W) for p in (nurbs.Points[i] for i in range(len(nurbs.Points)))])
    if not nurbs.IsRational:
        Pw[:, 3] = 1.0
    return NurbsCurve(nurbs.Order - 1, _knots(nurbs.Knots), Pw)


def _knots(stored):
    """All knots: the first and last, which Rhino leaves out, doubled; their value does not reach the domain."""
    knots = [stored[index] for index in range(len(stored))]
    return np.array([knots[0], *knots, knots[-1]])


def _xyz(p):
    return np.array([p.X, p.Y, p.Z])
