"""Which job handles which surface: fixed by the scene and the number of chunks alone, so that every machine cuts the
same chunks.
"""

import numpy as np


def members(has_map, n_chunks, chunk):
    """Surfaces of a chunk, ascending: every n_chunks-th of those with maps.

    Surfaces are ordered by name, so the like pieces of one object, and the walls of a room, spread over the chunks.

    >>> members(np.array([True, False, True, True]), 2, 0).tolist()
    [0, 3]
    """
    return np.flatnonzero(has_map)[chunk::n_chunks]
