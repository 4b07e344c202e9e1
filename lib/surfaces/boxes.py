"""Triangles cut along the borders of a quadtree over their (u, v)."""

import numpy as np


def cut(V, UV, F, boxes):
    """Return the parts of triangles in boxes: a list of (V (n, 3), F (k, 3)), one for each, wound as before.

    V (n, 3), UV (n, 2) in [0, 1], F (m, 3);  boxes (L, 4) u0, u1, v0, v1, the leaves of a quadtree that fill [0, 1]^2
    """
    parts = {}
    left = [((0.0, 1.0, 0.0, 1.0), np.concatenate([V, UV], axis=1)[F])]
    wanted = [tuple(box) for box in np.asarray(boxes).tolist()]
    leaves = set(wanted)
    while left:
        box, corners = left.pop()
        if box in leaves:
            parts[box] = corners
            continue
        u0, u1, v0, v1 = box
        u, v = (u0 + u1) / 2, (v0 + v1) / 2
        for u_ends, column in zip(((u0, u), (u, u1)), halves(corners, 3, u), strict=True):
            for v_ends, cell in zip(((v0, v), (v, v1)), halves(column, 4, v), strict=True):
                left.append(((*u_ends, *v_ends), cell))
    return [(parts[box][..., :3].reshape(-1, 3), np.arange(3 * len(parts[box])).reshape(-1, 3)) for box in wanted]


def halves(corners, axis, at):
    """Triangles (k, 3, c) below and above the place `at` along a coordinate; those across it are cut in three."""
    d = corners[..., axis] - at
    is_above, is_below = d > 0, d < 0
    across = is_above.any(axis=1) & is_below.any(axis=1)
    whole, whole_above = corners[~across], is_above[~across].any(axis=1)
    below, above = [whole[~whole_above]], [whole[whole_above]]
    for lone_above in (True, False):
        some = np.flatnonzero(across & ((is_above.sum(axis=1) == 1) == lone_above))
        lone = (is_above[some] == lone_above).argmax(axis=1)
        turn = (lone[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(corners[some], turn[..., None], axis=1).swapaxes(0, 1)
        p, q = _met(a, b, axis, at), _met(a, c, axis, at)
        (above if lone_above else below).append(np.stack([a, p, q], axis=1))
        (below if lone_above else above).extend([np.stack([p, b, c], axis=1), np.stack([p, c, q], axis=1)])
    return np.concatenate(below), np.concatenate(above)


def _met(a, b, axis, at):
    """Where the lines from a to b (k, c) meet the place `at`."""
    t = (at - a[:, axis]) / (b[:, axis] - a[:, axis])
    return a + np.clip(t, 0.0, 1.0)[:, None] * (b - a)
