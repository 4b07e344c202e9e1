"""Compiled: which triangles between points of loops lie inside the loops."""

from lib.compiled import compiled, inlined
from lib.surfaces.row_kernels import MIX, join, root_of

FREE = -1


@inlined
def slot_of(keys, key):
    """Where `key` stands in the table keys (size,), a power of two, or the free place it may take."""
    place = key * MIX
    place = (place ^ ((place >> 32) & 0xFFFFFFFF)) & (len(keys) - 1)
    while keys[place] != FREE and keys[place] != key:
        place = (place + 1) & (len(keys) - 1)
    return place


@compiled("f8[:,:], i8[:,:], i8[:,:], f8, i8[:], i8[:], i8[:], f8[:], i8[:], b1[:]")
def inside(points, F, loops, nothing, keys, owner, root, area, largest, within):
    """within (m,) bool: triangles F (m, 3) of points (n, 2) inside the edges `loops` (e, 2), told by the largest
    triangle of each region between them; none in regions whose largest one is at most `nothing` of all.

    An edge that loops use twice, there and back, is no border.
    keys, owner (size,) : FREE everywhere, more than 3 m + e places, a power of two;  root (m,) : ascending from 0
    area (m,), largest (m,) : room for areas and the largest triangle of a region
    """
    n, total = len(points), 0.0
    for k in range(len(loops)):
        slot = slot_of(keys, min(loops[k, 0], loops[k, 1]) * n + max(loops[k, 0], loops[k, 1]))
        keys[slot] = min(loops[k, 0], loops[k, 1]) * n + max(loops[k, 0], loops[k, 1])
        owner[slot] = -3 - owner[slot]  # an odd number of uses: -2, an even one: -1
    for i in range(len(F)):
        for k in range(3):
            a, b = F[i, k], F[i, (k + 1) % 3]
            slot = slot_of(keys, min(a, b) * n + max(a, b))
            keys[slot] = min(a, b) * n + max(a, b)
            if owner[slot] >= 0:
                join(root, owner[slot], i)
            elif owner[slot] == FREE:
                owner[slot] = i
        a, b, c = F[i, 0], F[i, 1], F[i, 2]
        x, y = points[a, 0], points[a, 1]
        area[i] = ((points[b, 0] - x) * (points[c, 1] - y) - (points[b, 1] - y) * (points[c, 0] - x)) / 2
        total += area[i]
        largest[i] = i
    for i in range(len(F)):
        k = root_of(root, i)
        if area[i] > area[largest[k]]:
            largest[k] = i
    for i in range(len(F)):
        if root_of(root, i) == i:
            k = largest[i]
            within[i] = area[k] > nothing * total and is_odd(points, F, loops, k)
    for i in range(len(F)):
        within[i] = within[root_of(root, i)]
    return 0


@inlined
def is_odd(points, F, loops, k):
    """Does a ray along x from the middle of triangle k cross the loops an odd number of times?"""
    x = (points[F[k, 0], 0] + points[F[k, 1], 0] + points[F[k, 2], 0]) / 3
    y = (points[F[k, 0], 1] + points[F[k, 1], 1] + points[F[k, 2], 1]) / 3
    odd = False
    for e in range(len(loops)):
        low, high = loops[e, 0], loops[e, 1]
        if points[low, 1] > points[high, 1]:
            low, high = high, low
        if points[low, 1] <= y and y < points[high, 1]:
            dx, dy = points[high, 0] - points[low, 0], points[high, 1] - points[low, 1]
            if (x - points[low, 0]) * dy < (y - points[low, 1]) * dx:
                odd = not odd
    return odd
