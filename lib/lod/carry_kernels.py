"""Compiled steps of lib.lod.carry.

F (m, 3), of (m, 3), seam (s, 2) and value (w, c) are those of Wedges, corner (m, 3, 3) the positions at the corners.  A
slot is a group of wedges that the thinned mesh has: target (k, 3) is where it lies, carried (k, c) its value,
is_open (k,) that it has none yet.
"""

from lib.compiled import compiled
from lib.lod.closest_kernels import along_edge, on_triangle
from lib.surfaces.row_kernels import join, root_of


@compiled("i8[:,:], i8[:,:], i8[:], i8[:]")
def group_wedges(F, of, went, group):
    """group (w,): one wedge of those that triangles join whose corners are one vertex now; went (n,) where positions
    went."""
    for i in range(len(group)):
        group[i] = i
    for t in range(len(F)):
        for k in range(3):
            j = (k + 1) % 3
            if went[F[t, k]] == went[F[t, j]]:
                join(group, of[t, k], of[t, j])
    for i in range(len(group)):
        group[i] = root_of(group, i)
    return 0


@compiled("i8[:,:], i8[:,:], i8[:], i8[:], i8[:], f8[:,:], i8[:], i8[:,:], f8[:,:]")
def number_slots(F, of, went, group, alive, X, slot, at_corner, target):
    """Slots of the triangles alive (a,): at_corner (a, 3), slot (w,) of each wedge, -1 for none, and target from the
    positions X by root; returns how many."""
    count = 0
    for i in range(len(slot)):
        slot[i] = -1
    for a in range(len(alive)):
        t = alive[a]
        for k in range(3):
            g = group[of[t, k]]
            if slot[g] < 0:
                slot[g] = count
                for c in range(3):
                    target[count, c] = X[went[F[t, k]], c]
                count += 1
            at_corner[a, k] = slot[g]
    for i in range(len(slot)):
        slot[i] = slot[group[i]]
    return count


@compiled("f8[:,:], i8[:], f8[:,:], i8[:], f8[:,:], b1[:], f8[:,:]")
def keep(V, vertex, value, slot, target, is_open, carried):
    """Where a wedge of a slot lies in its place already, its value is the slot's."""
    for i in range(len(slot)):
        s = slot[i]
        if s < 0:
            continue
        v = vertex[i]
        if V[v, 0] == target[s, 0] and V[v, 1] == target[s, 1] and V[v, 2] == target[s, 2]:
            is_open[s] = False
            for c in range(value.shape[1]):
                carried[s, c] = value[i, c]
    return 0


@compiled("i8[:,:], f8[:,:,:], i8[:,:], f8[:,:], i8[:], f8[:,:], b1[:], b1[:], f8[:], f8[:,:]")
def closest_on_seams(of, corner, seam, value, slot, target, is_open, has_seam, square, carried):
    """Values of open slots from the closest seam that ends in them; has_seam (k,): there is one.  square (k,) : inf"""
    for row in range(len(seam)):
        t, i, j = seam[row, 0] // 3, seam[row, 0] % 3, seam[row, 1] % 3
        first, second = of[t, i], of[t, j]
        for end in range(2):
            s = slot[second] if end else slot[first]
            if s < 0:
                continue
            has_seam[s] = True
            if not is_open[s]:
                continue
            found, share = along_edge(corner, t, i, j, target[s, 0], target[s, 1], target[s, 2])
            if found < square[s]:
                square[s] = found
                for c in range(value.shape[1]):
                    carried[s, c] = value[first, c] + share * (value[second, c] - value[first, c])
    return 0


@compiled("i8[:,:], f8[:,:,:], f8[:,:], i8[:], f8[:,:], b1[:], f8[:], f8[:,:]")
def closest_on_triangles(of, corner, value, slot, target, is_open, square, carried):
    """Values of open slots from the closest triangle with a corner in them.  square (k,) : inf"""
    for t in range(len(of)):
        for k in range(3):
            s = slot[of[t, k]]
            if s < 0 or not is_open[s]:
                continue
            if k > 0 and s == slot[of[t, k - 1]]:  # seen already
                continue
            found, a, b, d = on_triangle(corner, t, target[s, 0], target[s, 1], target[s, 2])
            if found < square[s]:
                square[s] = found
                for c in range(value.shape[1]):
                    carried[s, c] = a * value[of[t, 0], c] + b * value[of[t, 1], c] + d * value[of[t, 2], c]
    return 0
