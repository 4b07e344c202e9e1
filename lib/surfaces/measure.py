"""What a surface is as a shape, whichever kind it is: the one place that tells the kinds apart.

A kind is a NurbsSurface (lib.nurbs.surface), a TrimmedSurface (lib.surfaces.trimmed) or a Mesh (lib.surfaces.mesh).
Every function takes any of them; those of whole NURBS surfaces are in lib.nurbs.shape.
"""

import numpy as np

from lib.nurbs import shape
from lib.nurbs.evaluate import evaluate, evaluate_grid
from lib.surfaces import trim_area
from lib.surfaces.loops import following, inside
from lib.surfaces.mesh import Mesh
from lib.surfaces.trimmed import TrimmedSurface

NINE = np.linspace(0.0, 1.0, 9)
AT_SIDE = 1e-9  # border points this near to a side of the box lie on it
SAME_SPAN = 1e-6  # of the side: lengths of border on two sides of a seam that count as equal
OFF_PLANE = 3e-5  # of its size a planar surface's border may leave the plane (files join edges no closer than that)


def transformed(surface, M):
    """The surface under the affine map M (4, 4): S' = M S.  A mirrored map (det M < 0) turns the lit side round, with
    the corner normals of a mesh, which stay on the side its triangles are wound for.

    Positions are equal bit for bit after the map where they were before.
    """
    M = np.asarray(M, dtype=np.float64)
    if isinstance(surface, Mesh):
        return Mesh(
            _moved(surface.V, M), surface.F, _turned(surface.N, M), surface.T, surface.uv, surface.chart, surface.level
        )
    if isinstance(surface, TrimmedSurface):
        stretch = np.linalg.svd(M[:3, :3], compute_uv=False)[0]  # of what lies between a chord and its curve
        return TrimmedSurface(
            shape.transformed(surface.base, M),
            surface.box,
            surface.uv,
            surface.loop_start,
            _moved(surface.S, M),
            surface.significance * stretch,
        )
    return shape.transformed(surface, M)


def _moved(S, M):
    """M S, one point like the other: a matrix product rounds a row by where it stands among the rows."""
    x, y, z = np.asarray(S, dtype=np.float64).T
    return np.stack([M[k, 0] * x + M[k, 1] * y + M[k, 2] * z + M[k, 3] for k in range(3)], axis=1)


def _turned(N, M):
    """Unit normals (..., 3) by the cofactors of M, which are det M times its inverse transposed."""
    A = M[:3, :3]
    cofactors = np.stack([np.cross(A[1], A[2]), np.cross(A[2], A[0]), np.cross(A[0], A[1])])
    N = N @ cofactors.T
    return N / np.maximum(np.linalg.norm(N, axis=-1, keepdims=True), 1e-300)


def corners(mesh):
    """Positions of the corners of a Mesh's triangles: three arrays (m, 3)."""
    return tuple(mesh.V[mesh.F[:, k]] for k in range(3))


def _triangle_areas(mesh):
    A, B, C = corners(mesh)
    return np.linalg.norm(np.cross(B - A, C - A), axis=1) / 2


def area(surface):
    """Area [square of the surface's unit], of a trimmed surface inside its loops."""
    if isinstance(surface, Mesh):
        return float(_triangle_areas(surface).sum())
    if isinstance(surface, TrimmedSurface):
        return trim_area.area(surface)
    return shape.area(surface)


def extent(surface):
    """(length_u, length_v): mean of |S_u| and |S_v| over the part inside, the length of [0, 1] at that speed.

    The mean is over (u, v), of a mesh over its area; a mesh without uv has the side of a square of its area, twice.
    """
    if isinstance(surface, Mesh):
        return _mesh_extent(surface)
    if isinstance(surface, TrimmedSurface):
        return trim_area.extent(surface)
    return shape.extent(surface)


