"""First hits of rays on a mesh that is drawn, by the ray tracer of the bake.

Coordinates are taken to the mesh's own centre and size in float64 before the tracer's float32.
"""

from dataclasses import dataclass

import numpy as np

from lib.visibility.framing import framed
from lib.visibility.tracer import Tracer


@dataclass(frozen=True)
class Mesh:
    """V (n_v, 3) float64, any unit; F (n_f, 3) int; centre (3,) and largest side of its bounding box; the tracer."""

    V: np.ndarray
    F: np.ndarray
    centre: np.ndarray
    scale: float
    tracer: Tracer


def prepare(V, F):
    """Mesh of V (n_v, 3) and F (n_f, 3), n_f = 0 allowed: nothing is hit then.

    Raises ValueError for a vertex that is not finite or an index out of range.
    """
    V, F, centre, scale = framed(V, F)
    return Mesh(V, F, centre, scale, Tracer((V - centre) / scale, F))


def first_hits(mesh, origin, direction):
    """The first triangle along each ray.

    origin, direction : (n, 3) float64, in the unit of V; a direction need not be a unit vector.
    Returns t (n,) float64 in lengths of `direction`, inf on a miss; face (n,) int64, -1 on a miss; weight (n, 3)
    float64, barycentric, 0 on a miss.
    """
    O, D = ((x / mesh.scale).astype(np.float32) for x in (origin - mesh.centre, direction))
    hits = mesh.tracer.closest(O, D)
    missed = hits.face < 0
    t = np.where(missed, np.inf, hits.t.astype(np.float64))
    weight = np.empty((len(t), 3))
    weight[:, 1], weight[:, 2] = hits.a, hits.b
    np.subtract(1, weight[:, 1] + weight[:, 2], out=weight[:, 0])
    weight[missed] = 0.0
    return t, hits.face.astype(np.int64), weight
