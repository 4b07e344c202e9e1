"""Which nodes of a graph hang together."""

import numpy as np


def pieces(n, a, b):
    """(n,) int64: the piece of each of n nodes that edges (a[k], b[k]) (m,) join, numbered by their first nodes.

    Every round hangs the larger root of an edge below the smaller and then shortens all ways to the roots
    (Shiloach, Vishkin 1982): some ten rounds for millions of edges.  scipy's connected_components is as fast, but takes
    0.25 CPU s to load.

    >>> pieces(6, [0, 4], [3, 1]).tolist()
    [0, 1, 2, 0, 1, 3]
    """
    root, a, b = np.arange(n), np.asarray(a, dtype=np.int64).ravel(), np.asarray(b, dtype=np.int64).ravel()
    while True:
        a, b = root[a], root[b]
        apart = a != b
        if not apart.any():
            break
        a, b = np.minimum(a[apart], b[apart]), np.maximum(a[apart], b[apart])
        np.minimum.at(root, b, a)
        above = root[root]
        while (above != root).any():
            root, above = above, above[above]
    is_root = root == np.arange(n)
    return (np.cumsum(is_root) - 1)[root]
