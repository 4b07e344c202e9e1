"""Base textures: their average reflectance, their value at the crossings of a map, and light times texture.

Sources: equation (1) of Moeller 1996, after Cohen et al. 1986:  B_final(u, v) = B(u, v) rho(u, v) / rho_avg.

Conventions: a picture is (H, W, 3) linear RGB, row 0 = its top; `repeat` = (n, m) copies of it tile [0, 1]^2,
upright, v up. Pixel (row j, column i) covers the square of side 1/(n W) x 1/(m H) round its centre; the first tile's
centre is at u = (i + 0.5)/(n W), v = (1 - (j + 0.5)/H)/m.  A map's samples lie on crossings, u = i/(w - 1), so one is
never resized into the other: the picture is *evaluated* at crossings by a box of one map spacing or one pixel,
whichever is wider.  A box of one pixel over constant squares is bilinear interpolation of the pixel centres.  Past
the border of the domain the picture goes round where it is tiled or the surface is closed; elsewhere the box is cut
off there, which repeats the border pixel and keeps the mean.

The picture of a trimmed surface lies over the whole surface it is cut from; its box says which part of [0, 1]^2 its
own map shows.  Meshes have texture coordinates (lib.maps.mesh_texture).
"""

from __future__ import annotations

import numpy as np

from lib.maps import mesh_texture
from lib.maps.pixels import bilinear, box_means, lerp
from lib.nurbs.evaluate import evaluate_grid
from lib.nurbs.shape import is_closed
from lib.surfaces.frames import domain_of, whole
from lib.surfaces.loops import following
from lib.surfaces.measure import collapsed_sides
from lib.surfaces.mesh import Mesh
from lib.surfaces.trimmed import TrimmedSurface

CELLS = 128  # quadrature cells a direction; sphere: area element to 5e-5, and errors common to all cells cancel
PARTS, LEAST_SHARE = 4, 1 / 64  # of a cell along a trim, each way, and of its area where none of them is inside
WHOLE = (0.0, 1.0, 0.0, 1.0)  # the box of a surface that is not cut
FULL_TURN = 1e-9  # a box this near to the length 1 has it


def rho_average(surface, picture, repeat=(1, 1)):
    """Return the mean reflectance (3,) float64 of a textured surface, weighted by area: the rho its bake uses.

    surface : NurbsSurface, TrimmedSurface or Mesh with T;  picture : (H, W, 3) linear RGB in [0, 1];  repeat : tiles
    (n, m) > 0.

    Exact for constant pictures on any surface and for any picture where |S_u x S_v| is constant; else midpoint rule
    on at least CELLS^2 cells that never straddle a knot, those on the border of a trimmed surface by their share.
    """
    if isinstance(surface, Mesh):
        return mesh_texture.rho_average(surface, picture, repeat)
    low = picture.min(axis=(0, 1)).astype(np.float64)  # taken off first: a constant keeps its value to the last bit
    contrast, weight = rho_cells(surface, picture - low, repeat)
    return low + np.einsum("ji,jic->c", weight, contrast) / weight.sum()


def rho_cells(surface, picture, repeat=(1, 1)):
    """Return the cells rho_average is taken on: rho (k, l, 3) float64 and area (k, l) of each, row 0 at v = 0."""
    return _cells(surface, picture, repeat)[:2]


def means_over(surface, picture, repeat, n):
    """Return the means (n, n, 3) float64 of a picture over n x n equal boxes of the surface's map, weighted by area,
    and the area (n, n) of the surface in each; row 0 at v = 0.  Means of boxes without a part of it are 0.
    """
    if isinstance(surface, Mesh):
        return mesh_texture.means_over(surface, picture, repeat, n)
    rho, weight, edges_u, edges_v = _cells(surface, picture, repeat, np.arange(1, n) / n)
    j, i = (np.minimum((edges[1:] + edges[:-1]) / 2 * n, n - 1).astype(int) for edges in (edges_v, edges_u))
    total, area = np.zeros((n, n, 3)), np.zeros((n, n))
    np.add.at(total, (j[:, None], i), rho * weight[..., None])
    np.add.at(area, (j[:, None], i), weight)
    return np.divide(total, area[..., None], out=np.zeros_like(total), where=area[..., None] > 0), area


