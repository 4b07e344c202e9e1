"""Element rows: the form factors of an element as the list of elements its rays meet.

    F_ij ~ n_ij / R_i           n_ij of R_i cosine-distributed rays from element i end on the front of element j

Malley's method from 16 points per element (Wallace et al. 1989 turned round: rays leave the receiver).
"""

from dataclasses import dataclass

import numpy as np

from lib.visibility.hemisphere import rays_about
from lib.visibility.hidden import RAYS, are_buried, is_hidden
from lib.visibility.qmc import r2
from lib.visibility.tracer import MISSED, Hits

NOTHING = -1  # the ray left the scene
ABSORBED = -2  # an emitter, a caster, a back face
NO_RAY = -3  # its point is hidden
RAYS_AT_ONCE = 16384


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
    # Ray r leaves from point r mod 16, so that every point gets a stretch of the sequence in every direction.
    sequence = r2(per_point * points).reshape(per_point, points, 2).swapaxes(0, 1)
    entries = np.empty((m, per_point * points), dtype=np.int32)
    met = np.empty(entries.shape, dtype=np.uint8)
    hidden = np.empty((m, points), dtype=bool)
    step = max(1, RAYS_AT_ONCE // entries.shape[1])
    for first in range(0, m, step):
        part = slice(first, first + step)
        k, at, normals = len(x[part]), x[part].reshape(-1, 3), N[part].reshape(-1, 3)
        origins, D = rays_about(at, normals, sequence, shift[part])
        cast = is_part[part].ravel()
        hits = tracer.closest(origins, D) if cast.all() else _of_some(tracer, origins, D, np.repeat(cast, per_point))
        element, point = mesh.element_of(hits, grids)
        buried = is_hidden(hits, mesh.in_shell, per_point) | ~cast
        doubt = np.flatnonzero(buried & cast) if per_point < RAYS else ()
        if len(doubt):
            shifts = np.repeat(shift[part], points, axis=0)[doubt]
            buried[doubt] = are_buried(at[doubt], normals[doubt], shifts, tracer, mesh)
        element.reshape(-1, per_point)[buried] = NO_RAY
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
