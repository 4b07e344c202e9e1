"""Charts of a mesh: its triangles laid out flat in a square map, without overlap.  The one importer of xatlas.

xatlas cuts the mesh into pieces and flattens those that are not plane; plane ones are laid out here, without
distortion.  It then packs them, each stretched up to whole cells (so none is narrower than a cell, and sides of
rectangles lie on crossings of the map's lattice).  Measured with xatlas 0.0.11: `padding` p keeps charts 2 p + 0.75
cells apart, none at the border; the same input gives the same bytes, on any number of threads.

Lengths are scaled so that the mesh's area is AREA before xatlas sees them: it works in float32 and ignores triangles
below 1e-7, whatever their unit.
"""

from dataclasses import replace

import numpy as np
import xatlas

from lib.surfaces.loops import double_area
from lib.surfaces.mesh_build import normals_areas
from lib.surfaces.pieces import pieces

PADDING = 4  # cells of the finest level between charts, and from the border: one cell two levels coarser
LEAST_LEVEL, MOST_LEVEL = 3, 11
AREA = 1e6
MOST_CELLS = 8192  # a side, of a packing that is not kept
TRIALS = 4  # packings until the map is nearly full
MOST_COARSER = 1.5  # times the wanted edge of a cell; a larger map is taken before that
MOST_STRETCH = 3.0  # of the mesh's own texture coordinates, between any two directions or places of a chart ...
BAD_SHARE = 0.01  # ... but for this share of the area
SHORT = 0.01  # side that a triangle in a chart of its own is given at least
MOST_DRAWN = 10.0  # how often longer a triangle laid flat with others may get
LEAST_SHARE = 0.01  # of its area that a triangle keeps when laid flat with others
SMALL = 1e-5  # area the largest triangle of a chart is given at least; xatlas ignores what is below 1e-7


def charted(mesh, texel):
    """The mesh with charts.

    mesh : Mesh;  texel : wanted edge of a cell of the map's finest level, in the mesh's unit
    Returns Mesh with uv, chart and level.  Cells come out within a factor MOST_COARSER of `texel`; larger where the map
    would need more than 2^MOST_LEVEL cells a side, smaller where it fits in 2^LEAST_LEVEL.

    Raises ValueError `charts: ...` where the charts do not fit, however small.
    """
    unit = _unit(mesh)
    flat, chart = _cut(mesh, unit)
    index = np.unique(chart[:, None] * len(mesh.V) + mesh.F, return_inverse=True)[1].reshape(-1, 3)
    return _packed(mesh, flat, index, chart, texel / unit)


def own_charts(mesh, texel):
    """As charted, with pieces and shapes of the mesh's own texture coordinates; None where those do not serve.

    They serve if no piece is folded over, overlaps itself or is stretched by more than MOST_STRETCH (but for
    BAD_SHARE).  Where the pieces lie does not matter: they are packed anew.
    """
    if mesh.T is None:
        return None
    unit = _unit(mesh)
    index, chart = _pieces(mesh)
    flat = mesh.T.astype(np.float64)
    flat = flat - flat.reshape(-1, 2).min(axis=0)
    signed = _signed_areas(flat)
    sign = np.sign(np.bincount(chart, signed))
    if (signed * sign[chart] <= 0).any():
        return None
    flat = flat * np.stack([sign, np.ones_like(sign)], axis=1)[chart][:, None]
    area = normals_areas(mesh.V, mesh.F)[1] / unit**2
    flat = flat * np.sqrt(np.bincount(chart, area) / np.bincount(chart, np.abs(signed)))[chart][:, None, None]
    low, high = stretch(mesh.V / unit, mesh.F, flat)
    bad = (low < 1 / MOST_STRETCH) | (high > MOST_STRETCH) | (high > MOST_STRETCH * low)
    if area[bad].sum() > BAD_SHARE * area.sum():
        return None
    made = _packed(mesh, flat, index, chart, texel / unit)
    return None if overlap(made) > 0 else made


def stretch(V, F, flat):
    """Least and largest scale (m,), (m,) of the maps from triangles in space to flat (m, 3, 2)."""
    a, b = V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]
    length = np.linalg.norm(a, axis=1)
    along = np.einsum("ij,ij->i", a, b) / length
    height = np.linalg.norm(np.cross(a, b), axis=1) / length
    J = np.empty((len(F), 2, 2))
    J[:, :, 0] = (flat[:, 1] - flat[:, 0]) / length[:, None]
    J[:, :, 1] = (flat[:, 2] - flat[:, 0] - J[:, :, 0] * along[:, None]) / height[:, None]
    values = np.linalg.svd(J, compute_uv=False)
    return values[:, 1], values[:, 0]