def _cells(surface, picture, repeat, lines=()):
    """rho and area as rho_cells gives them, and the edges of the cells along u and v; `lines` are edges in both."""
    picture = _bottom_up(picture)
    H, W, _ = picture.shape
    base, (part_u, part_v) = whole(surface), _parts(_box_of(surface))
    edges_u = _cell_edges(np.append(base.knots_u, lines), repeat[0] * W, *part_u)
    edges_v = _cell_edges(np.append(base.knots_v, lines), repeat[1] * H, *part_v)
    u, v = (edges_u[1:] + edges_u[:-1]) / 2, (edges_v[1:] + edges_v[:-1]) / 2
    _, S_u, S_v = evaluate_grid(base, u, v)
    weight = np.linalg.norm(np.cross(S_u, S_v), axis=2) * np.diff(edges_u) * np.diff(edges_v)[:, None]
    wrap_u, wrap_v = wraps(surface, repeat)
    rho = _cell_values(picture, edges_v, repeat[1], wrap_v, part_v, axis=0)
    rho = _cell_values(rho, edges_u, repeat[0], wrap_u, part_u, axis=1)
    if isinstance(surface, TrimmedSurface):

        def values(u, v):
            x, y = ((start + t * length) for t, (start, length) in ((u, part_u), (v, part_v)))
            return bilinear(picture, x * W * repeat[0], y * H * repeat[1], (wrap_u, wrap_v))

        _trim(surface, edges_u, edges_v, rho, weight, values)
    return rho, weight, edges_u, edges_v


def wraps(surface, repeat):
    """Return (bool, bool): the picture goes round at the border of u, of v; on meshes it does."""
    if isinstance(surface, Mesh):
        return True, True
    closed, (_, u1, _, v1) = is_closed(whole(surface)), _box_of(surface)
    return bool(repeat[0] > 1 or closed[0] or u1 > 1), bool(repeat[1] > 1 or closed[1] or v1 > 1)


def _box_of(surface):
    return surface.box if isinstance(surface, TrimmedSurface) else WHOLE


def _parts(box):
    """(start, length) along u and along v of a box u0, u1, v0, v1."""
    for start, end in (box[:2], box[2:]):
        length = float(end) - float(start)
        yield float(start), 1.0 if abs(length - 1) <= FULL_TURN else length


def _cell_edges(knots, n_pixels, start, length):
    """Return cell edges in [0, 1]: at every knot, at every pixel centre while these are few, at most 1/CELLS apart.

    n_pixels : over the whole surface, of which [0, 1] shows [start, start + length]
    """
    lines = [np.array([0.0, 1.0]), knots[(knots > 0) & (knots < 1)]]
    if n_pixels * length <= 2 * CELLS:
        centres = np.arange(int(np.floor(start * n_pixels)), int(np.ceil((start + length) * n_pixels))) + 0.5
        lines.append((centres / n_pixels - start) / length)
    lines = np.unique(np.concatenate(lines))
    lines = lines[(lines >= 0) & (lines <= 1)]
    parts = np.maximum(np.ceil(np.diff(lines) * CELLS - 1e-9), 1).astype(int)
    inner = [a + (b - a) * np.arange(n) / n for a, b, n in zip(lines[:-1], lines[1:], parts, strict=True)]
    return np.concatenate([*inner, [1.0]])


def _cell_values(array, edges, repeat, wrap, part, axis):
    """Return the mean over each cell: its integral where pixels are many, else the middle of a linear piece."""
    (start, length), n = part, array.shape[axis] * repeat
    if n * length > 2 * CELLS:
        return box_means(array, (start + edges[:-1] * length) * n, (start + edges[1:] * length) * n, axis)
    return lerp(array, (start + (edges[1:] + edges[:-1]) / 2 * length) * n, wrap, axis)