def _mesh_extent(mesh):
    weight = _triangle_areas(mesh)
    side = float(np.sqrt(weight.sum()))
    if mesh.uv is None:
        return side, side
    A, B, C = corners(mesh)
    (a, b), (c, d) = ((mesh.uv[:, k] - mesh.uv[:, 0]).T for k in (1, 2))
    det = a * d - b * c
    weight = np.where(np.abs(det) > 0, weight, 0.0)
    if not weight.sum() > 0:
        return side, side
    det = np.where(det == 0, 1.0, det)[:, None]
    S_u = (d[:, None] * (B - A) - b[:, None] * (C - A)) / det
    S_v = (a[:, None] * (C - A) - c[:, None] * (B - A)) / det
    return tuple(float(weight @ np.linalg.norm(along, axis=1) / weight.sum()) for along in (S_u, S_v))


def is_closed(surface):
    """(closed in u, closed in v): opposite sides of [0, 1] x [0, 1] are the same curve, and not one point.

    A trimmed surface is closed where its base is and its border runs along both sides, as far on one as on the other:
    the seam.  A mesh is closed nowhere in that sense.
    """
    if isinstance(surface, Mesh):
        return False, False
    if isinstance(surface, TrimmedSurface):
        return tuple(bool(c and _has_seam(surface, d)) for d, c in enumerate(shape.is_closed(surface.base)))
    return shape.is_closed(surface)


def _has_seam(trim, d):
    """True when the border runs as far along the side 0 of direction d as along the side 1."""
    length = []
    for end in (0.0, 1.0):
        on_side = np.abs(trim.uv[:, d] - end) <= AT_SIDE
        after = following(trim.loop_start)
        both = on_side & on_side[after]
        length.append(np.abs(trim.uv[after, 1 - d] - trim.uv[:, 1 - d])[both].sum())
    return min(length) > SAME_SPAN and abs(length[1] - length[0]) <= SAME_SPAN


def collapsed_sides(surface):
    """(4,) bool: sides u=0, u=1, v=0, v=1 of the box that are one point of the surface (poles); none of a mesh."""
    if isinstance(surface, Mesh):
        return np.zeros(4, dtype=bool)
    return shape.collapsed_sides(surface.base if isinstance(surface, TrimmedSurface) else surface)


def is_planar(surface):
    """True when every point lies in one plane: to float32 precision, the border of a trimmed surface to OFF_PLANE."""
    if isinstance(surface, TrimmedSurface):
        if not shape.is_planar(surface.base):
            return False
        middle, normal = _plane(surface.base.P.reshape(-1, 3))
        return bool(np.abs((surface.S - middle) @ normal).max() <= OFF_PLANE * np.ptp(surface.S, axis=0).max())
    if isinstance(surface, Mesh):
        middle, normal = _plane(surface.V)
        return bool(np.abs((surface.V - middle) @ normal).max() <= shape.PLANAR * np.ptp(surface.V, axis=0).max())
    return shape.is_planar(surface)


def _plane(P):
    middle = P.mean(axis=0)
    return middle, np.linalg.eigh(np.cov((P - middle).T))[1][:, 0]


def map_domain(surface):
    """(u0, u1, v0, v1) that the map of a surface covers of the whole surface's [0, 1] x [0, 1]: a trimmed one's box."""
    return tuple(float(x) for x in surface.box) if isinstance(surface, TrimmedSurface) else (0.0, 1.0, 0.0, 1.0)


def hull(surface):
    """Points (k, 3) whose convex hull holds the surface: control points and border, or vertices."""
    if isinstance(surface, Mesh):
        return surface.V
    if isinstance(surface, TrimmedSurface):
        return np.concatenate([surface.base.P.reshape(-1, 3), surface.S])
    return surface.P.reshape(-1, 3)


def points(surface):
    """Points (k, 3) on the surface, enough to tell where it is and how large."""
    if isinstance(surface, Mesh):
        return surface.V[np.unique(surface.F)]
    if isinstance(surface, TrimmedSurface):
        uv = np.stack(np.meshgrid(NINE, NINE), axis=-1).reshape(-1, 2)
        uv = uv[inside(surface, uv)]
        return np.concatenate([surface.S, evaluate(surface.base, uv[:, 0], uv[:, 1])[0]])
    return evaluate_grid(surface, NINE, NINE)[0].reshape(-1, 3)
