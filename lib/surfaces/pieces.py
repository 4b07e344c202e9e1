"""Which nodes of a graph hang together."""

import numpy as np

from lib.surfaces import row_kernels as kernels


def pieces(n, a, b):
    """(n,) int64: the piece of each of n nodes that edges (a[k], b[k]) (m,) join, numbered by their first nodes.

    Trees of nodes are hung below each other, ways to the roots halved on the way (Tarjan, Leeuwen 1984).

    >>> pieces(6, [0, 4], [3, 1]).tolist()
    [0, 1, 2, 0, 1, 3]
    """
    root = np.arange(n)
    kernels.join_all(*(np.ascontiguousarray(x, dtype=np.int64).ravel() for x in (a, b)), root)
    return root
