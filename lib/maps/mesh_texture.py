"""Base textures of meshes: their average reflectance, and their value at the crossings of the mesh's map.

A mesh says where the picture lies on it by texture coordinates T at the corners of its triangles: (0, 0) is the
picture's lower left, (1, 1) its upper right, and it repeats beyond; `repeat` multiplies T.  Its map's (u, v) are
another chart of it.  A crossing asks its triangle for T and the picture, halved as often as makes its pixels as wide
as the map's spacing there, for its bilinear value at T (Williams 1983).
"""

import numpy as np

from lib.maps.pixels import bilinear, box_means
from lib.surfaces.domain import Domain, barycentric, corners_of
from lib.surfaces.measure import corners
from lib.visibility.qmc import r2

PLACES = 1 << 17  # of an average: measured, it errs by less than 1e-3 on pictures of noise and on a textured teapot
AT_ONCE = 1 << 18  # crossings
APART = 2  # levels above the finest at which charts still share no corner of a cell, so far apart do they lie there


class Pyramid:
    """A picture (H, W, 3), row 0 its top, and its halves, made when they are needed."""

    def __init__(self, picture):
        self._levels = [np.asarray(picture, dtype=np.float32)[::-1]]
        self.size = np.array(picture.shape[1::-1])

    def level(self, k):
        """The picture upside down, (max(1, H >> k), max(1, W >> k), 3) float32, by means over equal rectangles."""
        while len(self._levels) <= k:
            half = self._levels[-1]
            for axis in (0, 1):
                n = half.shape[axis]
                lines = np.linspace(0.0, n, max(1, n // 2) + 1)
                half = box_means(half, lines[:-1], lines[1:], axis)
            self._levels.append(np.asarray(half, dtype=np.float32))
        return self._levels[k]

    def values(self, T, width, wrap=(True, True)):
        """The picture at T (n, 2), over about `width` (n,) of its pixels: (n, 3) float32.  Along s, t it repeats beyond
        [0, 1], or its border does."""
        last = int(self.size.max()).bit_length() - 1
        level = np.clip(np.round(np.log2(np.maximum(width, 1.0))), 0, last).astype(np.int64)
        found = np.empty((len(T), 3), dtype=np.float32)
        for k in np.unique(level):
            some = np.flatnonzero(level == k)
            picture = self.level(int(k))
            x, y = (np.where(wrap, T[some] % 1.0, T[some]) * picture.shape[1::-1]).T
            found[some] = bilinear(picture, x, y, wrap)
        return found


def rho_average(mesh, picture, repeat=(1, 1)):
    """Return the mean reflectance (3,) float64 of a textured mesh, weighted by area.

    mesh : Mesh with T, charts are not needed;  picture : (H, W, 3) linear RGB in [0, 1];  repeat : factors of T > 0.

    The mean over PLACES places spread by area, each standing for the part of the picture that falls to it.  Exact for
    constant pictures.
    """
    low = picture.min(axis=(0, 1)).astype(np.float64)  # taken off first: a constant keeps its value to the last bit
    contrast = _at_places(mesh, picture - low.astype(np.float32), repeat)[2]
    return low + contrast.mean(axis=0, dtype=np.float64)


def means_over(mesh, picture, repeat, n):
    """Return the means (n, n, 3) float64 of a mesh's picture over n x n equal boxes of its map, weighted by area, and
    the share (n, n) of its area in each; row 0 at v = 0.  By the same places as rho_average.
    """
    face, weight, value = _at_places(mesh, picture, repeat)
    uv = np.einsum("nk,nkc->nc", weight, mesh.uv[face])
    i, j = np.clip(uv * n, 0, n - 1).astype(int).T
    count = np.bincount(j * n + i, minlength=n * n)
    total = np.stack([np.bincount(j * n + i, value[:, c], n * n) for c in range(3)], axis=1)
    return (total / np.maximum(count, 1)[:, None]).reshape(n, n, 3), count.reshape(n, n) / PLACES


def _at_places(mesh, picture, repeat):
    """PLACES places spread by area: their triangles (k,), barycentric weights (k, 3), and the picture there (k, 3)."""
    pyramid = Pyramid(picture)
    A, B, C = corners(mesh)
    area = np.linalg.norm(np.cross(B - A, C - A), axis=1)
    share = np.cumsum(area) / area.sum()
    face = np.minimum(np.searchsorted(share, (np.arange(PLACES) + 0.5) / PLACES), len(share) - 1)
    second, third = r2(PLACES).T
    over = second + third > 1
    second, third = np.where(over, 1 - second, second)[:, None], np.where(over, 1 - third, third)[:, None]
    T = mesh.T * np.asarray(repeat, dtype=np.float64)
    e, f = T[:, 1] - T[:, 0], T[:, 2] - T[:, 0]
    pixels = np.abs(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]) / 2 * pyramid.size.prod()
    width = np.sqrt(pixels / np.maximum(np.diff(share, prepend=0.0) * PLACES, 1.0))
    value = pyramid.values(T[face, 0] + second * e[face] + third * f[face], width[face])
    return face, np.hstack([1 - second - third, second, third]), value


def evaluate(mesh, picture, repeat, w, h):
    """Evaluate a mesh's picture at the crossings of its w x h map.

    mesh : Mesh with T and charts;  picture : (H, W, 3) linear RGB in [0, 1]

    Returns rho (h, w, 3) float32, row 0 at v = 0, and outside (h, w) bool: crossings of cells without a part of the
    mesh, where rho is 0.  Crossings beside a chart hold what its border has nearest to them.
    """
    domain, pyramid = Domain(mesh.uv, mesh.chart, (w - 1, h - 1)), Pyramid(picture)
    needed = corners_of(domain.cover(h - 1, w - 1)[0])
    T = mesh.T * np.asarray(repeat, dtype=np.float64)
    width = pixels_per_map(mesh, pyramid.size, repeat, (w - 1, h - 1))
    rho = np.zeros((h, w, 3), dtype=np.float32)
    rows, columns = np.nonzero(needed)
    for first in range(0, len(rows), AT_ONCE):
        j, i = rows[first : first + AT_ONCE], columns[first : first + AT_ONCE]
        uv = np.stack([i / (w - 1), j / (h - 1)], axis=1)
        face = domain.face_at(uv)
        beside = np.flatnonzero(face < 0)
        nearest = domain.locate(uv[beside])
        uv[beside], face[beside] = nearest.uv, nearest.face
        at = np.einsum("nk,nkc->nc", barycentric(mesh.uv[face], uv), T[face])
        rho[j, i] = np.clip(pyramid.values(at, width[face]), 0, 1)
    return rho, ~needed


def pixels_per_map(mesh, size, repeat, cells=(1, 1)):
    """Pixels of a picture of size (W, H) that 1 / cells of the map is wide on each triangle, along u or v, whichever
    is more: (m,), 0 where a triangle has no area in the map.
    """
    (a, b), (c, d) = ((mesh.uv[:, k] - mesh.uv[:, 0]).T for k in (1, 2))
    e, f = ((mesh.T[:, k] - mesh.T[:, 0]) * np.asarray(repeat, dtype=np.float64) * size for k in (1, 2))
    det = a * d - b * c
    is_flat = np.abs(det) < 1e-300
    det = np.where(is_flat, 1.0, det)[:, None]
    along_u, along_v = (d[:, None] * e - b[:, None] * f) / det, (a[:, None] * f - c[:, None] * e) / det
    length = np.maximum(np.linalg.norm(along_u, axis=1) / cells[0], np.linalg.norm(along_v, axis=1) / cells[1])
    return np.where(is_flat, 0.0, length)


def common_level(mesh, level, size, repeat, texture_level=10):
    """Return the level of a textured mesh's map, whose roots are 1 x 1.

    level : of the light map, never gone below;  size : (W, H) of the picture

    The smallest whose texels are as fine as the picture's pixels, on average over the area, and whose charts lie
    apart; at most texture_level.
    """
    A, B, C = corners(mesh)
    area = np.linalg.norm(np.cross(B - A, C - A), axis=1)
    wide = np.minimum(pixels_per_map(mesh, np.asarray(size), repeat), 2.0**texture_level + 1)
    pixels = float(area @ wide / area.sum())
    common = max(int(level), min(int(mesh.level) - APART, texture_level))
    while common < texture_level and (1 << common) + 1 < pixels * (1 - 1e-9):
        common += 1
    return common
