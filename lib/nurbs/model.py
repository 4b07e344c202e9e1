"""The geomdl model of a surface: reading its records, and its knot and degree operations.  The one importer of geomdl.

Bulk evaluation is in lib.nurbs.evaluate; geomdl evaluates point by point in plain Python and is the oracle of tests.
"""

import numpy as np
from geomdl import NURBS, helpers, operations

from lib.nurbs.surface import NurbsSurface


def to_geomdl(surface):
    """A geomdl.NURBS.Surface with the same knots and weighted control points."""
    shape = NURBS.Surface(normalize_kv=False)
    shape.degree_u, shape.degree_v = surface.degree_u, surface.degree_v
    n_u, n_v = surface.Pw.shape[:2]
    shape.set_ctrlpts(surface.Pw.reshape(-1, 4).tolist(), n_u, n_v)
    shape.knotvector_u, shape.knotvector_v = surface.knots_u.tolist(), surface.knots_v.tolist()
    return shape


def from_geomdl(shape):
    """The NurbsSurface of a geomdl NURBS or BSpline surface; its list of points runs along v first."""
    n_u, n_v = shape.ctrlpts_size_u, shape.ctrlpts_size_v
    P = np.array(shape.ctrlptsw if shape.rational else shape.ctrlpts, dtype=np.float64).reshape(n_u, n_v, -1)
    Pw = P if shape.rational else np.concatenate([P, np.ones((n_u, n_v, 1))], axis=2)
    return NurbsSurface(shape.degree_u, shape.degree_v, shape.knotvector_u, shape.knotvector_v, Pw)


def from_record(record):
    """The surface of one record of a geomdl JSON file (as its export_json writes: points not multiplied by weights)."""
    shape = NURBS.Surface(normalize_kv=False)
    shape.degree_u, shape.degree_v = record["degree_u"], record["degree_v"]
    shape.ctrlpts_size_u, shape.ctrlpts_size_v = record["size_u"], record["size_v"]
    shape.ctrlpts = record["control_points"]["points"]
    shape.knotvector_u, shape.knotvector_v = record["knotvector_u"], record["knotvector_v"]
    if "weights" in record["control_points"]:
        shape.weights = record["control_points"]["weights"]
    return from_geomdl(shape)


def with_knots(surface, u=(), v=()):
    """The same surface with knots inserted at the parameters u and v, each once (The NURBS Book, A5.3)."""
    shape = to_geomdl(surface)
    for t in u:
        shape = operations.insert_knot(shape, [float(t), None], [1, 0])
    for t in v:
        shape = operations.insert_knot(shape, [None, float(t)], [0, 1])
    return from_geomdl(shape)


def elevated(surface):
    """The same Bezier surface with both degrees raised by one (The NURBS Book, eq. 5.36).

    Raises ValueError for a surface with interior knots.
    """
    if surface.Pw.shape[:2] != (surface.degree_u + 1, surface.degree_v + 1):
        raise ValueError("degree elevation is for single Bezier patches")
    Pw = surface.Pw
    for axis, degree in ((0, surface.degree_u), (1, surface.degree_v)):
        rows = [helpers.degree_elevation(degree, row.tolist()) for row in np.moveaxis(Pw, axis, 1)]
        Pw = np.moveaxis(np.array(rows), 1, axis)
    p, q = surface.degree_u + 1, surface.degree_v + 1
    return NurbsSurface(p, q, np.repeat([0.0, 1.0], p + 1), np.repeat([0.0, 1.0], q + 1), Pw)
