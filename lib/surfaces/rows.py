"""Equal rows of arrays, found in a table by the hash of their bits: two to four times as fast as sorting the hashes
(measured, 400 k rows of 3)."""

import numpy as np

from lib.surfaces import row_kernels as kernels


def numbered(rows):
    """(number (n,) of each row (n, c), first (k,) row of each number), in the order in which the rows first stand.

    >>> numbered(np.array([[5.0, 1.0], [2.0, 1.0], [5.0, 1.0], [-0.0, 0.0], [0.0, 0.0]]))
    (array([0, 1, 0, 2, 2]), array([0, 1, 3]))
    """
    number, first, _ = _numbered(_bits(rows))
    return number, first


class Rows:
    """Rows (n, c) to look others up in."""

    def __init__(self, rows):
        self._known = _bits(rows)
        _, self._first, self._table = _numbered(self._known)

    def holds(self, rows):
        """(m,) bool: rows (m, c) that are among these.

        >>> Rows(np.eye(3)).holds(np.array([[0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])).tolist()
        [True, False]
        """
        is_known = np.empty(len(rows), dtype=bool)
        kernels.find_rows(_bits(rows), self._known, self._first, self._table, is_known)
        return is_known


def _numbered(bits):
    """(number (n,), first (k,), the table that says so) of rows as integers (n, c)."""
    table = np.full(1 << (2 * len(bits)).bit_length(), -1)  # at most half full: rows are a step or two from their place
    number, first = np.empty(len(bits), dtype=np.int64), np.empty(len(bits), dtype=np.int64)
    count = kernels.number_rows(bits, table, number, first)
    return number, first[:count].copy(), table


def _bits(rows):
    """Rows as integers (n, c); those of -0 are those of 0."""
    return np.ascontiguousarray(np.asarray(rows, dtype=np.float64) + 0.0).view(np.int64)