def overlap(mesh, side=1024):
    """Share of a charted map's points, side x side, that lie inside of two triangles."""
    hits = np.zeros(side * side, dtype=np.uint8)
    corners = mesh.uv * side
    low = np.ceil(corners.min(axis=1) - 0.5).astype(np.int64)
    high = np.floor(corners.max(axis=1) - 0.5).astype(np.int64)
    width, height = (np.maximum(high - low + 1, 0)).T
    # Test the points in the boxes of some triangles at once.
    for part in np.array_split(np.arange(len(corners)), 1 + int((width * height).sum() // 4_000_000)):
        count = width[part] * height[part]
        which = np.repeat(part, count)
        k = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        x, y = low[which, 0] + k % width[which], low[which, 1] + k // width[which]
        inside = np.ones(len(which), dtype=bool)
        c = corners[which]
        for j in range(3):
            p, q = c[:, j], c[:, (j + 1) % 3]
            turn = (q[:, 0] - p[:, 0]) * (y + 0.5 - p[:, 1]) - (q[:, 1] - p[:, 1]) * (x + 0.5 - p[:, 0])
            inside &= turn > 1e-6 * side  # a little inside: neighbours share edges
        np.add.at(hits, (y * side + x)[inside], 1)
    return np.count_nonzero(hits > 1) / max(np.count_nonzero(hits), 1)


def _unit(mesh):
    """Length to divide by for a total area of AREA."""
    area = float(normals_areas(mesh.V, mesh.F)[1].sum())
    if not area > 0:
        raise ValueError("charts: the mesh has no area")
    return float(np.sqrt(area / AREA))


def _pieces(mesh):
    """Corners as numbers (m, 3), equal where position and texture coordinates are, and the piece (m,) of triangles
    that hang together by them.
    """
    rows = np.concatenate([mesh.F.reshape(-1, 1).astype(np.float64), mesh.T.reshape(-1, 2)], axis=1)
    index = np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1, 3)
    n, m = int(index.max()) + 1, len(index)
    return index, pieces(m + n, np.repeat(np.arange(m), 3), m + index.ravel())[:m]


def _cut(mesh, unit):
    """Flattened corners (m, 3, 2) in units of `unit`, chart by chart, and the chart (m,) of each triangle."""
    V = (mesh.V - (mesh.V.min(axis=0) + mesh.V.max(axis=0)) / 2) / unit
    atlas = xatlas.Atlas()
    atlas.add_mesh(V.astype(np.float32), mesh.F.astype(np.uint32))
    cutting, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    cutting.max_iterations = 1
    packing.texels_per_unit, packing.padding = min(1.0, MOST_CELLS / np.ptp(V, axis=0).max()), 0
    atlas.generate(cutting, packing)
    _, index, uv = atlas.get_mesh(0)
    flat = (uv.astype(np.float64) * (atlas.width, atlas.height))[index]
    chart, plane = np.full(len(mesh.F), -1, dtype=np.int64), np.zeros(atlas.get_mesh_chart_count(0), dtype=bool)
    for k in range(len(plane)):
        piece = atlas.get_mesh_chart(0, k)
        chart[np.asarray(piece.faces)] = k
        plane[k] = piece.type == xatlas.ChartType.Planar
    true, n = normals_areas(V, mesh.F)[1], len(plane)
    known = chart >= 0
    flat = np.where(plane[chart][:, None, None], _projected(V, mesh.F, np.maximum(chart, 0), n), flat)
    signed = _signed_areas(flat)
    sign, area, real = (np.bincount(chart[known], x[known], n) for x in (signed, np.abs(signed), true))
    scale = np.where(plane, 1.0, np.sqrt(real / np.maximum(area, 1e-300)))
    flat *= np.minimum(scale, 1e6)[chart][:, None, None]
    # Triangles that xatlas ignores, lays on a line or upside down, draws out or leaves alone get charts of their own.
    good = known & (_signed_areas(flat) * np.sign(sign)[chart] > LEAST_SHARE * true)
    good &= (stretch(V, mesh.F, flat)[1] < MOST_DRAWN) & (np.bincount(chart[known], minlength=n)[chart] > 1)
    lost = np.flatnonzero(~good)
    flat[lost], chart[lost] = _alone(V, mesh.F[lost]), n + np.arange(len(lost))
    return flat, np.unique(chart, return_inverse=True)[1]


def _alone(V, F):
    """Corners (m, 3, 2) of triangles laid flat one by one, slivers a little wider than they are."""
    a, b = V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]
    length = np.linalg.norm(a, axis=1)
    unit = a / length[:, None]
    along = np.einsum("ij,ij->i", b, unit)
    height = np.linalg.norm(b - along[:, None] * unit, axis=1)
    flat = np.zeros((len(F), 3, 2))
    flat[:, 1, 0], flat[:, 2, 0] = np.maximum(length, SHORT), along
    flat[:, 2, 1] = np.maximum(height, 4 * SMALL / flat[:, 1, 0])
    return flat


