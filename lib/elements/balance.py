"""2:1 balance of a quadtree over edges and corners.

Baum et al. 1991 balance over edges; here corners count too, so that every leaf finds its eight neighbours within one
level. A tree is a list `divided`: divided[l] is (n_v 2^l, n_u 2^l) bool, the cells of level l that have children.
"""


def balance(divided, closed=(False, False)):
    """The smallest balanced tree that contains the given one: a new list of arrays.

    From the finest level up: wherever a cell is divided, its eight neighbours must exist, so their parents are divided.
    """
    divided = [level.copy() for level in divided]
    for level in range(len(divided) - 1, 0, -1):
        divided[level - 1] |= parents(grow(divided[level], closed))
    return divided


def parents(cells):
    """(rows / 2, columns / 2) bool: parents of any of the cells (rows, columns)."""
    rows, columns = cells.shape
    return cells.reshape(rows // 2, 2, columns // 2, 2).any(axis=(1, 3))


def children(cells):
    """(2 rows, 2 columns) bool: the four children of each cell."""
    return cells.repeat(2, axis=0).repeat(2, axis=1)


def grow(cells, closed=(False, False)):
    """Cells and their eight neighbours; across the seam where u or v is closed."""
    cells = _grow_along(cells, 1, closed[0])
    return _grow_along(cells, 0, closed[1])


def _grow_along(cells, axis, closed):
    grown = cells.copy()
    source, target = (cells.T, grown.T) if axis else (cells, grown)
    target[1:] |= source[:-1]
    target[:-1] |= source[1:]
    if closed:
        target[0] |= source[-1]
        target[-1] |= source[0]
    return grown


def is_balanced(divided, closed=(False, False)):
    """True when leaves that share an edge or a corner differ by at most one level."""
    return all((a == b).all() for a, b in zip(divided, balance(divided, closed), strict=True))
