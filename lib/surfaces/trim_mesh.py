"""Triangles of a trimmed surface: constrained Delaunay in its (u, v), the border points as given, the inside exact.

(u, v) are scaled so that triangles are long where the surface is straight and as wide as tall where it is flat.  Which
border points there are is decided by the caller, for all surfaces that share them; if with these the loops cross,
collapse, or stand too far off, `Unfit` names the border points whose edges need more.  The one importer of pythoncdt.
"""

from dataclasses import dataclass

import numpy as np
import pythoncdt

from lib.nurbs.evaluate import evaluate
from lib.nurbs.facets import Patch
from lib.surfaces import loop_kernels
from lib.surfaces.loops import corner_runs, double_area, following
from lib.surfaces.rows import numbered
from lib.surfaces.trim_distance import distances
from lib.surfaces.trim_flat import without_flat
from lib.surfaces.trim_flip import flipped
from lib.surfaces.trim_nodes import Grid, creases
from lib.surfaces.trimmed import TrimmedSurface

NOT_ALLOWED = pythoncdt.IntersectingConstraintEdges.NOT_ALLOWED
TRY_RESOLVE = pythoncdt.IntersectingConstraintEdges.TRY_RESOLVE
LEAST_SHARE = 0.3  # of its area that a loop keeps
ROUNDS = 20  # of measuring and putting points where a triangle is too far off
BESIDE = 1.2  # of the distance at its border edges that a triangle may have inside
PATIENCE, LESS = 4, 0.9  # rounds in which the area too far off must fall to so much of the least so far
SAME_AREA = 1e-9  # share by which the triangles' area may differ from that of the loops
NOTHING = 1e-14  # of the whole: a region smaller than this is rounding's
AT_ONCE = 1_000_000  # pairs of edges compared


class Unfit(ValueError):
    """These border points do not do.

    points : indices into the surface's border, on the edges that need more;  share : of the tolerance they need
    """

    def __init__(self, points, share=0.5):
        super().__init__(f"border points {points[:8]}")
        self.points, self.share = points, share


@dataclass(frozen=True)
class Lines:
    """Lines u, v (ascending, 0 and 1 among them) whose crossings are vertices, those of them along kinks, and the mean
    lengths (2,) of the surface along u and v.
    """

    u: np.ndarray
    v: np.ndarray
    kinks: tuple
    extent: np.ndarray

    def planes(self, uv):
        """The points uv (k, 2) laid out for Delaunay, (k, 2) each: by the lines between them, then by their mean.

        A step between lines counts as 1, where the surface is straight its length counts.  The first way suits lines
        that crowd, but bends straight borders.
        """
        rest = np.asarray(self.extent) / max(self.extent)
        n = np.array([len(self.u), len(self.v)]) - 2.0
        steps = [np.interp(x, t, np.linspace(0.0, 1.0, len(t))) for x, t in zip(uv.T, (self.u, self.v), strict=True)]
        yield n * np.stack(steps, axis=1) + rest * uv
        yield (n + rest) * uv


def domain_triangles(trim: TrimmedSurface):
    """Triangles of the part inside the loops from its border points alone: uv (k, 2) float64, F (m, 3) int64 counter-
    clockwise in (u, v).  Where loops cross, points of crossing are added after those of the border.
    """
    edges = np.stack([np.arange(len(trim.uv)), following(trim.loop_start)], axis=1)
    try:
        return trim.uv, _inside(trim.uv, edges, np.empty((0, 2), dtype=np.int64))
    except RuntimeError:
        return _crossed(trim.uv, edges)


def _made(points, edges, crossing):
    """Constrained Delaunay triangulation of different points (k, 2) with the edges (e, 2)."""
    made = pythoncdt.Triangulation(pythoncdt.VertexInsertionOrder.AUTO, crossing, 0.0)
    made.insert_vertices(np.ascontiguousarray(points))
    made.insert_edges(np.ascontiguousarray(edges, dtype=np.uint32))
    return made


def _inside(points, edges, more):
    """Triangles (m, 3) of `points` inside the loops of `edges`, with `more` edges; RuntimeError where edges cross."""
    number, first = numbered(points)
    loops, more = number[edges], number[more]
    loops = loops[loops[:, 0] != loops[:, 1]]
    made = _made(points[first], np.concatenate([loops, more[more[:, 0] != more[:, 1]]]), NOT_ALLOWED)
    made.erase_super_triangle()
    F = made.triangles_array()["vertices"].astype(np.int64)
    return first[F[_in_loops(points[first], F, loops)]]


