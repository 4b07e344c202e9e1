"""Which job handles which surface: fixed by the surfaces' work alone, so that every machine cuts the same chunks."""

import numpy as np


def assign(work, n_chunks):
    """Chunk of each surface, (n,) int: longest work first, each to the chunk with the least so far; ties to the lowest number.

    >>> assign([5, 1, 4, 2], 2).tolist()
    [0, 0, 1, 1]
    """
    work = np.asarray(work, dtype=np.float64)
    load, chunk = np.zeros(n_chunks), np.zeros(len(work), dtype=np.int64)
    for s in np.argsort(-work, kind="stable"):
        chunk[s] = np.argmin(load)
        load[chunk[s]] += work[s]
    return chunk
