"""One surface cut along lines into triangles, with its measured distance from them.

Every cell of the tensor grid gives two triangles, divided by the diagonal that lies closer to the surface.  Along a
pole a cell gives one: each has a vertex of its own there, at the u (or v) of its middle, so that texture coordinates
interpolate as they should.
Distances are taken between exact points, sampled in each cell, and the facet at the same parameters: `distance` is
measured perpendicular to the facet, and on open sides perpendicular to the edge (what an eye or a ray sees); `slide` is
the whole vector, with what a texture moves inside the surface.
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs import facet_kernels as kernels
from lib.nurbs.evaluate import evaluate_grid
from lib.nurbs.lines import unit

STEPS = 4  # samples per cell and direction; quarters, because the middle of a coarse wave may lie on its chord
FEW = 100  # cells; a surface cut into more is smooth inside them, and edge and facet middles show the distance
FLAT = 1e-12  # a triangle of less area than this share of its longest edge squared has none


@dataclass(frozen=True)
class Patch:
    """Triangles of one surface; geometric normals point along S_u x S_v.

    S (k, 3), UV (k, 2)  vertices and their parameters; F (m, 3) int64
    side : four int arrays, the vertices along u=0, u=1, v=0, v=1 with the parameter ascending; a pole's side holds
    its vertices
    distance : largest distance [unit of the surface]; square : its mean square, weighted by area; slide : largest slide
    area : of the triangles
    """

    S: np.ndarray
    UV: np.ndarray
    F: np.ndarray
    side: tuple
    distance: float
    square: float
    slide: float
    area: float


def chord_errors(surface, u, v, is_closed, is_collapsed):
    """Largest distance of the curves of a surface from their chords: along u, each step of u (m,), and along v (k,).

    Inside the surface only what leaves it counts; on open sides all that leaves the chord.
    """
    S, S_u, S_v = evaluate_grid(surface, _finer(u, STEPS), _finer(v, STEPS))
    normal = unit(np.cross(S_u, S_v))
    is_open = [not (is_closed[k // 2] or is_collapsed[k]) for k in range(4)]
    along_u = _chords(S, normal, is_open[2:])
    return along_u, _chords(S.swapaxes(0, 1), normal.swapaxes(0, 1), is_open[:2])


def _chords(S, normal, is_open):
    """Largest error of each chord along the second axis of S (k, m STEPS + 1, 3): (m,)."""
    start = S[:, :-1:STEPS, None]
    along = np.diff(S[:, ::STEPS], axis=1)[:, :, None]
    shape = (*along.shape[:2], STEPS, 3)
    off = S[:, :-1].reshape(shape) - start
    off = off - np.arange(STEPS)[:, None] / STEPS * along
    height = np.abs((off * normal[:, :-1].reshape(shape)).sum(axis=3))
    for end, whole in zip((0, -1), is_open, strict=True):
        if whole:
            height[end] = np.maximum(height[end], _from_chords(S[end], STEPS))
    return height.max(axis=(0, 2))


def _finer(lines, steps):
    """The lines with steps - 1 equal steps put between."""
    t = np.arange(steps) / steps
    return np.append((lines[:-1, None] + np.diff(lines)[:, None] * t).ravel(), lines[-1])


def triangulate(surface, u, v, is_closed, is_collapsed):
    """Cut a surface along its lines u, v (ascending, 0 and 1 among them).

    is_closed (2,), is_collapsed (4,) as lib.nurbs.shape says.
    """
    steps = STEPS if (len(u) - 1) * (len(v) - 1) <= FEW else 2
    fine = evaluate_grid(surface, _finer(u, steps), _finer(v, steps))[0]
    S = fine[::steps, ::steps]
    cells = _cells(fine, steps)
    corner = (S[:-1, :-1], S[:-1, 1:], S[1:, 1:], S[1:, :-1])  # 00, 10, 11, 01
    is_falling = _diagonal(corner, cells[..., steps // 2, steps // 2, :])
    distance, square, slide, area = _distances(cells, corner, is_falling, is_collapsed)
    open_sides = [k for k in range(4) if not (is_closed[k // 2] or is_collapsed[k])]
    side_distance = max([_side_distance(fine, k, steps) for k in open_sides], default=0.0)
    points, parameters, F, side = _mesh(S, u, v, is_falling, is_collapsed)
    return Patch(points, parameters, F, side, max(distance, side_distance), square, slide, area)


def _cells(fine, steps):
    """Samples by cell, borders included: (n_v, n_u, steps + 1, steps + 1, 3), [.., v, u, :]."""
    window = np.lib.stride_tricks.sliding_window_view(fine, (steps + 1, steps + 1), axis=(0, 1))
    return np.moveaxis(window[::steps, ::steps], 2, -1)


def _diagonal(corner, middle):
    """True where the diagonal 10-01 is closer to the surface than 00-11, which is kept when they tie."""
    S00, S10, S11, S01 = corner
    rising = np.linalg.norm(middle - (S00 + S11) / 2, axis=-1)
    falling = np.linalg.norm(middle - (S10 + S01) / 2, axis=-1)
    return falling < rising * (1 - 1e-6) - 1e-9 * np.linalg.norm(S11 - S00, axis=-1)


def _distances(cells, corner, is_falling, is_collapsed):
    """(largest distance, mean square, largest slide, area) of the cells' samples to their triangles."""
    S00, S10, S11, S01 = corner
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 1.0, cells.shape[2])])  # u and v inside the cell
    flip = is_falling[..., None]
    # as if every diagonal rose: mirrored cells swap their left and right corners
    A, B = np.where(flip, S10, S00), np.where(flip, S00, S10)
    C, D = np.where(flip, S01, S11), np.where(flip, S11, S01)
    samples = np.where(is_falling[..., None, None, None], cells[..., ::-1, :], cells)
    weights = np.stack([1 - np.maximum(x, y), np.maximum(x - y, 0), np.minimum(x, y), np.maximum(y - x, 0)], axis=-1)
    facet = np.einsum("vuk,jick->jivuc", weights, np.stack([A, B, C, D], axis=-1))
    off = samples - facet
    below, area_below = normals(A, B, C)
    above, area_above = normals(A, C, D)
    _along_poles(below, area_below, above, area_above, is_collapsed)
    height = np.where(x > y, np.einsum("jivuc,jic->jivu", off, below), np.einsum("jivuc,jic->jivu", off, above))
    cell_area = area_below + area_above
    total = max(float(cell_area.sum()), 1e-300)
    square = float((cell_area * (height**2).mean(axis=(2, 3))).sum()) / total
    return float(np.abs(height).max()), square, float(np.linalg.norm(off, axis=-1).max()), float(cell_area.sum())


