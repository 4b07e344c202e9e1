"""Constrained Delaunay triangulation of trimmed surfaces in their (u, v).  The one importer of pythoncdt."""

import numpy as np
import pythoncdt

from lib.surfaces.loops import following
from lib.surfaces.trimmed import TrimmedSurface

NOT_ALLOWED = pythoncdt.IntersectingConstraintEdges.NOT_ALLOWED
TRY_RESOLVE = pythoncdt.IntersectingConstraintEdges.TRY_RESOLVE


def domain_triangles(trim: TrimmedSurface):
    """Triangles of the part inside the loops from its border points alone: uv (k, 2) float64, F (m, 3) int64 counter-
    clockwise in (u, v).  Where loops cross, points of crossing are added after those of the border.
    """
    edges = np.stack([np.arange(len(trim.uv)), following(trim.loop_start)], axis=1)
    return triangles(trim.uv, edges, TRY_RESOLVE)


def triangles(points, edges, crossing=NOT_ALLOWED):
    """Constrained Delaunay triangles of `points` (k, 2) inside the closed loops of `edges` (e, 2), holes left out.

    Returns points (k', 2), the given ones first, and F (m, 3) int64 counterclockwise.  Points in one place become
    the first of them.  RuntimeError where edges cross and `crossing` does not allow it.
    """
    own, first, number = np.unique(points, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))  # in the order given, so that the triangles do not depend on where u = 0 is
    edges = place[number.ravel()[edges]]
    edges = edges[edges[:, 0] != edges[:, 1]]
    made = pythoncdt.Triangulation(pythoncdt.VertexInsertionOrder.AUTO, crossing, 0.0)
    made.insert_vertices(np.ascontiguousarray(own[order]))
    made.insert_edges(np.ascontiguousarray(edges, dtype=np.uint32))
    made.erase_outer_triangles_and_holes()
    F = made.triangles_array()["vertices"].astype(np.int64)
    found = made.vertices_array()
    extra = np.stack([found["x"], found["y"]], axis=1)[len(own) :]
    number = np.concatenate([first[order], len(points) + np.arange(len(extra))])
    return np.concatenate([points, extra]), number[F]
