"""What a hit on the caster mesh means: which surface, where in its (u, v), which element, which texel."""

import numpy as np

from lib.elements.grids import POINTS
from lib.visibility.ray_kernels import elements_met


class MeshLookup:
    """Per-face tables over the caster mesh.

    V (n_v, 3);  face_surface (m,) int; UV (n_v, 2); F (m, 3); in_shell (m,) bool, the face belongs to a closed shell;
    back_of (n,) surface that is the back of each, -1 without one (None: of all).  Where there are such, the tables hold
    2 m faces, the second half for rays from behind (see Tracer); backs that belong to no surface stay as they are.
    """

    def __init__(self, V, F, UV, face_surface, in_shell, back_of=None):
        self.face_surface, in_shell = np.asarray(face_surface, dtype=np.int64), np.asarray(in_shell, dtype=bool)
        corners = np.asarray(UV, dtype=np.float64)[np.asarray(F)]
        self._uv = np.stack([corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
        V = np.asarray(V, dtype=np.float64)
        cross = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]) if len(F) else np.zeros((0, 3))
        self.normal = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-300)[:, None]
        self.two_sided = None
        if back_of is not None and (np.asarray(back_of) >= 0).any():
            behind = np.asarray(back_of)[self.face_surface]
            self.two_sided = behind >= 0
            self.face_surface = np.concatenate([self.face_surface, np.where(behind >= 0, behind, self.face_surface)])
            self._uv, self.normal = np.concatenate([self._uv, self._uv]), np.concatenate([self.normal, -self.normal])
            in_shell = np.concatenate([in_shell, in_shell])
        self.in_shell = in_shell

    def element_of(self, hits, grids):
        """Element number of each hit (n,) int32: -1 where nothing was met, -2 on back faces and surfaces without
        elements; and which of the element's 16 points is nearest (n,) uint8.
        """
        element = np.empty(len(hits.face), dtype=np.int32)
        point = np.empty(len(hits.face), dtype=np.uint8)
        faces = hits.face, hits.a, hits.b, hits.is_back, self.face_surface, self._uv
        elements_met(*faces, grids.n_u, grids.n_v, grids.first, POINTS, element, point)
        return element, point

    def texel_coordinates(self, width, height):
        """Faces in texel units of their surface's map: (m, 6) float32 rows s, t, ds_a, dt_a, ds_b, dt_b.

        width, height (n,) texels of each surface's map.
        """
        scale = np.stack([width - 1, height - 1], axis=1)[self.face_surface]
        return (self._uv * scale[:, None]).reshape(-1, 6).astype(np.float32)
