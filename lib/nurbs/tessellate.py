"""The mesh of a whole scene: every surface cut along its lines, neighbours meeting without a crack.

`shapes` finds once what surfaces are and how they touch; `mesh` cuts them for given tolerances.  Along borders of
equal speed, along seams and at poles the vertices of all sides take the position of the first of them, bit by bit, so
nothing can slip through.
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs import borders as find_borders
from lib.nurbs import lines as find_lines
from lib.nurbs import shape
from lib.nurbs.evaluate import evaluate_grid
from lib.nurbs.facets import chord_errors, has_area, triangulate

NINE = np.linspace(0.0, 1.0, 9)
SLIDE = 0.01  # share of its size by which a texture may slide on a surface
ROUNDS = 16  # of measuring and cutting finer
PATIENCE = 2  # of these before single chords are halved
FEW = 4  # single: one chord in so many, or two
MORE = 1.03  # asked for, so that the next attempt does not fail by a hair
FAR_OFF = 1.3  # times the tolerance: worth measuring finer where a count is asked for and no distance


@dataclass(frozen=True)
class Shapes:
    """What n surfaces are, in the unit of the surfaces given.

    area (n,), extent (n, 2) mean length along u and v, is_planar (n,), is_closed (n, 2), is_collapsed (n, 4)
    borders (m, 5) int32 [surface a, side a, surface b, side b, reversed], shell (n,) int32 or -1
    """

    area: np.ndarray
    extent: np.ndarray
    is_planar: np.ndarray
    is_closed: np.ndarray
    is_collapsed: np.ndarray
    borders: np.ndarray
    shell: np.ndarray


@dataclass(frozen=True)
class Mesh:
    """Triangles of n surfaces, packed surface after surface.

    V (n_v, 3), UV (n_v, 2), F (n_f, 3) int32; vertex_start, face_start (n + 1,) int64
    distance (n,) largest distance to the surface, welding included; rms (n,) its root mean square; slide (n,); area
    (n,) of the facets
    side : per surface, four arrays of vertices along its sides
    """

    V: np.ndarray
    UV: np.ndarray
    F: np.ndarray
    vertex_start: np.ndarray
    face_start: np.ndarray
    distance: np.ndarray
    rms: np.ndarray
    slide: np.ndarray
    area: np.ndarray
    side: list


def frame(surfaces):
    """(centre (3,), scale) of the box around a 9x9 grid of points of every surface: x' = (x - centre) / scale."""
    points = np.concatenate([evaluate_grid(s, NINE, NINE)[0].reshape(-1, 3) for s in surfaces])
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, float((high - low).max())


def into_frame(surfaces, centre, scale):
    """The surfaces in the frame."""
    M = np.eye(4)
    M[:3, :3] /= scale
    M[:3, 3] = -np.asarray(centre) / scale
    return [shape.transformed(s, M) for s in surfaces]


def shapes(surfaces, takes_part):
    """Measure the surfaces; takes_part (n,) bool: those that may be part of a closed shell."""
    is_closed = np.array([shape.is_closed(s) for s in surfaces]).reshape(-1, 2)
    is_collapsed = np.array([shape.collapsed_sides(s) for s in surfaces]).reshape(-1, 4)
    border, shell = find_borders.find(surfaces, is_closed, is_collapsed, np.asarray(takes_part, dtype=bool))
    return Shapes(
        np.array([shape.area(s) for s in surfaces]),
        np.array([shape.extent(s) for s in surfaces]).reshape(-1, 2),
        np.array([shape.is_planar(s) for s in surfaces]),
        is_closed,
        is_collapsed,
        border,
        shell,
    )


def plan(surfaces, known, lattice=None):
    """Everything about where lines go that does not depend on a tolerance (lib.nurbs.lines.Plan).

    lattice : {surface: (u, v)} interior parameters that must have a line whatever the shape
    """
    demands = [
        find_lines.demand(s, c, p) for s, c, p in zip(surfaces, known.is_closed, known.is_collapsed, strict=True)
    ]
    for s, along in (lattice or {}).items():
        for d in (0, 1):
            demands[s] = find_lines.with_lines(demands[s], d, along[d])
    return find_lines.plan(demands, find_lines.links(len(surfaces), known.borders))


def n_triangles(p, known, count):
    """Triangles of every surface (n,) when its line sets have `count` steps."""
    n_u, n_v = find_lines.per_surface(p, count).T
    poles = known.is_collapsed.astype(np.int64)
    return 2 * n_u * n_v - (poles[:, 0] + poles[:, 1]) * n_v - (poles[:, 2] + poles[:, 3]) * n_u


def cut(surfaces, known, p, tolerance, slide):
    """Cut all surfaces for tolerance (n,) and slide (n,) as planned: (list of Patch, their lines (u, v))."""
    both = np.stack([tolerance, slide], axis=1)
    placed = find_lines.place(p, both, find_lines.steps(p, both))
    each = zip(surfaces, *zip(*placed, strict=True), known.is_closed, known.is_collapsed, strict=True)
    return [triangulate(*one) for one in each], placed


