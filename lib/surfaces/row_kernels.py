"""Compiled look-ups of rows and joining of nodes (see lib.surfaces.rows and lib.surfaces.pieces).

Rows (n, c) are the bits of float64 numbers, read as integers.  A table (size,) of a power of two, with a place free,
holds numbers of rows, -1 where it is free: a row stands at the place that its hash says, or the next free one.
"""

from lib.compiled import compiled, inlined

MIX = -7046029254386353131  # odd, bits without a pattern: 2^64 (1 / golden ratio - 1)


@inlined
def place_of(rows, i, known, first, table):
    """Where row i has its place in the table of rows known[first]: the place of its equal, or a free one."""
    place = 0
    for c in range(rows.shape[1]):
        place = (place ^ rows[i, c]) * MIX
        place ^= (place >> 32) & 0xFFFFFFFF
    place &= len(table) - 1
    while table[place] >= 0:
        other = first[table[place]]
        is_same = True
        for c in range(rows.shape[1]):
            is_same = is_same and rows[i, c] == known[other, c]
        if is_same:
            return place
        place = (place + 1) & (len(table) - 1)
    return place


@compiled("i8[:,:], i8[:], i8[:], i8[:]")
def number_rows(rows, table, number, first):
    """The number (n,) of each row, and the first row of each number (n,); returns how many numbers there are."""
    count = 0
    for i in range(len(rows)):
        place = place_of(rows, i, rows, first, table)
        if table[place] < 0:
            table[place], first[count] = count, i
            count += 1
        number[i] = table[place]
    return count


@compiled("i8[:,:], i8[:,:], i8[:], i8[:], b1[:]")
def find_rows(rows, known, first, table, is_known):
    """is_known (n,): rows that are among known[first], whose table it is."""
    for i in range(len(rows)):
        is_known[i] = table[place_of(rows, i, known, first, table)] >= 0
    return 0


@inlined
def root_of(root, node):
    """The end of the way from a node to its root, which gets shorter."""
    while root[node] != node:
        root[node] = root[root[node]]
        node = root[node]
    return node


@inlined
def join(root, a, b):
    """Make the pieces of two nodes one, whose root is the smaller one."""
    a, b = root_of(root, a), root_of(root, b)
    if a < b:
        root[b] = a
    else:
        root[a] = b


@compiled("i8[:], i8[:], i8[:]")
def join_all(a, b, root):
    """Number the pieces that edges (a[k], b[k]) join, by their first nodes; root (n,), each node its own, becomes the
    numbers."""
    for k in range(len(a)):
        join(root, a[k], b[k])
    count = 0
    for node in range(len(root)):
        if root[node] == node:
            root[node] = count
            count += 1
        else:
            root[node] = root[root[node]]  # smaller, so numbered already
    return count