def _in_loops(points, F, loops):
    """(m,) bool: triangles F (m, 3) of points (n, 2) inside the loops (e, 2), see lib.surfaces.loop_kernels."""
    m, size = len(F), 1 << (2 * (3 * len(F) + len(loops)) + 2).bit_length()
    table, within = np.full((2, size), loop_kernels.FREE), np.empty(m, dtype=bool)
    rooms = np.arange(m), np.empty(m), np.empty(m, dtype=np.int64)
    loop_kernels.inside(np.ascontiguousarray(points), F, np.ascontiguousarray(loops), NOTHING, *table, *rooms, within)
    return within


def _crossed(points, edges):
    """Points and triangles inside loops that cross, the places of crossing added as points."""
    number, first = numbered(points)
    loops = number[edges]
    made = _made(points[first], loops[loops[:, 0] != loops[:, 1]], TRY_RESOLVE)
    made.erase_outer_triangles_and_holes()
    F = made.triangles_array()["vertices"].astype(np.int64)
    found = made.vertices_array()
    extra = np.stack([found["x"], found["y"]], axis=1)[len(first) :]
    return np.concatenate([points, extra]), np.concatenate([first, len(points) + np.arange(len(extra))])[F]


def triangulate(trim, keep, lines, tolerance, rounds=ROUNDS, is_last=False):
    """The Patch of a TrimmedSurface with its border points `keep` (k,) bool, within the tolerance if possible.

    lines : Lines;  rounds : how often points may be added inside;  is_last : do without what the border lacks
    `side` of the Patch is one array of vertices for each run of border points from corner to corner.

    Raises Unfit unless is_last.
    """
    border, after = _kept_loops(trim, keep, is_last)
    border, uv, S, edges = _with_poles(trim, border, after, lines)
    if not is_last:
        _check_areas(trim, border, uv, edges)
    grid = Grid(uv[edges[:, 0]], uv[edges[:, 1]], lines.u, lines.v)
    uv = np.concatenate([uv, grid.uv])
    off = np.linalg.norm(evaluate(trim.base, *np.clip(uv[: len(S)], 0, 1).T)[0] - S, axis=1)  # by the file's tolerance
    found, least, better = None, np.inf, 0
    for turn in range(rounds + 1):
        F, uv, fixed = _triangles(border, uv, edges, lines, grid, is_last)
        S = np.concatenate([S, evaluate(trim.base, *np.clip(uv[len(S) :], 0, 1).T)[0]])
        found, F = distances(trim.base, S, uv, without_flat(S, F, edges), found)
        if (found.height > tolerance).any():
            F = flipped(trim.base, S, uv, F, found.height > tolerance, fixed)
            found, F = distances(trim.base, S, uv, without_flat(S, F, edges), found)
        allowed = tolerance + np.append(off, np.zeros(len(S) - len(off)))[F].max(axis=1)
        is_border = _is_border(F, edges, len(S))
        at_border = np.where(is_border, found.on_edge, 0.0).max(axis=1)  # no point inside can change it
        stuck = at_border > allowed
        if stuck.any() and not is_last:
            ends = np.stack([F, np.roll(F, -1, axis=1)], axis=-1)[stuck][is_border[stuck]]
            raise Unfit(_real(border, ends.ravel()), float((allowed[stuck] / at_border[stuck]).min()))
        failing = found.height > np.where(stuck, BESIDE * at_border, allowed)
        excess = found.area[failing].sum()
        better, least = (turn, excess) if excess < LESS * least else (better, least)
        if not failing.any() or turn == rounds or turn - better == PATIENCE:
            break
        new = _between(uv, F[failing], np.where(is_border, -1.0, found.on_edge)[failing])
        grid.dissolve(new)
        uv = np.concatenate([uv, new])
    return _patch(trim, keep, border, S, uv, F, found)


