"""A scene ready for light: surfaces in the scene's frame, their lattices, emitters, and the tracer over the caster
mesh.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np

from lib.elements.chunks import members
from lib.elements.grids import element_grids
from lib.elements.lattice import Lattice, roots_of
from lib.nurbs.evaluate import frame_grid
from lib.nurbs.surface import NurbsSurface
from lib.radiosity.emitters import facets_of_triangles, gather_emitters, simplified
from lib.radiosity.quality import first_level
from lib.surfaces import boxes
from lib.surfaces.frames import domain_of, whole
from lib.surfaces.measure import transformed
from lib.surfaces.mesh import Mesh
from lib.surfaces.mesh_build import normals_areas
from lib.visibility.mesh_lookup import MeshLookup
from lib.visibility.tracer import Tracer

FINEST = 10  # positions are hashed on this level's lattice: a crossing draws the same rays at whatever level it is met
APART = 2e-5  # in the frame: more than float32 rays err by, less than their origins are lifted
PLACED = 8  # level of a trimmed surface's lattice whose cells say how dense its border is walked
TURN = 0.6  # radians between normals of neighbouring base samples: beyond, light that depends on direction is missed


def _steepest(N):
    """Least cosine between neighbouring unit normals (h, w, 3)."""
    along = [(N[:, 1:] * N[:, :-1]).sum(axis=2), (N[1:] * N[:-1]).sum(axis=2)]
    return min(float(cosine.min(initial=1.0)) for cosine in along)


class World:
    """What sample and refine need of a scene.

    scene : has names, surfaces (world units), front, flip, role, E, group, groups, is_black, glow
    casters : has centre, scale, V, F, UV, face_surface, sag, area, extent, is_planar, is_closed, is_collapsed,
        is_back_to_back, shell, part(s)
    """

    def __init__(self, scene, casters):
        self.scene, self.casters = scene, casters
        self.n = len(scene.names)
        self.n_groups = len(scene.groups)
        self.channels = 3 * self.n_groups
        role = np.array(scene.role)
        self.has_map = (role != "cast_only") & ~np.asarray(scene.is_black)
        self.reflects = (role == "full") & ~np.asarray(scene.is_black)
        self.lattices = [
            Lattice(roots_of(casters.extent[s]), tuple(casters.is_closed[s]), tuple(casters.is_collapsed[s]))
            for s in range(self.n)
        ]
        self._frame = np.eye(4) / casters.scale
        self._frame[:3, 3] = -np.asarray(casters.centre) / casters.scale
        self._frame[3, 3] = 1.0
        self._surfaces, self._domains, self._covers = {}, {}, {}

    def surface(self, s):
        """Surface s in the scene's frame."""
        if s not in self._surfaces:
            self._surfaces[s] = transformed(self.scene.surfaces[s], self._frame)
        return self._surfaces[s]

    def domain(self, s):
        """The Domain of surface s, None if it fills its map."""
        if s not in self._domains:
            level = self.finest(s)
            rows, columns = self.lattices[s].cells(PLACED if level is None else level)
            front = s if self.scene.front[s] < 0 else self.scene.front[s]
            self._domains[s] = domain_of(self.surface(s), (columns, rows), self.casters.part(front))
        return self._domains[s]

    def finest(self, s):
        """Level of the atlas of a mesh, which keeps its charts apart; None for other surfaces."""
        surface = self.scene.surfaces[s]
        return surface.level if isinstance(surface, Mesh) else None

    def cover(self, s, level):
        """(needed, straddling) cells of a level of surface s (see Domain.cover); None if it fills its map."""
        if self.domain(s) is None:
            return None
        if (s, level) not in self._covers:
            self._covers[s, level] = self.domain(s).cover(*self.lattices[s].cells(level))
        return self._covers[s, level]

    def is_needed(self, s, level):
        """(h, w) bool: crossings that are a corner of a needed cell; None if all are."""
        cover = self.cover(s, level)
        if cover is None:
            return None
        needed = np.zeros(self.lattices[s].shape(level), dtype=bool)
        rows, columns = cover[0].shape
        for dj in (0, 1):
            for di in (0, 1):
                needed[dj : dj + rows, di : di + columns] |= cover[0]
        return self.lattices[s].share_own(needed)

    def side(self, s):
        """Mean side of a root cell of surface s along its longer direction, in the scene's frame."""
        return float(max(self.casters.extent[s])) / max(self.lattices[s].roots)

    def base_level(self, s, level):
        """Level at which the trees of surface s begin: `level` on large surfaces, less on small ones as far as they
        are flat.
        """
        least = int(first_level(self.side(s), level))
        if self.casters.is_planar[s] or least == level or self.finest(s) is not None:
            return least
        h, w = self.lattices[s].shape(level)
        N = frame_grid(whole(self.surface(s)), np.linspace(0, 1, w), np.linspace(0, 1, h))[1]
        while least < level and _steepest(N[:: 2 ** (level - least), :: 2 ** (level - least)]) < np.cos(TURN):
            least += 1
        return least

    @cached_property
    def emitters(self):
        """All emitters, in the scene's frame; cast_only ones shine too."""
        lit = np.flatnonzero(np.asarray(self.scene.E).max(axis=1, initial=0.0) > 0)
        surfaces, glow = [None] * self.n, self.scene.glow
        for s in lit:
            if isinstance(self.scene.surfaces[s], NurbsSurface):  # exactly
                surfaces[s] = self.surface(s)
        others = [s for s in lit if surfaces[s] is None]
        parts = {s: self._lit_parts(s) for s in others}
        kept = iter(simplified([part for s in others for part in parts[s]]))
        for s in others:
            own = [
                facets_of_triangles(tuple(V[F[:, k]] for k in range(3)), area)
                for area, (V, F) in ((area, next(kept)) for area in self._part_areas(s, parts[s]))
            ]
            surfaces[s] = own if s in glow else own[0]
        found = gather_emitters(surfaces, self.scene.flip, self.scene.E, self.scene.group, glow)
        return replace(found, is_curved=found.is_curved | self.casters.is_back_to_back[found.surface])

    def _lit_parts(self, s):
        """[(V, F)] of the parts of surface s, which is known by its triangles, that shine each in its own way."""
        V, F = self._triangles(s)
        return boxes.cut(V, self.casters.UV, F, self.scene.glow[s].box) if s in self.scene.glow else [(V, F)]

    def _part_areas(self, s, parts):
        """Areas of the parts of surface s: shares of its own."""
        area = float(self.casters.area[s])
        if len(parts) == 1:
            return [area]
        own = np.array([normals_areas(V, F)[1].sum() for V, F in parts])
        return area * own / max(own.sum(), 1e-300)

    def _triangles(self, s):
        """(V, F) of the triangles of surface s that cast shadows, round its lit side."""
        c, front = self.casters, int(self.scene.front[s])
        F = c.F[c.face_surface == (s if front < 0 else front)]
        return c.V, F if front < 0 else F[:, ::-1]

    @cached_property
    def tracer(self):
        """Rays against the caster mesh.

        Sheets that stand back to back in one plane are moved apart, each towards its lit side: otherwise which of them
        a ray meets is a matter of rounding.
        """
        c = self.casters
        face = c.is_back_to_back[c.face_surface]
        V = np.array(c.V)
        vertex, first = np.unique(c.F[face], return_index=True)
        V[vertex] += APART * self.mesh.normal[: len(face)][face][first // 3]
        return Tracer(V, c.F, self.mesh.two_sided)

    @cached_property
    def mesh(self):
        """What its faces mean."""
        c = self.casters
        return MeshLookup(c.V, c.F, c.UV, c.face_surface, c.face_shell, self._back_of)

    @property
    def _back_of(self):
        """(n,) the surface that is the back of each, -1 without one."""
        front = self.scene.front
        back_of = np.full(self.n, -1)
        back_of[front[front >= 0]] = np.flatnonzero(front >= 0)
        return back_of

    def grids(self, n_elements):
        """Element grids of the scene."""
        c = self.casters
        return element_grids(c.area, c.extent, c.is_planar, self.reflects, n_elements)

    def chunk(self, n_chunks, chunk):
        """Surfaces with maps that a chunk handles, ascending."""
        return members(self.has_map, n_chunks, chunk)
