"""Base textures: their average reflectance, their value at the crossings of a map, and light times texture.

Sources: equation (1) of Moeller 1996, after Cohen et al. 1986:  B_final(u, v) = B(u, v) rho(u, v) / rho_avg.

Conventions: a picture is (H, W, 3) linear RGB, row 0 = its top; `repeat` = (n, m) copies of it tile [0, 1]^2,
upright, v up. Pixel (row j, column i) covers the square of side 1/(n W) x 1/(m H) round its centre; the first tile's
centre is at u = (i + 0.5)/(n W), v = (1 - (j + 0.5)/H)/m.  A map's samples lie on crossings, u = i/(w - 1), so one is
never resized into the other: the picture is *evaluated* at crossings by a box of one map spacing or one pixel,
whichever is wider.  A box of one pixel over constant squares is bilinear interpolation of the pixel centres.  Past
the border of the domain the picture goes round where it is tiled or the surface is closed; elsewhere the box is cut
off there, which repeats the border pixel and keeps the mean.
"""

from __future__ import annotations

import numpy as np

from lib.nurbs.evaluate import evaluate_grid
from lib.nurbs.shape import is_closed

CELLS = 128  # quadrature cells a direction; sphere: area element to 5e-5, and errors common to all cells cancel
MAX_TAPS = 16  # pixels under one box up to which adding them up is quicker than running sums


def rho_average(surface, picture, repeat=(1, 1)):
    """Return the mean reflectance (3,) float64 of a textured surface, weighted by area: the rho its bake uses.

    surface : NurbsSurface;  picture : (H, W, 3) linear RGB in [0, 1];  repeat : tiles (n, m) > 0.

    Exact for constant pictures on any surface and for any picture where |S_u x S_v| is constant; else midpoint rule
    on at least CELLS^2 cells that never straddle a knot.
    """
    low = picture.min(axis=(0, 1)).astype(np.float64)  # taken off first: a constant keeps its value to the last bit
    contrast, weight = rho_cells(surface, picture - low, repeat)
    return low + np.einsum("ji,jic->c", weight, contrast) / weight.sum()


def rho_cells(surface, picture, repeat=(1, 1)):
    """Return the cells rho_average is taken on: rho (k, l, 3) float64 and area (k, l) of each, row 0 at v = 0."""
    picture = _bottom_up(picture)
    H, W, _ = picture.shape
    edges_u = _cell_edges(surface.knots_u, repeat[0] * W)
    edges_v = _cell_edges(surface.knots_v, repeat[1] * H)
    u, v = (edges_u[1:] + edges_u[:-1]) / 2, (edges_v[1:] + edges_v[:-1]) / 2
    _, S_u, S_v = evaluate_grid(surface, u, v)
    weight = np.linalg.norm(np.cross(S_u, S_v), axis=2) * np.diff(edges_u) * np.diff(edges_v)[:, None]
    wrap_u, wrap_v = wraps(surface, repeat)
    rho = _cell_values(picture, edges_v, repeat[1], wrap_v, axis=0)
    return _cell_values(rho, edges_u, repeat[0], wrap_u, axis=1), weight


def wraps(surface, repeat):
    """Return (bool, bool): the picture goes round at the border of u, of v."""
    closed = is_closed(surface)
    return repeat[0] > 1 or closed[0], repeat[1] > 1 or closed[1]


def _cell_edges(knots, n_pixels):
    """Return cell edges in [0, 1]: at every knot, at every pixel centre while these are few, at most 1/CELLS apart."""
    lines = [np.array([0.0, 1.0]), knots[(knots > 0) & (knots < 1)]]
    if n_pixels <= 2 * CELLS:
        lines.append((np.arange(int(np.ceil(n_pixels))) + 0.5) / n_pixels)
    lines = np.unique(np.concatenate(lines))
    lines = lines[(lines >= 0) & (lines <= 1)]
    parts = np.maximum(np.ceil(np.diff(lines) * CELLS - 1e-9), 1).astype(int)
    inner = [a + (b - a) * np.arange(n) / n for a, b, n in zip(lines[:-1], lines[1:], parts, strict=True)]
    return np.concatenate([*inner, [1.0]])


def _cell_values(array, edges, repeat, wrap, axis):
    """Return the mean over each cell: its integral where pixels are many, else the middle of a linear piece."""
    n = array.shape[axis] * repeat
    if n > 2 * CELLS:
        return _box(array, edges[:-1] * n, edges[1:] * n, axis)
    return _lerp(array, (edges[1:] + edges[:-1]) / 2 * n, wrap, axis)


