"""Compiled loops over the cells of one level of a quadtree (see lib.elements.quadtree), and the points of elements.

value (h, w, C) float32, hidden (h, w) bool lie on the tree's whole lattice, of which a level's crossings are every
step-th.  Light is the sum of all groups of three channels.  Every kernel writes into the arrays it is given last.
"""

import numpy as np

from lib.compiled import compiled, inlined

NONE, HALF, LARGEST = np.float32(0), np.float32(0.5), np.float32(np.inf)


@inlined
def light(value, j, i, channel):
    """One channel of the light at a crossing."""
    total = value[j, i, channel]
    for c in range(channel + 3, value.shape[2], 3):
        total += value[j, i, c]
    return total


@inlined
def departure(value, hidden, j, i, dj, di):
    """|light - mean of the lights at (j - dj, i - di) and (j + dj, i + di)|, the largest channel; 0 where one of the
    three is hidden."""
    if hidden[j, i] or hidden[j - dj, i - di] or hidden[j + dj, i + di]:
        return NONE
    most = NONE
    for c in range(min(value.shape[2], 3)):
        mean = (light(value, j - dj, i - di, c) + light(value, j + dj, i + di, c)) * HALF
        most = max(most, abs(light(value, j, i, c) - mean))
    return most


@inlined
def departure_of_centre(value, hidden, j, i, half):
    """The same for the middle of a cell against the mean of its corners."""
    a, b, left, right = j - half, j + half, i - half, i + half
    if hidden[j, i] or hidden[a, left] or hidden[a, right] or hidden[b, left] or hidden[b, right]:
        return NONE
    most = NONE
    for c in range(min(value.shape[2], 3)):
        low = (light(value, a, left, c) + light(value, a, right, c)) * HALF
        high = (light(value, b, left, c) + light(value, b, right, c)) * HALF
        most = max(most, abs(light(value, j, i, c) - (low + high) * HALF))
    return most


@compiled("f4[:,:,:], b1[:,:], f4[:,:], b1[:,:], i8, f4, f4[:,:]")
def residuals(value, hidden, noise, divided, step, errors, residual):
    """Largest departure of the five midpoints of each divided cell, less `errors` times their largest noise (h, w), at
    least 0; 0 for others: residual (rows, columns)."""
    half = step // 2
    rows, columns = divided.shape
    for row in range(rows):
        for column in range(columns):
            residual[row, column] = NONE
            if not divided[row, column]:
                continue
            j, i = row * step + half, column * step + half
            worst = departure_of_centre(value, hidden, j, i, half)
            for edge in range(4):
                away, is_row = half * (2 * (edge % 2) - 1), edge < 2
                at_j, at_i = (j + away, i) if is_row else (j, i + away)
                along_j, along_i = (0, half) if is_row else (half, 0)
                worst = max(worst, departure(value, hidden, at_j, at_i, along_j, along_i))
            # A departure within the samples' own noise says nothing.
            doubt = max(noise[j - half, i], noise[j + half, i], noise[j, i - half], noise[j, i + half], noise[j, i])
            residual[row, column] = max(worst - errors * doubt, NONE)
    return 0


@compiled("f4[:,:,:], b1[:,:], i8, f4[:,:]")
def contrasts(value, hidden, step, contrast):
    """Largest difference between visible corners of each cell, over channels: contrast (rows, columns)."""
    rows, columns = contrast.shape
    for row in range(rows):
        for column in range(columns):
            contrast[row, column] = NONE
            for c in range(min(value.shape[2], 3)):
                low, high = LARGEST, -LARGEST
                for corner in range(4):
                    j, i = (row + corner // 2) * step, (column + corner % 2) * step
                    if not hidden[j, i]:
                        here = light(value, j, i, c)
                        low, high = min(low, here), max(high, here)
                contrast[row, column] = max(contrast[row, column], high - low if high >= low else NONE)
    return 0


@compiled("b1[:,:], i8, b1[:,:]")
def mark_crossings(cells, step, crossings):
    """Mark the nine crossings of each of the cells (rows, columns): corners and midpoints, on a lattice (h, w) of which
    they are every step-th."""
    rows, columns = cells.shape
    for row in range(rows):
        for column in range(columns):
            if cells[row, column]:
                for j in range(2 * row, 2 * row + 3):
                    for i in range(2 * column, 2 * column + 3):
                        crossings[j * step, i * step] = True
    return 0


@compiled("b1[:,:], b1[:,:], b1[:,:], i8, i8[:,:]")
def number_parts(blocked_u, blocked_v, usable, side, label):
    """Number of the part of each point within its element of side x side points: the least number j side + i of the
    points it hangs together with, -1 where not usable; label (rows, columns) comes back.

    blocked_u (rows, columns - 1), blocked_v (rows - 1, columns): links between neighbours that do not hold.
    """
    rows, columns = usable.shape
    for j in range(rows):
        for i in range(columns):
            label[j, i] = j % side * side + i % side if usable[j, i] else -1
    for row in range(rows // side):
        for column in range(columns // side):
            top, left, changes = row * side, column * side, True
            while changes:  # numbers sink along the links
                changes = False
                for j in range(top, top + side):
                    for i in range(left, left + side):
                        if not usable[j, i]:
                            continue
                        least = label[j, i]
                        if i > left and usable[j, i - 1] and not blocked_u[j, i - 1]:
                            least = min(least, label[j, i - 1])
                        if i < left + side - 1 and usable[j, i + 1] and not blocked_u[j, i]:
                            least = min(least, label[j, i + 1])
                        if j > top and usable[j - 1, i] and not blocked_v[j - 1, i]:
                            least = min(least, label[j - 1, i])
                        if j < top + side - 1 and usable[j + 1, i] and not blocked_v[j, i]:
                            least = min(least, label[j + 1, i])
                        if least < label[j, i]:
                            label[j, i] = least
                            changes = True
    return 0
