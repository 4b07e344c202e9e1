"""Trimmed surfaces by hand: loops typed in, neighbours given the same border points."""

import numpy as np

from lib.nurbs.evaluate import point
from lib.surfaces.trimmed import TrimmedSurface
from tests.shapes import cylinder, rectangle, sphere

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])


def circle(centre, radius, n, is_hole=False, start=0.0):
    """n points in (u, v), counterclockwise unless a hole."""
    angle = start + np.linspace(0, 2 * np.pi, n, endpoint=False) * (-1 if is_hole else 1)
    return np.asarray(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def significance(S, is_loop=False):
    """Significances (k,) of a polyline (k, 3) by Douglas and Peucker's order, inf at its ends; of a closed one at its
    first point, which is its end too.
    """
    S = np.asarray(S, dtype=float)
    line = np.concatenate([S, S[:1]]) if is_loop else S
    out = np.full(len(line), np.inf)
    todo = [(0, len(line) - 1, np.inf)]
    while todo:
        a, b, above = todo.pop()
        if b - a < 2:
            continue
        along = line[b] - line[a]
        t = np.clip((line[a + 1 : b] - line[a]) @ along / max(along @ along, 1e-300), 0, 1)
        off = np.linalg.norm(line[a + 1 : b] - line[a] - t[:, None] * along, axis=1)
        k = int(np.argmax(off))
        own = min(float(off[k]), above)
        out[a + 1 + k] = own
        todo += [(a, a + 1 + k, own), (a + 1 + k, b, own)]
    return out[: len(S)]


def cut_out(base, loops, S=None, significances=None):
    """A TrimmedSurface of a base surface and loops (k, 2) of its (u, v); by default each loop is one closed edge, and
    its points lie on the surface.
    """
    uv = np.concatenate(loops)
    start = np.concatenate([[0], np.cumsum([len(loop) for loop in loops])]).astype(np.int64)
    S = point(base, uv[:, 0], uv[:, 1]) if S is None else np.concatenate(S)
    if significances is None:
        significances = [significance(S[a:b], is_loop=True) for a, b in zip(start[:-1], start[1:], strict=True)]
    return TrimmedSurface(base, np.array([0.0, 1, 0, 1]), uv, start, S, np.concatenate(significances))


def edge(base, uv):
    """An edge as one face sees it: its uv (k, 2), the positions (k, 3) and significances (k,) all faces will share."""
    uv = np.asarray(uv, dtype=float)
    S = point(base, uv[:, 0], uv[:, 1])
    return uv, S, significance(S)


def back(use):
    """The same edge in the other direction."""
    return tuple(x[::-1] for x in use)


def seen(use, uv):
    """The same positions in another face's (u, v)."""
    return np.asarray(uv, dtype=float), *use[1:]


def face(base, *loops):
    """A TrimmedSurface of loops of edges, each from its first to its last point."""
    uses = [[tuple(x[:-1] for x in use) for use in loop] for loop in loops]
    uv, S, sharp = ([np.concatenate([use[k] for use in loop]) for loop in uses] for k in range(3))
    return cut_out(base, uv, S, sharp)


def straight(a, b):
    """The two ends of a line in (u, v)."""
    return np.array([a, b], dtype=float)


def ring(v, n=256):
    """All the way round in u at one v."""
    u = np.linspace(0, 1, n + 1)
    return np.stack([u, np.full(n + 1, v)], axis=1)


def can(n=256):
    """A solid cylinder of radius 1 and height 1: its wall with a seam, its lid and its bottom; lit outside."""
    wall = cylinder()
    low, high, seam = edge(wall, ring(0, n)), edge(wall, ring(1, n)), edge(wall, straight([1, 0], [1, 1]))
    side = face(wall, [low, seam, back(high), back(seen(seam, straight([0, 0], [0, 1])))])
    ends = []
    for z, rim in ((1, high), (0, low)):
        uv = (rim[1][:, :2] + 1.5) / 3
        if z:
            ends.append(face(rectangle([-1.5, -1.5, 1], [3, 0, 0], [0, 3, 0]), [seen(rim, uv)]))
        else:
            ends.append(face(rectangle([-1.5, -1.5, 0], [0, 3, 0], [3, 0, 0]), [back(seen(rim, uv[:, ::-1]))]))
    return [side, *ends]


def octant(n=128):
    """An eighth of the unit sphere: its pole at v = 1, u from 0 to a quarter, v from the equator up."""
    t = np.linspace(0, 1, n + 1)
    equator = edge(sphere(), np.stack([t / 4, 0 * t + 0.5], axis=1))
    up = edge(sphere(), np.stack([0 * t + 0.25, 0.5 + t / 2], axis=1))
    down = edge(sphere(), np.stack([0 * t, 1 - t / 2], axis=1))
    at_pole = np.array([[0.25, 1], [0, 1]]), np.array([up[1][-1], up[1][-1]]), np.full(2, np.inf)
    up[1][-1] = down[1][0] = at_pole[1][0]
    return face(sphere(), [equator, up, at_pole, down])