def normals(A, B, C):
    """Unit normals (..., 3), zero where there is no area, and areas (...) of triangles."""
    cross = np.cross(B - A, C - A)
    double = np.linalg.norm(cross, axis=-1)
    return cross / np.maximum(double, 1e-300)[..., None], double / 2


def _along_poles(below, area_below, above, area_above, is_collapsed):
    """Along a collapsed side one triangle stands for the whole cell: give its plane to both halves."""
    for k, cells in enumerate([np.s_[:, 0], np.s_[:, -1], np.s_[0], np.s_[-1]]):
        if is_collapsed[k]:
            larger = (area_below[cells] > area_above[cells])[..., None]
            below[cells] = above[cells] = np.where(larger, below[cells], above[cells])


def _side_distance(fine, k, steps):
    """Largest distance of side k's samples from its edges."""
    return float(_from_chords((fine[:, 0], fine[:, -1], fine[0], fine[-1])[k], steps).max())


def _from_chords(line, steps):
    """Distances (m, steps) of the samples of a line (m steps + 1, 3) from the chords over `steps` of them."""
    along = np.diff(line[::steps], axis=0)[:, None]
    off = line[:-1].reshape(-1, steps, 3) - line[:-1:steps, None]
    square = np.maximum((along**2).sum(axis=2), 1e-300)
    t = np.clip((off * along).sum(axis=2) / square, 0.0, 1.0)  # a hairpin leaves its short chord lengthways
    return np.linalg.norm(off - t[..., None] * along, axis=2)


def _mesh(S, u, v, is_falling, is_collapsed):
    """Vertices, parameters, triangles and sides of the grid S (n_v + 1, n_u + 1, 3)."""
    rows, columns = S.shape[:2]
    uu, vv = np.meshgrid(u, v)
    points, parameters = [S.reshape(-1, 3)], [np.stack([uu, vv], axis=-1).reshape(-1, 2)]
    G = np.arange(rows * columns).reshape(rows, columns)
    c00, c10, c11, c01 = G[:-1, :-1].copy(), G[:-1, 1:].copy(), G[1:, 1:].copy(), G[1:, :-1].copy()
    side = [G[:, 0].copy(), G[:, -1].copy(), G[0].copy(), G[-1].copy()]
    n = G.size
    ends = ((c00, c01), (c10, c11), (c00, c10), (c01, c11))
    for k in np.flatnonzero(is_collapsed):
        lines = v if k < 2 else u
        middle = (lines[:-1] + lines[1:]) / 2
        pole = np.arange(n, n + middle.size)
        n += middle.size
        strip = np.s_[:, -(k % 2)] if k < 2 else np.s_[-(k % 2)]
        for c in ends[k]:
            c[strip] = pole
        points.append(np.repeat(S[0, 0][None] if k in (0, 2) else S[-1, -1][None], middle.size, axis=0))
        at = np.full_like(middle, float(k % 2))
        parameters.append(np.stack([at, middle] if k < 2 else [middle, at], axis=1))
        side[k] = pole
        for other in range(4):  # the corners of the neighbouring sides lie on the pole now
            if other // 2 != k // 2:
                place = 0 if k % 2 == 0 else -1
                side[other][place] = pole[0 if other % 2 == 0 else -1]
    first = np.where(is_falling[..., None], np.stack([c00, c10, c01], -1), np.stack([c00, c10, c11], -1))
    second = np.where(is_falling[..., None], np.stack([c10, c11, c01], -1), np.stack([c00, c11, c01], -1))
    F = np.stack([first, second], axis=2).reshape(-1, 3)
    points, parameters = np.concatenate(points), np.concatenate(parameters)
    F = F[has_area(points, F)]
    return _compact(points, parameters, F, side)


def has_area(points, F):
    """Mask of the triangles F (m, 3) whose corners are three and do not lie on one line."""
    return kinds(points, F) == kernels.WHOLE


def kinds(points, F):
    """(m,) int of lib.nurbs.facet_kernels: which triangles F (m, 3) of points (k, 3) have an area."""
    kind = np.empty(len(F), dtype=np.int64)
    kernels.kinds(np.ascontiguousarray(points, dtype=np.float64), np.ascontiguousarray(F, dtype=np.int64), FLAT, kind)
    return kind


def _compact(points, parameters, F, side):
    """Drop vertices no triangle uses (the grid's own pole row); sides keep those that are left."""
    used = np.zeros(len(points), dtype=bool)
    used[F.ravel()] = True
    number = np.cumsum(used) - 1
    return points[used], parameters[used], number[F], tuple(number[s[used[s]]] for s in side)