def _projected(V, F, chart, n):
    """Corners (m, 3, 2) of triangles seen along the mean normal of their chart."""
    normal, area = normals_areas(V, F)
    N = np.stack([np.bincount(chart, area * normal[:, k], n) for k in range(3)], axis=1)
    N /= np.maximum(np.linalg.norm(N, axis=1), 1e-300)[:, None]
    # x: the longest edge of each chart.
    edges = np.stack([V[F[:, (k + 1) % 3]] - V[F[:, k]] for k in range(3)], axis=1)
    length = np.linalg.norm(edges, axis=2)
    order = np.lexsort((-length.max(axis=1), chart))
    first = order[np.searchsorted(chart[order], np.arange(n))]
    x = edges[first, length[first].argmax(axis=1)]
    x = x - np.einsum("ij,ij->i", x, N)[:, None] * N
    x /= np.maximum(np.linalg.norm(x, axis=1), 1e-300)[:, None]
    y = np.cross(N, x)
    at = V[F] - V[F[first, 0]][chart][:, None]
    return np.stack([np.einsum("ijk,ik->ij", at, axis[chart]) for axis in (x, y)], axis=2)


def _packed(mesh, flat, index, chart, texel):
    """Mesh with its charts in the smallest map near the wanted size of cells.

    flat : (m, 3, 2) corners;  index : (m, 3) numbers of the corners, equal where the points are;  texel : in its unit
    """
    if not (np.isfinite(texel) and texel > 0):
        raise ValueError(f"charts: a cell of {texel}")
    n = int(chart.max()) + 1
    largest = np.zeros(n)
    np.maximum.at(largest, chart, np.abs(_signed_areas(flat)))
    flat = flat * np.sqrt(np.maximum(SMALL / largest, 1.0))[chart][:, None, None]
    points = np.empty((int(index.max()) + 1, 2))
    points[index.ravel()[::-1]] = flat.reshape(-1, 2)[::-1]  # the first of each counts
    low, high = _boxes(flat, chart, n)
    most = min(2**MOST_LEVEL / np.sqrt(AREA), 2**MOST_LEVEL / (high - low).max())  # beyond, it can not fit
    density = min(1 / texel, 1.5 * most)
    tried, level = [], None
    for _ in range(TRIALS):
        corners = _pack(points, index, chart, n, density)
        tried.append((density, float(corners.max()) + 2 * PADDING, corners))
        if level is None:
            level = int(np.clip(np.round(np.log2(tried[0][1])), LEAST_LEVEL, MOST_LEVEL))
        density = _next_density(tried, 2**level)
        if density is None:
            break
    if min(need for _, need, _ in tried) > 2**level:  # the space between charts alone is wider than that
        level += 1
    fitting = [trial for trial in tried if trial[1] <= 2**level]
    if level > MOST_LEVEL or not fitting:
        raise ValueError(f"charts: {n} charts do not fit in a map of {2**MOST_LEVEL} x {2**MOST_LEVEL} cells")
    corners = max(fitting, key=lambda trial: trial[0])[2]
    uv = (corners + PADDING) / 2**level
    return replace(mesh, uv=uv, chart=chart.astype(np.int32), level=level)