def _kept_loops(trim, keep, is_last):
    """Kept border points (b,) and the next of each (b,), places in this list."""
    border, after = [], []
    for a, b in zip(trim.loop_start[:-1], trim.loop_start[1:], strict=True):
        own = a + np.flatnonzero(keep[a:b])
        if len(own) < 3 and not (trim.S[own] == trim.S[np.roll(own, -1)]).all(axis=1).any():
            if not is_last:
                raise Unfit(np.arange(a, b))
        count = sum(map(len, border))
        border.append(own)
        after.append(count + np.roll(np.arange(len(own)), -1))
    return np.concatenate(border), np.concatenate(after)


def _with_poles(trim, border, after, lines):
    """The border with vertices put along collapsed sides, where one step of it stays in one place: at the middle of
    the lines that end there, so that texture coordinates interpolate as they should.

    Returns border (b,) with -1 for these, uv (b, 2), S (b, 3), edges (b, 2).
    """
    uv, S = trim.uv[border], trim.S[border]
    start, end = np.arange(len(border)), after.copy()
    still = np.flatnonzero((S == S[after]).all(axis=1) & (uv != uv[after]).any(axis=1))
    for k in still:
        d = int(np.argmax(np.abs(uv[after[k]] - uv[k])))
        t = (lines.u, lines.v)[d]
        t = (t[1:] + t[:-1]) / 2
        low, high = sorted((uv[k, d], uv[after[k], d]))
        t = t[(t > low) & (t < high)]
        if not t.size:
            continue
        t = t if uv[k, d] == low else t[::-1]
        new = np.tile(uv[k], (t.size, 1))
        new[:, d] = t
        new[:, 1 - d] += (t - uv[k, d]) / (uv[after[k], d] - uv[k, d]) * (uv[after[k], 1 - d] - uv[k, 1 - d])
        chain = len(uv) + np.arange(t.size)
        uv, S = np.concatenate([uv, new]), np.concatenate([S, np.repeat(S[k][None], t.size, axis=0)])
        start, end = np.concatenate([start, chain]), np.concatenate([end, chain[1:], [after[k]]])
        end[k] = chain[0]
    border = np.concatenate([border, np.full(len(uv) - len(border), -1)])
    return border, uv, S, np.stack([start, end], axis=1)


def _check_areas(trim, border, uv, edges):
    """Unfit with the points of loops that lose most of their area or turn over."""
    whole = _signed(trim.uv, trim.uv[following(trim.loop_start)])
    part = _signed(uv[edges[:, 0]], uv[edges[:, 1]])
    loop = np.searchsorted(trim.loop_start, np.arange(len(trim.uv)), side="right") - 1
    whole = np.bincount(loop, whole)
    owner = loop[border[edges[:, 0]]]
    inserted = border[edges[:, 0]] < 0
    for k in np.flatnonzero(inserted):  # a pole's vertices follow a border point of the same loop
        owner[k] = owner[np.flatnonzero(edges[:, 1] == k)[0]]
    part = np.bincount(owner, part, minlength=len(whole))
    lost = np.flatnonzero(part / np.where(whole == 0, 1.0, whole) < LEAST_SHARE)
    if lost.size:
        raise Unfit(np.flatnonzero(np.isin(loop, lost)))


def _signed(A, B):
    """Twice the area swept by A-B (e, 2) seen from the middle of the box, counterclockwise."""
    A, B = A - 0.5, B - 0.5
    return A[:, 0] * B[:, 1] - A[:, 1] * B[:, 0]


def _triangles(border, uv, edges, lines, grid, is_last):
    """Triangles (m, 3) of the points, the points, more of them where loops cross and this is the last resort, and the
    edges (e, 2) that must stay.  Whole cells are cut in two, the rest between them and the border is Delaunay.
    """
    more = creases(uv, uv[edges[:, 0]], uv[edges[:, 1]], lines.kinks)
    cells, outline, is_inner = grid.cells()
    first = len(border)
    rest = np.ones(len(uv), dtype=bool)
    rest[first : first + len(is_inner)] = ~is_inner
    own = np.cumsum(rest) - 1
    loops = own[np.concatenate([edges, outline + first])]
    inner = own[more[rest[more].all(axis=1)]]
    expected = _signed(uv[edges[:, 0]], uv[edges[:, 1]]).sum()
    for plane in lines.planes(uv):
        for constraints in (inner, inner[:0]):
            try:
                F = _inside(plane[rest], loops, constraints)
            except RuntimeError:
                continue
            F = np.concatenate([np.flatnonzero(rest)[F], cells + first])
            area = double_area(*(uv[F[:, k]] for k in range(3)))
            if abs(area.sum() - expected) <= SAME_AREA * abs(expected) and area.min() >= -NOTHING * abs(expected):
                return F, uv, np.concatenate([edges, more])
    if not is_last:
        crossed = crossing(uv[edges[:, 0]], uv[edges[:, 1]])
        rows = edges[crossed].ravel() if crossed.size else np.arange(len(border))  # or a hole came to lie outside
        raise Unfit(_real(border, rows))
    points, F = _crossed(uv, edges)
    return F, np.concatenate([uv, points[len(uv) :]]), edges


