"""Points, unit normals and area densities of a surface of any kind, at places of its map.

A mesh has the normals of its corners, interpolated (Phong), and rays leave it from where that smooth surface would
be: each corner's tangent plane is asked where it passes above the place, and the answers are interpolated (Hanika
2021).  Otherwise the facets of a round thing shade each other.
"""

import numpy as np

from lib.nurbs import evaluate
from lib.surfaces.domain import Domain, barycentric, borders
from lib.surfaces.loops import signed_area
from lib.surfaces.mesh import Mesh
from lib.surfaces.trimmed import TrimmedSurface

ONE_CHART = 0  # of a trimmed surface


def domain_of(surface, cells, part=None):
    """The Domain of a trimmed surface or a mesh with charts, `cells` of its finest lattice along u and v; None where
    the whole square belongs to the surface.  part : what part_of returns, where it is known."""
    uv, border = part or part_of(surface)
    if isinstance(surface, Mesh):
        return Domain(surface.uv, surface.chart, cells, border)
    if isinstance(surface, TrimmedSurface) and not is_whole(surface):
        return Domain(uv, np.full(len(uv), ONE_CHART), cells, border)
    return None


def part_of(surface):
    """(uv (m, 3, 2) triangles of the part of the map that belongs to the surface, border (k, 3) as of a Domain), the
    slow things about a Domain; no triangles where the whole map does, or of a mesh, which has them already.
    """
    none = np.empty((0, 3, 2))
    if isinstance(surface, Mesh) and surface.uv is not None:
        return none, borders(surface.uv, surface.chart)
    if isinstance(surface, TrimmedSurface) and not is_whole(surface):
        from lib.surfaces.trim_mesh import domain_triangles  # here: a scene without trims need not load it

        uv, F = domain_triangles(surface)
        return uv[F], borders(uv[F], np.full(len(F), ONE_CHART), F)
    return none, np.empty((0, 3), dtype=bool)


def is_whole(trim):
    """True if the loops of a trimmed surface go round its whole box."""
    if len(trim.loop_start) > 2:
        return False
    return abs(signed_area(trim.uv)) > 1 - 1e-9


def whole(surface):
    """The NURBS surface under a trimmed one; any other as it is."""
    return surface.base if isinstance(surface, TrimmedSurface) else surface


def frame(surface, uv, face=None):
    """Points to send rays from and unit normals at uv (n, 2), in the triangles `face` (n,) of a mesh: S, N (n, 3)."""
    if not isinstance(surface, Mesh):
        return evaluate.frame(whole(surface), uv[:, 0], uv[:, 1])
    weight = barycentric(surface.uv[face], uv)
    corner, normal = surface.V[surface.F[face]], surface.N[face]
    S = np.einsum("nk,nkc->nc", weight, corner)
    N = np.einsum("nk,nkc->nc", weight, normal)
    flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(N, axis=1, keepdims=True)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    N = np.where(length > 1e-6, N / np.maximum(length, 1e-300), flat)
    below = np.minimum(np.einsum("nkc,nkc->nk", S[:, None] - corner, normal), 0.0)
    return S - np.einsum("nk,nkc->nc", weight * below, normal), N


def density(surface, uv, face=None):
    """Area of the surface over area of its map at uv (n, 2): (n,)."""
    if not isinstance(surface, Mesh):
        return evaluate.densities(whole(surface), uv[:, 0], uv[:, 1])[:, 0]
    corner, place = surface.V[surface.F[face]], surface.uv[face]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    e, f = place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]
    return area / np.maximum(np.abs(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]), 1e-300)
