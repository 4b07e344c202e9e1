"""The mesh of a whole scene: every surface cut, neighbours meeting without a crack.

`shapes` finds once what surfaces are and how they touch; `Pieces` cuts them for given tolerances, each kind of surface
in its own way; `assemble` packs what was cut.  Along borders of equal speed, along seams and at poles of whole
surfaces the vertices of all sides take the position of the first of them, bit by bit, so nothing can slip through;
trimmed surfaces share the positions of their edges already.
"""

from dataclasses import dataclass, fields

import numpy as np

from lib import forks
from lib.nurbs import borders as find_borders
from lib.nurbs.cut import WholePieces
from lib.nurbs.facets import has_area
from lib.nurbs.surface import NurbsSurface
from lib.surfaces import measure
from lib.surfaces.mesh import Mesh
from lib.surfaces.mesh_pieces import MeshPieces
from lib.surfaces.pieces import pieces
from lib.surfaces.trim_cut import TrimmedPieces
from lib.surfaces.trimmed import TrimmedSurface

SLIDE = 0.01  # share of its size by which a texture may slide on a surface
KINDS = {NurbsSurface: WholePieces, TrimmedSurface: TrimmedPieces, Mesh: MeshPieces}


@dataclass(frozen=True)
class Shapes:
    """What n surfaces are, in the unit of the surfaces given.

    area (n,), extent (n, 2) mean length along u and v, is_planar (n,), is_closed (n, 2), is_collapsed (n, 4)
    borders (m, 5) int32 [surface a, side a, surface b, side b, reversed], shell (n,) int32 or -1: of whole NURBS
    surfaces alone
    """

    area: np.ndarray
    extent: np.ndarray
    is_planar: np.ndarray
    is_closed: np.ndarray
    is_collapsed: np.ndarray
    borders: np.ndarray
    shell: np.ndarray


@dataclass(frozen=True)
class SceneMesh:
    """Triangles of n surfaces, packed surface after surface.

    V (n_v, 3), UV (n_v, 2), F (n_f, 3) int32; vertex_start, face_start (n + 1,) int64
    distance (n,) largest distance to the surface, welding included; rms (n,) its root mean square; slide (n,); area
    (n,) of the facets
    side : per surface, arrays of vertices along its borders: four sides, or the edges of a trimmed one
    """

    V: np.ndarray
    UV: np.ndarray
    F: np.ndarray
    vertex_start: np.ndarray
    face_start: np.ndarray
    distance: np.ndarray
    rms: np.ndarray
    slide: np.ndarray
    area: np.ndarray
    side: list


def frame(surfaces):
    """(centre (3,), scale) of the box around points of every surface: x' = (x - centre) / scale."""
    points = np.concatenate([measure.points(s) for s in surfaces])
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, float((high - low).max())


def into_frame(surfaces, centre, scale):
    """The surfaces in the frame."""
    M = np.eye(4)
    M[:3, :3] /= scale
    M[:3, 3] = -np.asarray(centre) / scale
    return [measure.transformed(s, M) for s in surfaces]


def is_whole(surfaces):
    """(n,) bool: NurbsSurfaces, which have four sides and meet along them."""
    return np.array([isinstance(s, NurbsSurface) for s in surfaces], dtype=bool)


def shapes(surfaces, takes_part):
    """Measure the surfaces; takes_part (n,) bool: those that may be part of a closed shell of whole surfaces."""
    facts = forks.mapped(_facts, surfaces)
    closed, collapsed, areas, extents, planar = zip(*facts, strict=True) if facts else ((),) * 5
    is_closed, is_collapsed = np.array(closed).reshape(-1, 2), np.array(collapsed).reshape(-1, 4)
    whole = np.flatnonzero(is_whole(surfaces))
    border, shell = np.empty((0, 5), dtype=np.int32), np.full(len(surfaces), -1, dtype=np.int32)
    if whole.size:
        takes_part = np.asarray(takes_part, dtype=bool)[whole]
        own = [surfaces[s] for s in whole]
        border, shell[whole] = find_borders.find(own, is_closed[whole], is_collapsed[whole], takes_part)
        border[:, [0, 2]] = whole[border[:, [0, 2]]]
    extent = np.array(extents).reshape(-1, 2)
    return Shapes(np.array(areas), extent, np.array(planar), is_closed, is_collapsed, border, shell)


def _facts(surface):
    return (
        measure.is_closed(surface),
        measure.collapsed_sides(surface),
        measure.area(surface),
        measure.extent(surface),
        measure.is_planar(surface),
    )


def part(known, index):
    """What is known of the surfaces `index` (k,) ascending, numbered from 0."""
    own = {f.name: getattr(known, f.name)[index] for f in fields(Shapes) if f.name != "borders"}
    both = np.isin(known.borders[:, [0, 2]], index).all(axis=1)
    border = known.borders[both].copy()
    border[:, [0, 2]] = np.searchsorted(index, border[:, [0, 2]])
    return Shapes(**own, borders=border)


