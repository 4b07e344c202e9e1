"""Pictures on the surfaces of a first look: what a pixel shows of them."""

from dataclasses import dataclass

import numpy as np

from lib.maps.mesh_texture import Pyramid

GRAZING = 0.05  # cosine below which a pixel's longer side no longer counts


@dataclass(frozen=True)
class Painting:
    """A picture, tiled `repeat` (2,) times over [0, 1]^2, times factor (3,); wrap : it goes round at the border of u,
    of v."""

    picture: Pyramid
    repeat: np.ndarray
    factor: np.ndarray
    wrap: tuple = (True, True)

    def seen(self, corner, T, weight, width, cosine):
        """Its mean over pixels: (n, 3) float32.

        corner (n, 3, 3) of the triangles that are seen, T (n, 3, 2) where the picture has them, weight (n, 3) of the
        corners in the pixels' middles, width (n,) of the pixels there, in units of corner, across the ray; cosine (n,)
        of the angle between ray and normal
        """
        T = T * self.repeat
        e, f = T[:, 1] - T[:, 0], T[:, 2] - T[:, 0]
        texels = np.abs(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]) * self.picture.size.prod()
        area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
        shown = np.sqrt(texels / np.maximum(area, 1e-300) / np.maximum(cosine, GRAZING)) * width
        return self.picture.values(np.einsum("nk,nkc->nc", weight, T), shown, self.wrap) * np.float32(self.factor)
