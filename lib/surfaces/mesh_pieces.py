"""Triangle meshes as they are: nothing is exact but their triangles."""

import numpy as np

from lib.nurbs.facets import Patch, normals
from lib.surfaces.rows import numbered


class MeshPieces:
    """n Meshes, each cut into its own triangles whatever the tolerance.

    A vertex is a position with one uv and one normal; corners that agree in these share it.
    """

    def __init__(self, surfaces, known, lattice=None):
        self.surfaces = surfaces
        self._made = [as_patch(mesh) for mesh in surfaces]

    def n_triangles(self, tolerance, slide):
        """Triangles (n,)."""
        return np.array([len(mesh.F) for mesh in self.surfaces])

    def cut(self, tolerance, slide):
        """A list of Patch; distance 0, since the mesh is the surface."""
        return [patch for patch, _ in self._made]

    cut_within = cut

    def learned(self, patches, tolerance, slide):
        """None: there is nothing to learn."""
        return None

    def normals(self, s, patch):
        """Unit normals (k, 3) at the vertices of the patch of mesh s."""
        return self._made[s][1]


def as_patch(mesh):
    """The Patch of a Mesh and the normals of its vertices."""
    m = len(mesh.F)
    uv = np.zeros((m, 3, 2)) if mesh.uv is None else mesh.uv
    corner = np.concatenate([mesh.F[..., None], uv, mesh.N], axis=2).reshape(3 * m, 6) + 0.0
    number, first = numbered(corner)
    rows = corner[first]
    V, F = mesh.V[mesh.F.ravel()[first]], number.reshape(m, 3)
    area = normals(*(V[F[:, k]] for k in range(3)))[1]
    return Patch(V, np.clip(rows[:, 1:3], 0.0, 1.0), F, (), 0.0, 0.0, 0.0, float(area.sum())), rows[:, 3:]
