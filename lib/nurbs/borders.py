"""Which sides of which surfaces are the same curve: borders with equal speed, and closed shells.

Sides are numbered 0 u=0, 1 u=1, 2 v=0, 3 v=1; a side runs along the other parameter.  Two sides make a border when
nine points at equal parameters agree, forwards or backwards: then both surfaces can be cut at the same parameters and
meet without a crack.  For a shell it is enough that the two curves are the same as point sets.  Candidates come from
a spatial hash, so the cost grows with the number of sides.
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs.curve_kernels import farthest
from lib.nurbs.evaluate import evaluate_grid

SAMPLES = np.linspace(0.0, 1.0, 9)
FINE = 8  # finer steps per sample, for curves that differ in speed
SAME = 1e-5  # share of a side's length within which two points are one: modellers join edges to 1e-5 and better
SAME_ACROSS = 1e-2  # and never more than this share of the surface's width there: a thin strip is not closed
SAME_CURVE = 1e-3  # share of the length between curves of different speed (chord error of the samples included)


@dataclass(frozen=True)
class Sides:
    """Points and tolerances of every side of n surfaces; row 4 s + k is side k of surface s.

    points : (4 n, 65, 3)    at equal steps of the side's parameter
    length : (4 n,)          of the polyline; 0 where the side is one point
    within : (4 n,)          distance at which two points count as one
    """

    points: np.ndarray
    length: np.ndarray
    within: np.ndarray


def sides(surfaces):
    """Sample the four sides of each surface."""
    ends = np.array([0.0, 1.0])
    fine = np.linspace(0.0, 1.0, (SAMPLES.size - 1) * FINE + 1)
    points = np.empty((len(surfaces), 4, fine.size, 3))
    for row, surface in zip(points, surfaces, strict=True):
        along_v, along_u = evaluate_grid(surface, ends, fine)[0], evaluate_grid(surface, fine, ends)[0]
        row[0], row[1], row[2], row[3] = along_v[:, 0], along_v[:, 1], along_u[0], along_u[1]
    length = np.linalg.norm(np.diff(points, axis=2), axis=3).sum(axis=2)
    across = np.stack([length[:, 2:].max(axis=1), length[:, :2].max(axis=1)], axis=1).repeat(2, axis=1)
    within = np.minimum(SAME * length, SAME_ACROSS * across)
    return Sides(points.reshape(-1, fine.size, 3), length.ravel(), within.ravel())


def neighbours(keys, within):
    """Pairs of rows i < j (m, 2) whose points `keys` (n, 3) may lie within `within` (n,): a spatial hash."""
    if len(keys) < 2:
        return np.empty((0, 2), dtype=np.int64)
    cell = 4 * max(within.max(), 1e-15 * np.abs(keys).max(), 1e-300)
    low, high = np.floor((keys - within[:, None]) / cell), np.floor((keys + within[:, None]) / cell)
    corner = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T.astype(bool)
    cells = np.where(corner[None], high[:, None], low[:, None]).reshape(-1, 3)
    _, cells = np.unique(cells, axis=0, return_inverse=True)
    rows = np.unique(np.stack([cells.ravel(), np.repeat(np.arange(len(keys)), 8)], axis=1), axis=0)
    found, step = [], 1
    while step < len(rows):
        together = np.flatnonzero(rows[step:, 0] == rows[:-step, 0])
        if not together.size:
            break
        found.append(np.stack([rows[together, 1], rows[together + step, 1]], axis=1))
        step += 1
    return np.unique(np.concatenate(found), axis=0) if found else np.empty((0, 2), dtype=np.int64)


def same_speed(data, usable):
    """Borders (m, 5) int32 [surface a, side a, surface b, side b, reversed], among the sides where `usable` (4 n,)."""
    rows = np.flatnonzero(usable)
    middle = data.points.shape[1] // 2
    pair = rows[neighbours(data.points[rows, middle], data.within[rows])]
    a, b = data.points[pair[:, 0], ::FINE], data.points[pair[:, 1], ::FINE]
    within = np.minimum(data.within[pair[:, 0]], data.within[pair[:, 1]])
    forwards = np.linalg.norm(a - b, axis=2).max(axis=1, initial=0.0)
    backwards = np.linalg.norm(a - b[:, ::-1], axis=2).max(axis=1, initial=0.0)
    same = np.minimum(forwards, backwards) <= within
    pair, is_reversed = pair[same], (backwards < forwards)[same]
    return np.column_stack([pair[:, 0] // 4, pair[:, 0] % 4, pair[:, 1] // 4, pair[:, 1] % 4, is_reversed]).astype(
        np.int32
    )


def same_curve(data, usable, known):
    """Pairs of sides (m, 2), rows of `data`, that are the same curve at any speed and in any direction.

    known : (k, 2) pairs, smaller row first, that need no test and are left out
    """
    rows = np.flatnonzero(usable)
    ends = data.points[:, [0, -1]]
    pair = rows[neighbours(ends.mean(axis=1)[rows], data.within[rows])]
    number = [p[:, 0] * len(data.length) + p[:, 1] for p in (pair, known)]
    pair = pair[~np.isin(*number)]
    a, b = ends[pair[:, 0]], ends[pair[:, 1]]
    gap = np.minimum(
        np.linalg.norm(a - b, axis=2).max(axis=1, initial=0.0),
        np.linalg.norm(a - b[:, ::-1], axis=2).max(axis=1, initial=0.0),
    )
    pair = pair[gap <= np.minimum(data.within[pair[:, 0]], data.within[pair[:, 1]])]
    keep = []
    for i, j in pair:
        far = max(
            to_polyline(data.points[i, ::FINE], data.points[j]), to_polyline(data.points[j, ::FINE], data.points[i])
        )
        keep.append(far <= SAME_CURVE * min(data.length[i], data.length[j]))
    return pair[np.array(keep, dtype=bool)]


def to_polyline(points, line):
    """The largest distance of `points` (m, 3) from the polyline `line` (k, 3)."""
    out = np.empty(1)
    farthest(np.ascontiguousarray(points), np.ascontiguousarray(line), out)
    return float(out[0])


def shells(pairs, is_free, takes_part):
    """Shell number (n,) int32 of each surface, -1 where it belongs to none.

    pairs : (m, 2) sides, 4 surface + side, that are the same curve; is_free : (4 n,) sides that need no partner
    (poles, seams);
    takes_part : (n,) surfaces that may belong to a shell.  A surface with an unpaired side is taken away, with it the
    pairs it gave to others, until nothing changes; the connected groups of what is left are the closed shells.
    """
    n = len(takes_part)
    left = takes_part.copy()
    while True:
        alive = left[pairs[:, 0] // 4] & left[pairs[:, 1] // 4]
        has_partner = is_free.copy()
        has_partner[pairs[alive].ravel()] = True
        still = left & has_partner.reshape(n, 4).all(axis=1)
        if (still == left).all():
            break
        left = still
    group = np.arange(n)
    link = pairs[alive] // 4
    while link.size:  # every surface takes the smallest number among those it touches, until all agree
        smallest = group.copy()
        np.minimum.at(smallest, link[:, 0], group[link[:, 1]])
        np.minimum.at(smallest, link[:, 1], group[link[:, 0]])
        smallest = smallest[smallest]
        if (smallest == group).all():
            break
        group = smallest
    shell = np.full(n, -1, dtype=np.int32)
    _, shell[left] = np.unique(group[left], return_inverse=True)
    return shell


def find(surfaces, is_closed, is_collapsed, takes_part):
    """Borders (m, 5) int32 and shells (n,) int32 of the surfaces.

    is_closed (n, 2), is_collapsed (n, 4) bool; takes_part (n,) bool: surfaces that may be part of a shell.
    The two sides of one surface's seam are no border: `is_closed` says so already.
    """
    data = sides(surfaces)
    usable = ~is_collapsed.ravel()
    borders = same_speed(data, usable)
    own_seam = (borders[:, 0] == borders[:, 2]) & (borders[:, 1] // 2 == borders[:, 3] // 2)
    seam = own_seam & is_closed[borders[:, 0], borders[:, 1] // 2]
    is_free = (is_collapsed | is_closed.repeat(2, axis=1)).ravel()
    pairs = np.concatenate([same_curve(data, usable, rows_of(borders)), rows_of(borders[~seam])])
    return borders[~seam], shells(pairs, is_free, takes_part)


def rows_of(borders):
    """The pairs of sides (m, 2), 4 surface + side, of borders (m, 5)."""
    return np.stack([borders[:, 0] * 4 + borders[:, 1], borders[:, 2] * 4 + borders[:, 3]], axis=1).astype(np.int64)
