"""Which surfaces hang together along shared borders, and which of them face to the same side of what they make."""

import numpy as np

from lib.nurbs import borders as find_borders
from lib.nurbs.surface import NurbsSurface
from lib.surfaces.loops import following
from lib.surfaces.measure import collapsed_sides, is_closed
from lib.surfaces.pieces import pieces
from lib.surfaces.rows import numbered
from lib.surfaces.trimmed import TrimmedSurface

ROUND = np.array([-1, 1, 1, -1])  # sides u = 0, u = 1, v = 0, v = 1: along their parameter counterclockwise?


def joined(surfaces, flip):
    """(body (n,) int, side (n,) int): surfaces of one number share borders; those of one side (1 or -1) face to the
    same side of their body.

    surfaces : of any kinds; meshes share no borders here.  flip (n,) bool: turned against S_u x S_v

    Neighbours face to the same side when their common border runs in opposite directions around them.  Where that goes
    both ways round (a Moebius strip), the shorter way from the first surface counts.
    """
    n = len(surfaces)
    a, b, is_same = (np.concatenate(part) for part in zip(_of_trimmed(surfaces), _of_whole(surfaces), strict=True))
    sign = np.where(is_same, 1, -1) * np.where(flip, -1, 1)[a] * np.where(flip, -1, 1)[b]
    # Each pair of neighbours once: most of their common border decides
    pair, which = np.unique(np.minimum(a, b) * n + np.maximum(a, b), return_inverse=True)
    turn = np.where(np.bincount(which.ravel(), sign, len(pair)) < 0, -1, 1)
    return pieces(n, a, b), _sides(n, pair // max(n, 1), pair % max(n, 1), turn)


def _sides(n, a, b, turn):
    """(n,) int: 1 for the first surface of a body, carried on breadth first over neighbours (a[k], b[k]) by turn[k].

    A loop: scipy's takes 0.25 CPU s to load.
    """
    beside = [[] for _ in range(n)]
    pairs = list(zip(a.tolist(), b.tolist(), turn.tolist(), strict=True))
    for one, other, sign in pairs + [(other, one, sign) for one, other, sign in pairs]:
        beside[one].append((other, sign))
    side = [0] * n
    for first in range(n):
        if side[first]:
            continue
        side[first], front = 1, [first]
        for one in front:
            for other, sign in beside[one]:
                if not side[other]:
                    side[other] = side[one] * sign
                    front.append(other)
    return np.array(side, dtype=np.int64)


def _of_trimmed(surfaces):
    """(a (m,), b (m,), is_same (m,)): pairs of trimmed surfaces with a common piece of border, and whether they lie on
    one side of their body: the piece runs against itself."""
    own = [s for s, surface in enumerate(surfaces) if isinstance(surface, TrimmedSurface)]
    if not own:
        return _nothing()
    point, _ = numbered(np.concatenate([surfaces[s].S for s in own]))
    begin = np.cumsum([0, *(len(surfaces[s].S) for s in own)])
    after = np.concatenate([following(surfaces[s].loop_start) + k for s, k in zip(own, begin[:-1], strict=True)])
    owner = np.repeat(own, np.diff(begin))
    start, end = point, point[after]
    piece = np.stack([np.minimum(start, end), np.maximum(start, end)], axis=1)
    order = np.lexsort([owner, piece[:, 1], piece[:, 0]])
    one, two = order[:-1], order[1:]
    common = (piece[one] == piece[two]).all(axis=1) & (owner[one] != owner[two]) & (start[one] != end[one])
    one, two = one[common], two[common]
    return owner[one], owner[two], start[one] != start[two]


def _of_whole(surfaces):
    """The same of whole NURBS surfaces."""
    own = np.array([s for s, surface in enumerate(surfaces) if isinstance(surface, NurbsSurface)], dtype=np.int64)
    if not len(own):
        return _nothing()
    whole = [surfaces[s] for s in own]
    closed, collapsed = (np.array([f(surface) for surface in whole]) for f in (is_closed, collapsed_sides))
    a, side, b, other, is_reversed = find_borders.find(whole, closed, collapsed, np.zeros(len(whole), dtype=bool))[0].T
    is_same = ROUND[side] * ROUND[other] * np.where(is_reversed, -1, 1) < 0
    apart = a != b
    return own[a[apart]], own[b[apart]], is_same[apart]


def _nothing():
    return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
