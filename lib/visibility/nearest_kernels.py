"""Compiled searches for the closest point of triangles, in a tree of boxes (see lib.visibility.nearest).

The tree is a heap: node i has the children 2 i and 2 i + 1, of those from `leaves` on each holds an equal share of the
m triangles, leaf j those from m j // leaves on.  box (2 leaves, 6) are the least and largest coordinates.
"""

import math

import numpy as np

from lib.compiled import compiled, inlined

LEAF = 4  # triangles at most; with 2 or 8 a search takes a tenth longer


@inlined
def select(middle, axis, order, first, end, split):
    """Order the numbers in order[first:end] so that none before `split` has a larger middle than one after it."""
    low, high = first, end - 1
    while low < high:
        pivot = middle[order[(low + high) // 2], axis]
        i, j = low, high
        while i <= j:
            while middle[order[i], axis] < pivot:
                i += 1
            while middle[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if split <= j:
            high = j
        elif split >= i:
            low = i
        else:
            return


@compiled("f8[:,:,:], i8, f8[:,:], i8[:], f8[:,:]")
def plant(corner, leaves, middle, order, box):
    """Make the tree: order (m,) of the triangles, and the boxes.  What a node holds is halved where it is longest.

    middle (m, 3) : scratch
    """
    m = len(corner)
    for t in range(m):
        order[t] = t
        for c in range(3):
            middle[t, c] = corner[t, 0, c] + corner[t, 1, c] + corner[t, 2, c]
    width = leaves
    while width > 1:
        for j in range(leaves // width):
            first, end = m * (j * width) // leaves, m * ((j + 1) * width) // leaves
            split = m * (j * width + width // 2) // leaves
            axis, longest = 0, -1.0
            for c in range(3):
                low, high = np.inf, -np.inf
                for k in range(first, end):
                    x = middle[order[k], c]
                    low, high = min(low, x), max(high, x)
                if high - low > longest:
                    axis, longest = c, high - low
            select(middle, axis, order, first, end, split)
        width //= 2
    for node in range(2 * leaves - 1, 0, -1):
        for c in range(3):
            if node < leaves:
                box[node, c] = min(box[2 * node, c], box[2 * node + 1, c])
                box[node, 3 + c] = max(box[2 * node, 3 + c], box[2 * node + 1, 3 + c])
                continue
            box[node, c], box[node, 3 + c] = np.inf, -np.inf
            for t in range(m * (node - leaves) // leaves, m * (node - leaves + 1) // leaves):
                for k in range(3):
                    box[node, c] = min(box[node, c], corner[order[t], k, c])
                    box[node, 3 + c] = max(box[node, 3 + c], corner[order[t], k, c])
    return 0


@inlined
def square_to_box(box, node, x, y, z):
    """Squared distance of a point from a node's box."""
    dx = max(box[node, 0] - x, x - box[node, 3], 0.0)
    dy = max(box[node, 1] - y, y - box[node, 4], 0.0)
    dz = max(box[node, 2] - z, z - box[node, 5], 0.0)
    return dx * dx + dy * dy + dz * dz


@inlined
def beyond(corner, t, c, x):
    """How far coordinate c of a point lies outside of what triangle t spans."""
    a, b, d = corner[t, 0, c], corner[t, 1, c], corner[t, 2, c]
    return max(min(a, b, d) - x, x - max(a, b, d), 0.0)


@inlined
def square_to_span(corner, t, x, y, z):
    """Squared distance of a point from the box of triangle t."""
    dx, dy, dz = beyond(corner, t, 0, x), beyond(corner, t, 1, y), beyond(corner, t, 2, z)
    return dx * dx + dy * dy + dz * dz


@inlined
def along_edge(corner, t, i, j, x, y, z):
    """(squared distance, share of j): the closest point to (x, y, z) of the edge from corner i to j of triangle t."""
    ax, ay, az = corner[t, i, 0], corner[t, i, 1], corner[t, i, 2]
    dx, dy, dz = corner[t, j, 0] - ax, corner[t, j, 1] - ay, corner[t, j, 2] - az
    share = ((x - ax) * dx + (y - ay) * dy + (z - az) * dz) / max(dx * dx + dy * dy + dz * dz, 1e-300)
    share = min(max(share, 0.0), 1.0)
    ox, oy, oz = ax + share * dx - x, ay + share * dy - y, az + share * dz - z
    return ox * ox + oy * oy + oz * oz, share


@inlined
def on_triangle(corner, t, x, y, z):
    """(squared distance, weights of the three corners): the closest point to (x, y, z) of triangle t."""
    ax, ay, az = corner[t, 0, 0], corner[t, 0, 1], corner[t, 0, 2]
    ex, ey, ez = corner[t, 1, 0] - ax, corner[t, 1, 1] - ay, corner[t, 1, 2] - az
    fx, fy, fz = corner[t, 2, 0] - ax, corner[t, 2, 1] - ay, corner[t, 2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    ee, ef, ff = ex * ex + ey * ey + ez * ez, ex * fx + ey * fy + ez * fz, fx * fx + fy * fy + fz * fz
    pe, pf = px * ex + py * ey + pz * ez, px * fx + py * fy + pz * fz
    det = max(ee * ff - ef * ef, 1e-300)
    b, c = (ff * pe - ef * pf) / det, (ee * pf - ef * pe) / det
    if b >= 0 and c >= 0 and b + c <= 1:
        ox, oy, oz = b * ex + c * fx - px, b * ey + c * fy - py, b * ez + c * fz - pz
        return ox * ox + oy * oy + oz * oz, 1 - b - c, b, c
    # Outside, the closest point lies on one of the edges.
    least, best, share = np.inf, 0, 0.0
    for k in range(3):
        square, s = along_edge(corner, t, k, (k + 1) % 3, x, y, z)
        if square < least:
            least, best, share = square, k, s
    if best == 0:
        return least, 1 - share, share, 0.0
    if best == 1:
        return least, 0.0, 1 - share, share
    return least, share, 0.0, 1 - share


@inlined
def search(corner, box, leaves, x, y, z, enough, t, nodes, squares):
    """(squared distance, triangle) of the closest of all triangles, or of one that is at most `enough` off; t is the
    first one tried."""
    best, found, top = on_triangle(corner, t, x, y, z)[0], t, 1
    nodes[0], squares[0] = 1, square_to_box(box, 1, x, y, z)
    while top > 0 and best > enough:
        top -= 1
        if squares[top] >= best:
            continue
        node = nodes[top]
        if node < leaves:
            near, far = 2 * node, 2 * node + 1
            to_near, to_far = square_to_box(box, near, x, y, z), square_to_box(box, far, x, y, z)
            if to_far < to_near:
                near, far, to_near, to_far = far, near, to_far, to_near
            if to_far < best:
                nodes[top], squares[top] = far, to_far
                top += 1
            if to_near < best:
                nodes[top], squares[top] = near, to_near
                top += 1
            continue
        for k in range(len(corner) * (node - leaves) // leaves, len(corner) * (node - leaves + 1) // leaves):
            if square_to_span(corner, k, x, y, z) >= best:
                continue
            square = on_triangle(corner, k, x, y, z)[0]
            if square < best:
                best, found = square, k
    return best, found


@compiled("f8[:,:,:], f8[:,:], i8, f8[:,:], b1[:], f8, i8[:], f8[:], f8[:]")
def distances(corner, box, leaves, points, is_exact, most, nodes, squares, out):
    """Distances (n,) of points; of those that are not is_exact, any triangle's that is no larger than `most`, or than
    the largest distance before.

    nodes, squares (64,) : scratch
    """
    t = 0
    for i in range(len(points)):
        enough = 0.0 if is_exact[i] else most * most
        square, t = search(corner, box, leaves, points[i, 0], points[i, 1], points[i, 2], enough, t, nodes, squares)
        out[i] = math.sqrt(square)
        most = max(most, out[i])
    return 0


@compiled("f8[:,:,:], f8[:,:], i8, f8[:,:], i8[:], f8[:], i8[:], f8[:,:]")
def places(corner, box, leaves, points, nodes, squares, triangle, weight):
    """The closest triangle (n,) to points (n, 3), and weights (n, 3) of its corners at the closest point.

    nodes, squares (64,) : scratch
    """
    t = 0
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        _, t = search(corner, box, leaves, x, y, z, 0.0, t, nodes, squares)
        _, weight[i, 0], weight[i, 1], weight[i, 2] = on_triangle(corner, t, x, y, z)
        triangle[i] = t
    return 0
