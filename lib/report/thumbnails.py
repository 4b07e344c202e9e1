"""Small pictures of illumination maps and the number of cells two quadtrees cut a surface into."""

import numpy as np

from lib.maps.colour import linear_to_srgb

LARGEST = 129  # samples a side; a larger map shows every second, fourth, ... sample, which stay on crossings


def thumbnail(value, hidden, exposure):
    """8-bit sRGB picture (h, w, 3), v up, of a map (h, w, 3) of radiosity: exposure B, as the export has it.

    Hidden samples are drawn in a dull violet that no lamp makes.
    """
    step = 1
    while max((n - 1) // step + 1 for n in value.shape[:2]) > LARGEST and all(
        (n - 1) % (2 * step) == 0 for n in value.shape[:2]
    ):
        step *= 2
    codes = np.rint(255 * linear_to_srgb(np.asarray(value[::step, ::step], float) * exposure)).astype(np.uint8)
    codes[hidden[::step, ::step]] = (70, 40, 90)
    return codes[::-1]


def automatic_exposure(values):
    """1 / the 99th percentile of the brightest channel of samples (n, 3), 1 where all is dark."""
    top = float(np.percentile(np.max(values, axis=-1), 99)) if len(values) else 0.0
    return 1.0 / top if top > 0 else 1.0


def overlay_count(trees, roots):
    """Leaves of the grid that two or more quadtrees over the same roots make together.

    trees : list of (level, i, j), each the leaves of one tree; roots : (n_u, n_v)

    >>> root = ([0], [0], [0])
    >>> quarters = ([1, 1, 1, 1], [0, 1, 0, 1], [0, 0, 1, 1])
    >>> overlay_count([root, quarters], (1, 1)), overlay_count([root], (3, 2))
    (4, 6)
    """
    trees = [tuple(np.asarray(x, np.int64) for x in tree) for tree in trees]
    deepest = max([int(level.max(initial=0)) for level, _, _ in trees], default=0)
    depth = np.zeros((int(roots[1]) << deepest, int(roots[0]) << deepest), np.int64)
    for level, i, j in trees:
        for l in np.unique(level):
            at = level == l
            block = np.zeros((int(roots[1]) << l, int(roots[0]) << l), np.int64)
            block[j[at], i[at]] = l
            depth = np.maximum(depth, block.repeat(1 << (deepest - l), 0).repeat(1 << (deepest - l), 1))
    return int(round(float((4.0 ** (depth - deepest)).sum())))