def learned(surfaces, known, p, patches, placed, tolerance):
    """The plan measured finer where `patches`, cut along `placed`, miss tolerance (n,) by far; None if nowhere."""
    demands, over = list(p.demands), np.flatnonzero([q.distance for q in patches] > FAR_OFF * tolerance)
    for s in over:
        own = (surfaces[s], known.is_closed[s], known.is_collapsed[s])
        demands[s], _ = _amended(demands[s], *own, placed[s], patches[s].distance, tolerance[s], 0)
    return find_lines.plan(demands, p.links) if over.size else None


def cut_within(surfaces, known, p, tolerance, slide):
    """A list of Patch: cut until the measured distance stays within tolerance (n,).

    Where it does not, a little more is asked for and the plan is amended (`_amended`).  Gives up after ROUNDS; the
    patches say what was reached.
    """
    ask, patches, before = tolerance.copy(), [None] * len(surfaces), None
    for attempt in range(ROUNDS):
        both = np.stack([ask, slide], axis=1)
        placed = find_lines.place(p, both, find_lines.steps(p, both))
        for s, (u, v) in enumerate(placed):
            if before is None or not (np.array_equal(u, before[s][0]) and np.array_equal(v, before[s][1])):
                patches[s] = triangulate(surfaces[s], u, v, known.is_closed[s], known.is_collapsed[s])
        before = placed
        distance = np.array([p.distance for p in patches])
        over = np.flatnonzero((distance > tolerance) & ~(known.is_planar & (distance <= 1e-7)))
        if not over.size:
            break
        demands = list(p.demands)
        for s in over:
            own = (surfaces[s], known.is_closed[s], known.is_collapsed[s])
            demands[s], share = _amended(demands[s], *own, placed[s], distance[s], tolerance[s], attempt)
            ask[s] *= share
        p = find_lines.plan(demands, p.links)
    return patches


def _amended(demand, surface, is_closed, is_collapsed, placed, distance, tolerance, attempt):
    """A Demand that fails with the lines `placed` (u, v), amended, and the share of the tolerance to ask for next.

    Chords that fail show where: there the surface is measured finer.  If that did not help, few failing ones are
    halved, for a bend much shorter than the chord; if many fail, or none explains the distance (then it is the twist),
    a smaller tolerance is asked for.
    """
    errors = chord_errors(surface, *placed, is_closed, is_collapsed)
    is_everywhere = errors[0].max() + errors[1].max() < distance / 2
    for d in (0, 1):
        failing = errors[d] > tolerance / 2
        if failing.any():
            demand = find_lines.refined(surface, demand, d, placed[d], failing, is_closed, is_collapsed)
        if attempt >= PATIENCE and failing.any():
            if failing.sum() <= max(2, failing.size // FEW):
                demand = find_lines.with_lines(demand, d, ((placed[d][1:] + placed[d][:-1]) / 2)[failing])
            else:
                is_everywhere = True
    return demand, (tolerance / distance if is_everywhere else 1.0) / MORE


def assemble(patches, known):
    """Pack the patches into one Mesh, its borders, seams and poles welded."""
    vertex_start = np.concatenate([[0], np.cumsum([len(p.S) for p in patches])]).astype(np.int64)
    side = [tuple(k + start for k in p.side) for p, start in zip(patches, vertex_start[:-1], strict=True)]
    V, moved = _weld(np.concatenate([p.S for p in patches]), side, known)
    F = [p.F + start for p, start in zip(patches, vertex_start[:-1], strict=True)]
    F = [f[has_area(V, f)] for f in F]
    face_start = np.concatenate([[0], np.cumsum([len(f) for f in F])]).astype(np.int64)
    moved = np.maximum.reduceat(moved, vertex_start[:-1])
    return Mesh(
        V,
        np.concatenate([p.UV for p in patches]),
        np.concatenate(F).astype(np.int32),
        vertex_start,
        face_start,
        np.array([p.distance for p in patches]) + moved,
        np.sqrt([p.square for p in patches]),
        np.array([p.slide for p in patches]),
        np.array([p.area for p in patches]),
        side,
    )


def _weld(V, side, known):
    """Positions with those of one place made equal, and how far each vertex moved (n_v,)."""
    a, b = [], []
    for s, own in enumerate(side):
        for k in np.flatnonzero(known.is_collapsed[s]):
            a.append(np.broadcast_to(own[k][:1], own[k].shape))
            b.append(own[k])
        for d in np.flatnonzero(known.is_closed[s]):
            a.append(own[2 * d])
            b.append(own[2 * d + 1])
    for s, k, t, m, is_reversed in known.borders.tolist():
        first, second = side[s][k], side[t][m]
        if len(first) == len(second):
            a.append(first)
            b.append(second[::-1] if is_reversed else second)
    same = np.arange(len(V))
    if a:
        a, b = np.concatenate(a), np.concatenate(b)
        while True:  # the smallest number of all vertices in one place
            low = np.minimum(same[a], same[b])
            smallest = same.copy()
            np.minimum.at(smallest, a, low)
            np.minimum.at(smallest, b, low)
            np.minimum.at(smallest, same[a], low)
            np.minimum.at(smallest, same[b], low)
            smallest = smallest[smallest]
            if (smallest == same).all():
                break
            same = smallest
    return V[same], np.linalg.norm(V[same] - V, axis=1)
