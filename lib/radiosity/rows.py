"""Element rows: the form factors of an element as the list of elements its rays meet.

    F_ij ~ n_ij / R_i           n_ij of R_i cosine-distributed rays from element i end on the front of element j

Malley's method from 16 points per element (Wallace et al. 1989 turned round: rays leave the receiver).
"""

from dataclasses import dataclass

import numpy as np

from lib.visibility.hemisphere import cosine_directions
from lib.visibility.hidden import RAYS, are_buried, is_hidden
from lib.visibility.qmc import r2
from lib.visibility.tracer import MISSED, Hits

NOTHING = -1  # the ray left the scene
ABSORBED = -2  # an emitter, a caster, a back face
NO_RAY = -3  # its point is hidden
BATCH = 64  # elements at once


@dataclass(frozen=True)
class Rows:
    """entries (m, R) int32: element met, or NOTHING, ABSORBED, NO_RAY; met (m, R) uint8: at which of its points;
    is_hidden (m, 16) bool per point."""

    entries: np.ndarray
    met: np.ndarray
    is_hidden: np.ndarray


def without(rows, dropped):
    """Rows whose points `dropped` (m, 16) bool are hidden too: their rays do not count."""
    m, points = dropped.shape
    entries = np.where(dropped[:, :, None], NO_RAY, rows.entries.reshape(m, points, -1)).reshape(rows.entries.shape)
    return Rows(entries, rows.met, rows.is_hidden | dropped)


def element_rows(x, N, shift, R, tracer, mesh, grids, is_part=None):
    """Rows of m elements.

    x, N (m, 16, 3) lifted points and normals; shift (m, 2); R rays per element, shared among its points.
    mesh : MeshLookup of the casters; grids : ElementGrids; is_part (m, 16) bool, points on the surface (default all):
    the others are hidden and cast none.
    """
    is_part = np.ones(x.shape[:2], dtype=bool) if is_part is None else is_part
    m, points = x.shape[:2]
    per_point = max(1, R // points)
    sequence = r2(per_point * points)
    entries = np.empty((m, per_point * points), dtype=np.int32)
    met = np.empty(entries.shape, dtype=np.uint8)
    hidden = np.empty((m, points), dtype=bool)
    for first in range(0, m, BATCH):
        part = slice(first, first + BATCH)
        k = len(x[part])
        # Ray r leaves from point r mod 16, so that every point gets a stretch of the sequence in every direction.
        normals = N[part].reshape(-1, 3)
        D = np.empty((k, points, per_point, 3), dtype=np.float32)
        for p in range(points):
            D[:, p] = cosine_directions(normals[p::points], sequence[p::points], shift[part])
        origins = np.repeat(x[part].reshape(-1, 3).astype(np.float32), per_point, axis=0)
        D, out = D.reshape(-1, 3), np.repeat(~is_part[part].ravel(), per_point)
        hits = tracer.closest(origins, D) if not out.any() else _of_some(tracer, origins, D, ~out)
        element, point = mesh.element_of(hits, grids)
        in_shell = mesh.is_shell(hits.face)
        shape = (k * points, per_point)
        buried = is_hidden(hits.is_back.reshape(shape), in_shell.reshape(shape))
        buried |= ~is_part[part].ravel()
        doubt = np.flatnonzero(buried & is_part[part].ravel()) if per_point < RAYS else ()
        if len(doubt):
            shifts = np.repeat(shift[part], points, axis=0)[doubt]
            buried[doubt] = are_buried(x[part].reshape(-1, 3)[doubt], normals[doubt], shifts, tracer, mesh)
        element = np.where(buried[:, None], NO_RAY, element.reshape(shape))
        entries[part], met[part] = element.reshape(k, -1), point.reshape(k, -1)
        hidden[part] = buried.reshape(k, points)
    return Rows(entries, met, hidden)


def _of_some(tracer, origins, D, cast):
    """Hits of all rays, of which those that are not cast miss."""
    found = tracer.closest(np.ascontiguousarray(origins[cast]), np.ascontiguousarray(D[cast]))
    n = len(D)
    face, a, b = np.full(n, -1, dtype=np.int32), np.zeros(n, dtype=np.float32), np.zeros(n, dtype=np.float32)
    is_back, t = np.zeros(n, dtype=bool), np.full(n, MISSED)
    face[cast], a[cast], b[cast], is_back[cast], t[cast] = found.face, found.a, found.b, found.is_back, found.t
    return Hits(face, a, b, is_back, t)