def evaluate_picture(picture, repeat, w, h, wrap=(False, False), collapsed=(False,) * 4):
    """Return rho (h, w, 3) float32 of a picture at the crossings of a w x h map, row 0 at v = 0.

    wrap : the picture goes round at the border of u, of v (see `wraps`).
    collapsed : sides u=0, u=1, v=0, v=1 that are one point; all their texels get the mean of the row they would have.
    """
    if w < 2 or h < 2:
        raise ValueError(f"map of {w} x {h} samples, expected at least 2 x 2")
    rho = _at_crossings(_bottom_up(picture), h, repeat[1], wrap[1], axis=0)
    rho = _at_crossings(rho, w, repeat[0], wrap[0], axis=1).astype(np.float32, copy=False)
    np.clip(rho, 0, 1, out=rho)
    if wrap[0] and float(repeat[0]).is_integer():
        rho[:, -1] = rho[:, 0]
    if wrap[1] and float(repeat[1]).is_integer():
        rho[-1] = rho[0]
    for side, line in enumerate((np.s_[:, 0], np.s_[:, -1], np.s_[0], np.s_[-1])):
        if collapsed[side]:
            row = rho[line].astype(np.float64)
            rho[line] = row[0] + (_trapezoid(len(row)) @ (row - row[0]))
    return rho


def _at_crossings(array, n_samples, repeat, wrap, axis):
    n = array.shape[axis] * repeat
    centre = np.arange(n_samples) * (n / (n_samples - 1))
    spacing = n / (n_samples - 1)
    if spacing <= 1:
        return _lerp(array, centre, wrap, axis)
    low, high = centre - spacing / 2, centre + spacing / 2
    return _box(array, low, high, axis) if wrap else _box(array, np.maximum(low, 0), np.minimum(high, n), axis)


def _trapezoid(n):
    weight = np.full(n, 1 / (n - 1))
    weight[[0, -1]] /= 2
    return weight


def _lerp(array, at, wrap, axis):
    """Interpolate pixel centres (index + 0.5) linearly at `at` [pixels]; periodic, or clamped at the first and last."""
    n = array.shape[axis]
    at = at - 0.5
    low = np.floor(at).astype(int)
    t = (at - low).astype(array.dtype).reshape([-1 if k == axis else 1 for k in range(array.ndim)])
    if wrap:
        low, high = low % n, (low + 1) % n
    else:
        low, high = np.clip(low, 0, n - 1), np.clip(low + 1, 0, n - 1)
    first = np.take(array, low, axis)
    step = np.take(array, high, axis)
    step -= first
    step *= t
    return np.add(first, step, out=step)


def _box(array, low, high, axis):
    """Return means over the intervals [low, high] [pixels] of a picture of constant squares, periodic."""
    first = np.floor(low).astype(int)
    n_taps = int((np.ceil(high) - first).max())
    return _by_taps(array, low, high, first, n_taps, axis) if n_taps <= MAX_TAPS else _by_sums(array, low, high, axis)


def _by_taps(array, low, high, first, n_taps, axis):
    """Add up the pixels an interval touches, each by its share; float32 stays float32."""
    shape = [-1 if k == axis else 1 for k in range(array.ndim)]
    total = 0
    for k in (first + tap for tap in range(n_taps)):
        share = np.maximum(np.minimum(high, k + 1) - np.maximum(low, k), 0) / (high - low)
        part = np.take(array, k % array.shape[axis], axis)
        part *= share.astype(array.dtype).reshape(shape)
        total += part
    return total


def _by_sums(array, low, high, axis):
    """Subtract running sums (float64): the cost does not grow with the length of the intervals."""
    array = np.moveaxis(array, axis, 0)
    columns = (-1,) + (1,) * (array.ndim - 1)
    total = np.zeros((len(array) + 1, *array.shape[1:]))
    np.cumsum(array, axis=0, dtype=np.float64, out=total[1:])

    def integral(x):
        whole = np.floor(x).astype(int)
        turns, k = np.divmod(whole, len(array))
        return total[k] + turns.reshape(columns) * total[-1] + (x - whole).reshape(columns) * array[k]

    return np.moveaxis((integral(high) - integral(low)) / (high - low).reshape(columns), 0, axis)


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
    ratio = rho * factor.astype(np.float32)
    return np.multiply(B, ratio, out=ratio)
