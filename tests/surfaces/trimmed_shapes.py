"""Trimmed surfaces by hand: loops typed in, neighbours given the same border points."""

import numpy as np

from lib.nurbs.evaluate import point
from lib.surfaces.trimmed import TrimmedSurface

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