def _trim(surface, edges_u, edges_v, rho, weight, values):
    """Multiply the weights (k, l) of cells by their share inside the loops of a trimmed surface, in place; on its
    border take rho (k, l, 3) from the part inside, by values(u, v) of single places."""
    domain = domain_of(surface, (CELLS, CELLS))
    if domain is None:
        return
    u, v = np.meshgrid((edges_u[1:] + edges_u[:-1]) / 2, (edges_v[1:] + edges_v[:-1]) / 2)
    share = (domain.face_at(np.stack([u.ravel(), v.ravel()], axis=1)) >= 0).reshape(u.shape).astype(np.float64)
    j, i = _border_cells(surface, edges_u, edges_v)
    step = (np.arange(PARTS) + 0.5) / PARTS
    u = (edges_u[i, None, None] + step * np.diff(edges_u)[i, None, None] + np.zeros((PARTS, 1))).ravel()
    v = (edges_v[j, None, None] + step[:, None] * np.diff(edges_v)[j, None, None] + np.zeros(PARTS)).ravel()
    inside = domain.face_at(np.stack([u, v], axis=1)) >= 0
    count = inside.reshape(len(j), -1).sum(axis=1)
    total = np.where(inside[:, None], values(u, v), 0.0).reshape(len(j), -1, 3).sum(axis=1)
    some = count > 0
    rho[j[some], i[some]] = total[some] / count[some, None]
    share[j, i] = np.maximum(count / PARTS**2, LEAST_SHARE)
    weight *= share


def _border_cells(surface, edges_u, edges_v):
    """Cells (j, i) that the border of a trimmed surface passes."""
    A, B = surface.uv, surface.uv[following(surface.loop_start)]
    count = np.ceil(np.abs(B - A).max(axis=1) * CELLS * PARTS).astype(np.int64) + 1
    row = np.repeat(np.arange(len(A)), count)
    t = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)) / count[row]
    on = A[row] + t[:, None] * (B - A)[row]
    i, j = (np.searchsorted(edges[1:-1], x, side="right") for edges, x in ((edges_u, on[:, 0]), (edges_v, on[:, 1])))
    return np.divmod(np.unique(j * (len(edges_u) - 1) + i), len(edges_u) - 1)


def coordinates(surface, F, UV):
    """Where a picture lies on triangles of a surface: (m, 3, 2) of their corners, (0, 0) its lower left.

    F (m, 3), UV (n, 2) of their corners in the surface's [0, 1] x [0, 1]; not asked of a Mesh, whose own they are
    """
    if isinstance(surface, Mesh):
        return surface.T
    start, length = np.transpose(list(_parts(_box_of(surface))))
    return (start + UV * length)[F]


def on_map(surface, picture, repeat, w, h):
    """Return rho (h, w, 3) float32 of a textured surface at the crossings of its w x h map, row 0 at v = 0, and
    outside (h, w) bool: crossings no part of the surface needs, where rho is 0.

    surface : NurbsSurface, TrimmedSurface or Mesh with T and charts
    """
    if isinstance(surface, Mesh):
        return mesh_texture.evaluate(surface, picture, repeat, w, h)
    wrap, collapsed = wraps(surface, repeat), collapsed_sides(surface)
    return evaluate_picture(picture, repeat, w, h, wrap, collapsed, _box_of(surface)), np.zeros((h, w), dtype=bool)


def level_on_map(surface, roots, level, picture_size, repeat, texture_level=10):
    """Return the level of a textured surface's map (see common_level), whatever its kind."""
    if isinstance(surface, Mesh):
        return mesh_texture.common_level(surface, level, picture_size, repeat, texture_level)
    shown = [tiles * length for tiles, (_, length) in zip(repeat, _parts(_box_of(surface)), strict=True)]
    return common_level(roots, level, picture_size, shown, texture_level)


def evaluate_picture(picture, repeat, w, h, wrap=(False, False), collapsed=(False,) * 4, box=WHOLE):
    """Return rho (h, w, 3) float32 of a picture at the crossings of a w x h map, row 0 at v = 0.

    wrap : the picture goes round at the border of u, of v (see `wraps`).
    collapsed : sides u=0, u=1, v=0, v=1 that are one point; all their texels get the mean of the row they would have.
    box : u0, u1, v0, v1 of the part of the tiled [0, 1]^2 that the map shows
    """
    if w < 2 or h < 2:
        raise ValueError(f"map of {w} x {h} samples, expected at least 2 x 2")
    part_u, part_v = _parts(box)
    rho = _at_crossings(_bottom_up(picture), h, repeat[1], wrap[1], part_v, axis=0)
    rho = _at_crossings(rho, w, repeat[0], wrap[0], part_u, axis=1).astype(np.float32, copy=False)
    np.clip(rho, 0, 1, out=rho)
    if wrap[0] and part_u[1] == 1 and float(repeat[0]).is_integer():
        rho[:, -1] = rho[:, 0]
    if wrap[1] and part_v[1] == 1 and float(repeat[1]).is_integer():
        rho[-1] = rho[0]
    for side, line in enumerate((np.s_[:, 0], np.s_[:, -1], np.s_[0], np.s_[-1])):
        if collapsed[side]:
            row = rho[line].astype(np.float64)
            rho[line] = row[0] + (_trapezoid(len(row)) @ (row - row[0]))
    return rho