def _next_density(tried, room):
    """Cells per unit to try next, for a map of `room`, from those tried with what they needed; None if that is full."""
    fits = max((trial[:2] for trial in tried if trial[1] <= room), default=(0.0, 0.0))
    over = min((trial[:2] for trial in tried if trial[1] > room), default=(np.inf, np.inf))
    if fits[1] > 0.9 * room or over[0] < 1.02 * fits[0]:
        return None
    if not fits[0]:
        low, (first, *_) = 2 * PADDING, tried[0]
        if len(tried) > 1 and tried[-1][1] < tried[-2][1]:  # much of it is the space between charts
            slope = (tried[-2][1] - tried[-1][1]) / (tried[-2][0] - tried[-1][0])
            density = max(over[0] - (over[1] - 0.98 * room) / slope, 0.25 * over[0])
            return density if density * MOST_COARSER > first or room == 2**MOST_LEVEL else None
        return over[0] * max(0.97 * (room - low) / (over[1] - low), 0.25)
    if over[0] == np.inf:
        if len(tried) > 1 and tried[-1][1] > tried[-2][1]:  # much of it is the space between charts: a line
            slope = (tried[-1][1] - tried[-2][1]) / (tried[-1][0] - tried[-2][0])
            return min(fits[0] + (0.96 * room - fits[1]) / slope, 8 * fits[0])
        return fits[0] * min(0.98 * room / fits[1], 8.0)
    return fits[0] + (over[0] - fits[0]) * (0.97 * room - fits[1]) / (over[1] - fits[1])


def _pack(points, index, chart, n, density):
    """Corners (m, 3, 2) in cells of the packed charts; the least is 0."""
    atlas = xatlas.Atlas()
    atlas.add_uv_mesh(points.astype(np.float32), index.astype(np.uint32), chart.astype(np.uint32)[:, None])
    packing = xatlas.PackOptions()
    packing.texels_per_unit, packing.padding = float(density), PADDING // 2
    atlas.generate(xatlas.ChartOptions(), packing)
    _, placed, uv = atlas.get_mesh(0)
    corners = (uv.astype(np.float64) * (atlas.width, atlas.height))[placed]
    is_placed = np.zeros(len(index), dtype=bool)
    for k in range(atlas.get_mesh_chart_count(0)):
        is_placed[np.asarray(atlas.get_mesh_chart(0, k).faces)] = True
    corners = _moved(points[index], corners, np.where(is_placed, chart, n), chart, n)
    # Charts are stretched to whole cells; the box of each comes out within float32 of them.
    low, high = _boxes(corners, chart, n)
    low_whole = np.round(low - 0.5)
    size_whole = np.maximum(np.round(high - 0.5) - low_whole, 1.0)
    size = np.where(high > low, high - low, 1.0)
    corners = (corners - low[chart][:, None]) / size[chart][:, None] * size_whole[chart][:, None]
    corners += low_whole[chart][:, None]
    return corners - corners.min(axis=(0, 1))


def _moved(flat, corners, placed, chart, n):
    """The corners `flat` moved by the affine map of each chart that fits best where xatlas has put it: in float64, and
    for the triangles that it ignores too.

    placed : chart of a triangle, or n of one that was ignored
    """
    who = np.repeat(placed, 3)
    a, b = flat.reshape(-1, 2), corners.reshape(-1, 2)
    count = np.maximum(np.bincount(who, minlength=n + 1)[:n], 1)

    def mean(x):
        return np.bincount(who, x, n + 1)[:n] / count

    mean_a, mean_b = (np.stack([mean(p[:, 0]), mean(p[:, 1])], axis=1) for p in (a, b))
    known = who < n
    da, db = np.zeros_like(a), np.zeros_like(b)
    da[known], db[known] = a[known] - mean_a[who[known]], b[known] - mean_b[who[known]]
    A = np.stack([mean(da[:, i] * da[:, j]) for i in (0, 1) for j in (0, 1)], axis=1).reshape(n, 2, 2)
    B = np.stack([mean(da[:, i] * db[:, j]) for i in (0, 1) for j in (0, 1)], axis=1).reshape(n, 2, 2)
    M = np.linalg.solve(A, B)
    return np.einsum("ijk,ikl->ijl", flat - mean_a[chart][:, None], M[chart]) + mean_b[chart][:, None]


def _boxes(flat, chart, n):
    """Least and largest coordinates of each chart: (n, 2), (n, 2)."""
    low, high = np.full((n, 2), np.inf), np.full((n, 2), -np.inf)
    np.minimum.at(low, chart, flat.min(axis=1))
    np.maximum.at(high, chart, flat.max(axis=1))
    return low, high


def _signed_areas(flat):
    return double_area(*flat.swapaxes(0, 1)) / 2