def _real(border, rows):
    rows = border[np.unique(rows)]
    return rows[rows >= 0]


def crossing(A, B):
    """Indices of the segments A-B (e, 2) that cross or touch another one but at a common end."""
    out = []
    step = max(1, AT_ONCE // max(len(A), 1))
    for first in range(0, len(A), step):
        a, b = A[first : first + step, None], B[first : first + step, None]
        sides = [np.sign(double_area(*three)) for three in ((a, b, A), (a, b, B), (A, B, a), (A, B, b))]
        meets = (sides[0] * sides[1] <= 0) & (sides[2] * sides[3] <= 0) & ~((sides[0] == 0) & (sides[1] == 0))
        shares = [(x == y).all(axis=2) for x in (a, b) for y in (A, B)]
        i, j = np.nonzero(meets & ~np.logical_or.reduce(shares))
        out += [first + i, j]
    return np.unique(np.concatenate(out))


def _between(uv, F, on_edge):
    """New points (n, 2) for triangles F (m, 3) of points uv (k, 2): the middle of the edge that is farthest off, or of
    the triangle if `on_edge` (m, 3) is negative for all of them.
    """
    k, row = np.argmax(on_edge, axis=1), np.arange(len(F))
    middle = (uv[F[row, k]] + uv[F[row, (k + 1) % 3]]) / 2
    return np.unique(np.where((on_edge.max(axis=1) < 0)[:, None], uv[F].mean(axis=1), middle), axis=0)


def _is_border(F, edges, n):
    """(m, 3) bool: the edge from corner k to the next is one of `edges`, of n points."""
    key = np.sort(np.stack([F, np.roll(F, -1, axis=1)], axis=-1), axis=-1) @ [n, 1]
    return np.isin(key, np.sort(edges, axis=1) @ [n, 1])


def _patch(trim, keep, border, S, uv, F, found):
    """The Patch of the vertices that triangles use or that lie on the border."""
    used = np.zeros(len(S), dtype=bool)
    used[F.ravel()] = True
    used[: len(border)] |= border >= 0
    number = np.cumsum(used) - 1
    vertex = np.full(len(trim.uv), -1, dtype=np.int64)
    vertex[border[border >= 0]] = number[np.flatnonzero(border >= 0)]
    area = float(found.area.sum())
    return Patch(
        S[used],
        np.clip(uv[used], 0.0, 1.0),
        number[F],
        sides(trim, vertex),
        max(float(found.height.max(initial=0.0)), border_distance(trim, keep)),
        float(found.square @ found.area) / max(area, 1e-300),
        float(found.slide.max(initial=0.0)),
        area,
    )


def sides(trim, vertex):
    """Vertices along each run of the border from corner to corner, where `vertex` (k,) is -1 at points not kept."""
    runs = (vertex[run] for run in corner_runs(trim))
    return tuple(run[run >= 0] for run in runs)


def border_distance(trim, keep):
    """The largest distance of border points from the chords between those kept."""
    largest = 0.0
    for a, b in zip(trim.loop_start[:-1], trim.loop_start[1:], strict=True):
        own = np.flatnonzero(keep[a:b])
        if not own.size:
            continue
        rest = np.flatnonzero(~keep[a:b])
        after = np.searchsorted(own, rest)
        p, q = trim.S[a + own[after - 1]], trim.S[a + own[after % own.size]]
        along, off = q - p, trim.S[a + rest] - p
        t = np.clip((off * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300), 0.0, 1.0)
        largest = max(largest, float(np.linalg.norm(off - t[:, None] * along, axis=1).max(initial=0.0)))
    return largest