def _at_crossings(array, n_samples, repeat, wrap, part, axis):
    (start, length), n = part, array.shape[axis] * repeat
    spacing = n * length / (n_samples - 1)
    centre = start * n + np.arange(n_samples) * spacing
    if spacing <= 1:
        return lerp(array, centre, wrap, axis)
    low, high = centre - spacing / 2, centre + spacing / 2
    if wrap and length == 1:
        return box_means(array, low, high, axis)
    return box_means(array, np.maximum(low, start * n), np.minimum(high, (start + length) * n), axis)


def _trapezoid(n):
    weight = np.full(n, 1 / (n - 1))
    weight[[0, -1]] /= 2
    return weight


def _bottom_up(picture):
    picture = np.asarray(picture)
    if picture.ndim != 3 or picture.shape[2] != 3 or 0 in picture.shape:
        raise ValueError(f"picture: expected (H, W, 3), found {picture.shape}")
    return picture[::-1]


def common_level(roots, level, picture_size, repeat, texture_level=10):
    """Return the smallest level whose map holds both the light and every pixel of all tiles, at most texture_level.

    roots : [n_u, n_v];  level : of the light map, never gone below;  picture_size : (W, H).
    """
    common = int(level)
    while common < texture_level and any(
        (int(n) << common) + 1 < size * tiles for n, size, tiles in zip(roots, picture_size, repeat, strict=True)
    ):
        common += 1
    return common


def upsample(value, hidden, levels):
    """Interpolate a map bilinearly onto the grid `levels` deeper; samples on shared crossings keep their bits.

    value (h, w, ...) float32, hidden (h, w) bool. Hidden samples take no part; a new sample is hidden if all the
    samples it would come from are. Returns (value, hidden); hidden values are 0.
    """
    factor = 1 << int(levels)
    seen = (~hidden).reshape(hidden.shape + (1,) * (value.ndim - 2))
    if factor == 1:
        return np.where(seen, value, np.float32(0)), hidden.copy()
    if not hidden.any():
        fine = _stretch(_stretch(value, factor, 0), factor, 1)
        return fine, np.zeros(fine.shape[:2], bool)
    share = _stretch(_stretch(seen.astype(np.float32), factor, 0), factor, 1)
    fine = _stretch(_stretch(np.where(seen, value, np.float32(0)), factor, 0), factor, 1)
    fine = np.divide(fine, share, out=np.zeros_like(fine), where=share > 0)
    return fine, share.reshape(fine.shape[:2]) == 0


def _stretch(array, factor, axis):
    array = np.moveaxis(array, axis, 0)
    n = len(array)
    fine = np.empty(((n - 1) * factor + 1, *array.shape[1:]), array.dtype)
    step = (array[1:] - array[:-1]) / array.dtype.type(factor)
    for k in range(factor):
        fine[k:-1:factor] = array[:-1] + array.dtype.type(k) * step
    fine[-1] = array[-1]
    return np.moveaxis(fine, 0, axis)


def reflected(H, rho_avg):
    """Return B = rho_avg H, the reflected radiosity an illumination map stores; H (..., 3), rho_avg (3,)."""
    return (np.asarray(H) * np.asarray(rho_avg)).astype(np.float32)


def apply(B, rho, rho_avg):
    """Return B_final = B rho / rho_avg (h, w, 3) float32, the light on the base texture (equation 1).

    B, rho : (h, w, 3) on the same crossings;  rho_avg : (3,). A channel with rho_avg = 0 has rho = 0 everywhere and
    gets 0.
    """
    rho_avg = np.asarray(rho_avg, np.float64)
    factor = np.divide(1, rho_avg, out=np.zeros(3), where=rho_avg > 0)
    ratio = rho * np.tile(factor.astype(np.float32), (rho.shape[1], 1))  # a whole row at once, not three numbers
    return np.multiply(B, ratio, out=ratio)
