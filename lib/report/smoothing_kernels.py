"""Compiled loop of a smoothing that stops at edges, for pictures of light that random paths have found."""

import numpy as np

from lib.compiled import compiled

NONE, ONE = np.float32(0), np.float32(1)
BINOMIAL = (1, 4, 6, 4, 1)
LEAST = np.float32(1e-6)  # weight in all that says something


@compiled("f4[:,:,:], f4[:,:], f4[:,:,:], f4[:,:,:], i8, f4, f4[:,:,:], f4[:,:]")
def smooth(light, known, normal, place, step, thickness, out, out_known):
    """One wavelet level of light (h, w, 3) whose pixels count by known (h, w), 0 where nothing is known: means over
    5 x 5 pixels, `step` apart, by the weights BINOMIAL along both directions.

    A pixel counts for another by cosine^8 of the angle between their normals (h, w, 3), zero where nothing is seen, and
    by how near its place (h, w, 3) is to the plane there: by half where the square of its distance from that is
    `thickness` times the square of the distance between the two.
    out (h, w, 3), out_known (h, w): the means, and 1 where something was known.
    """
    h, w = known.shape
    for j in range(h):
        for i in range(w):
            nx, ny, nz = normal[j, i, 0], normal[j, i, 1], normal[j, i, 2]
            x, y, z = place[j, i, 0], place[j, i, 1], place[j, i, 2]
            red, green, blue, total = NONE, NONE, NONE, NONE
            for dj in range(-2, 3):
                q = j + dj * step
                if q < 0 or q >= h:
                    continue
                for di in range(-2, 3):
                    p = i + di * step
                    if p < 0 or p >= w or known[q, p] == NONE:
                        continue
                    cosine = nx * normal[q, p, 0] + ny * normal[q, p, 1] + nz * normal[q, p, 2]
                    if cosine <= NONE:
                        continue
                    dx, dy, dz = place[q, p, 0] - x, place[q, p, 1] - y, place[q, p, 2] - z
                    off = nx * dx + ny * dy + nz * dz
                    bound = thickness * (dx * dx + dy * dy + dz * dz)
                    weight = bound / (bound + off * off) if off != NONE else ONE
                    cosine *= cosine
                    cosine *= cosine
                    weight *= cosine * cosine * known[q, p]
                    weight *= np.float32(BINOMIAL[di + 2] * BINOMIAL[dj + 2])
                    red += weight * light[q, p, 0]
                    green += weight * light[q, p, 1]
                    blue += weight * light[q, p, 2]
                    total += weight
            out_known[j, i] = ONE if total > LEAST else NONE
            scale = ONE / total if total > LEAST else NONE
            out[j, i, 0], out[j, i, 1], out[j, i, 2] = red * scale, green * scale, blue * scale
    return 0
