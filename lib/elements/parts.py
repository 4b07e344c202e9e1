"""Elements that something stands on: which of their points see each other along the surface.

A floor may run on under a wall.  An element with points in two rooms would carry light from one to the other, and so
would a lookup between two elements with the wall between them.  So neighbouring points are asked whether anything
stands between them.
"""

from dataclasses import dataclass

import numpy as np

from lib.elements.grids import POINTS, by_element
from lib.elements.tree_kernels import number_parts


@dataclass(frozen=True)
class Parts:
    """keeps (k, 16) bool: points of the largest part of each element that hangs together, of its usable points
    is_alone (k,) bool: the element is in parts, or cut off from a neighbour: no interpolation reaches across it."""

    keeps: np.ndarray
    is_alone: np.ndarray


def parts(blocked_u, blocked_v, usable):
    """Parts of the elements of a grid.

    blocked_u (4 n_v, 4 n_u - 1), blocked_v (4 n_v - 1, 4 n_u) bool: something stands between two neighbouring points;
    usable (4 n_v, 4 n_u) bool: points that count.
    """
    rows, columns = usable.shape
    label = _components(blocked_u, blocked_v, usable)
    label = by_element(label)
    first = np.arange(len(label))[:, None] * (POINTS**2 + 1)  # -1 counts as the number 16
    counts = np.bincount((first + label % (POINTS**2 + 1)).ravel(), minlength=len(label) * (POINTS**2 + 1))
    counts = counts.reshape(len(label), -1)[:, :-1]
    largest = counts.argmax(axis=1)
    keeps = label == largest[:, None]
    is_cut = (counts > 0).sum(axis=1) > 1
    n_v, n_u = rows // POINTS, columns // POINTS
    walled = is_cut.reshape(n_v, n_u).copy()
    across = blocked_u[:, POINTS - 1 :: POINTS].reshape(n_v, POINTS, n_u - 1).all(axis=1)
    walled[:, :-1] |= across
    walled[:, 1:] |= across
    along = blocked_v[POINTS - 1 :: POINTS].reshape(n_v - 1, n_u, POINTS).all(axis=2)
    walled[:-1] |= along
    walled[1:] |= along
    return Parts(keeps, walled.ravel())


def _components(blocked_u, blocked_v, usable):
    """Number of the part of each point within its element, 0..15; -1 where not usable.  (4 n_v, 4 n_u)."""
    label = np.empty(usable.shape, dtype=np.int64)
    number_parts(*(np.ascontiguousarray(a) for a in (blocked_u, blocked_v, usable)), POINTS, label)
    return label
