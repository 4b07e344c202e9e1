"""Which samples are buried in other things, judged by the back faces their rays meet."""

import numpy as np

BURIED_IN_SHELL = 0.10  # share of rays that meet the inside of a closed shell
BEHIND_ALL = 0.90  # share of rays that meet any back face: the back of an open sheet alone hides nothing


def is_hidden(is_back, in_shell, cast=None):
    """(n,) bool from rays (n, K): is_back, the ray meets a back face; in_shell, that face is part of a closed shell."""
    rays = is_back.shape[1] if cast is None else np.maximum(cast, 1)
    inside = (is_back & in_shell).sum(axis=1)
    return (inside > BURIED_IN_SHELL * rays) | (is_back.sum(axis=1) > BEHIND_ALL * rays)
