"""Compiled loop over the rays of a picture: what a texture shows where they hit."""

from math import floor

import numpy as np

from lib.compiled import compiled, inlined

WHOLE = np.float32(1)
CLAMP, REPEAT, MIRROR = 0, 1, 2


@compiled("i8[:], i8[:], f8[:,:], f8[:,:,:], u1[:,:,:], f4[:], i8, i8, f4[:,:]")
def multiply(some, face, weight, ST, texels, light, wrap_s, wrap_t, colour):
    """Multiply colour (n, 3) of the hits `some` by the light of a texture there, as lib.report.picture.lookup has it.

    face (n,), weight (n, 3) : of all hits;  ST (n_f, 3, 2) : texture coordinates of the corners
    texels (h, w, 3), light (256,) : codes and the linear light of each;  wrap_s, wrap_t : CLAMP, REPEAT or MIRROR
    """
    h, w, _ = texels.shape
    for n in some:
        f = face[n]
        s = weight[n, 0] * ST[f, 0, 0] + weight[n, 1] * ST[f, 1, 0] + weight[n, 2] * ST[f, 2, 0]
        t = weight[n, 0] * ST[f, 0, 1] + weight[n, 1] * ST[f, 1, 1] + weight[n, 2] * ST[f, 2, 1]
        x, y = s * w - 0.5, t * h - 0.5
        i, j = int(floor(x)), int(floor(y))
        a, b = np.float32(x - i), np.float32(y - j)
        left, right = wrapped(i, w, wrap_s), wrapped(i + 1, w, wrap_s)
        above, below = wrapped(j, h, wrap_t), wrapped(j + 1, h, wrap_t)
        for c in range(3):
            upper = (WHOLE - a) * light[texels[above, left, c]] + a * light[texels[above, right, c]]
            lower = (WHOLE - a) * light[texels[below, left, c]] + a * light[texels[below, right, c]]
            colour[n, c] *= (WHOLE - b) * upper + b * lower
    return 0


@inlined
def wrapped(k, n, how):
    """The texel, of n, that one of number k beyond the border stands for."""
    if how == CLAMP:
        return min(max(k, 0), n - 1)
    if how == MIRROR:
        k = k % (2 * n)
        return min(k, 2 * n - 1 - k)
    return k % n