class Pieces:
    """n surfaces of any kinds; each kind, in `kinds` by its class, is cut by a class made for it.

    Such a class is made from (surfaces, known: Shapes, lattice) and has
        n_triangles(tolerance, slide) -> (k,)      triangles predicted, exactly or about
        cut(tolerance, slide) -> list of Patch     about as many
        cut_within(tolerance, slide) -> list of Patch, no farther from the exact surface than the tolerance
        learned(patches, tolerance, slide) -> such an object that cuts better, or None
        normals(s, patch) -> (v, 3)                unit normals at its vertices; ValueError where there are none
    with tolerance (k,) the largest distance and slide (k,) how far a texture may slide on the surface.

    lattice : {surface: (u, v)} interior parameters that must have a line whatever the shape
    """

    def __init__(self, surfaces, known, lattice=None, kinds=KINDS):
        self.surfaces, self.known, self.parts = surfaces, known, []
        for kind, made_by in kinds.items():
            index = np.flatnonzero([isinstance(s, kind) for s in surfaces])
            if index.size:
                own = {int(np.searchsorted(index, s)): at for s, at in (lattice or {}).items() if s in index}
                made = made_by([surfaces[s] for s in index], part(known, index), own)
                self.parts.append((index, made))

    def n_triangles(self, tolerance, slide):
        """Triangles (n,) predicted for tolerance (n,) and slide (n,)."""
        out = np.zeros(len(self.surfaces), dtype=np.int64)
        for index, part in self.parts:
            out[index] = part.n_triangles(tolerance[index], slide[index])
        return out

    def cut(self, tolerance, slide):
        """A list of n Patch, of about the predicted count."""
        return self._in_order([part.cut(tolerance[index], slide[index]) for index, part in self.parts])

    def cut_within(self, tolerance, slide):
        """A list of n Patch, within tolerance (n,) where that can be."""
        return self._in_order([part.cut_within(tolerance[index], slide[index]) for index, part in self.parts])

    def _in_order(self, of_parts):
        out = [None] * len(self.surfaces)
        for (index, _), patches in zip(self.parts, of_parts, strict=True):
            for s, patch in zip(index, patches, strict=True):
                out[s] = patch
        return out

    def learned(self, patches, tolerance, slide):
        """Pieces that cut better where `patches` came out far off, or None."""
        better = [
            (index, part.learned([patches[s] for s in index], tolerance[index], slide[index]))
            for index, part in self.parts
        ]
        if all(part is None for _, part in better):
            return None
        out = Pieces([], self.known)
        out.surfaces = self.surfaces
        out.parts = [(i, new or old) for (i, new), (_, old) in zip(better, self.parts, strict=True)]
        return out

    def normals(self, s, patch):
        """Unit normals (v, 3) of the exact surface s at a patch's vertices; ValueError where it has none."""
        for index, part in self.parts:
            if s in index:
                return part.normals(int(np.searchsorted(index, s)), patch)


def assemble(patches, surfaces, known):
    """Pack the patches of the surfaces into one SceneMesh; borders, seams and poles of whole ones are welded."""
    vertex_start = np.concatenate([[0], np.cumsum([len(p.S) for p in patches])]).astype(np.int64)
    side = [tuple(k + start for k in p.side) for p, start in zip(patches, vertex_start[:-1], strict=True)]
    whole = is_whole(surfaces)
    V, moved = _weld(np.concatenate([p.S for p in patches]), side, known, whole)
    F = [p.F + start for p, start in zip(patches, vertex_start[:-1], strict=True)]
    F = [f[has_area(V, f)] if is_cut else f for f, is_cut in zip(F, whole, strict=True)]
    face_start = np.concatenate([[0], np.cumsum([len(f) for f in F])]).astype(np.int64)
    moved = np.maximum.reduceat(moved, vertex_start[:-1])
    return SceneMesh(
        V,
        np.concatenate([p.UV for p in patches]),
        np.concatenate(F).astype(np.int32),
        vertex_start,
        face_start,
        np.array([p.distance for p in patches]) + moved,
        np.sqrt([p.square for p in patches]),
        np.array([p.slide for p in patches]),
        np.array([p.area for p in patches]),
        side,
    )


def _weld(V, side, known, whole):
    """Positions with those of one place made equal, and how far each vertex moved (n_v,)."""
    a, b = [], []
    for s in np.flatnonzero(whole):
        own = side[s]
        for k in np.flatnonzero(known.is_collapsed[s]):
            a.append(np.broadcast_to(own[k][:1], own[k].shape))
            b.append(own[k])
        for d in np.flatnonzero(known.is_closed[s]):
            a.append(own[2 * d])
            b.append(own[2 * d + 1])
    for s, k, t, m, is_reversed in known.borders.tolist():
        first, second = side[s][k], side[t][m]
        if len(first) == len(second):
            a.append(first)
            b.append(second[::-1] if is_reversed else second)
    if not a:
        return V, np.zeros(len(V))
    piece = pieces(len(V), np.concatenate(a), np.concatenate(b))
    same = np.unique(piece, return_index=True)[1][piece]  # the smallest number of all vertices in one place
    return V[same], np.linalg.norm(V[same] - V, axis=1)
