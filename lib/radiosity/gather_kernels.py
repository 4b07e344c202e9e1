"""Compiled loops of the final gather: what rays see in the radiosity maps, and the rays that follow near hits.

Arrays of rays hold those of a sample together.  `faces` (f, 6) are rows s, t, ds_a, dt_a, ds_b, dt_b in texels of the
map of each face's surface; `surface` (f,) that surface; `places` (surfaces, 3) the first texel of its map, the texels
of a row, and the rows; `texels` (total, 4 G) hold for each light group weight times radiosity, and the weight.  Every
kernel writes into arrays it is given.
"""

import numpy as np

from lib.compiled import compiled, inlined
from lib.elements.lattice import OFFSET
from lib.visibility.ray_kernels import TURN, cosine_direction

NONE, ONE = np.float32(0), np.float32(1)
CLOSEST = np.float32(1e-6)


@inlined
def mixed(texels, first, above, c, f, g):
    """Bilinear mean of column c of texels first, first + 1, above, above + 1."""
    low = texels[first, c] + f * (texels[first + 1, c] - texels[first, c])
    high = texels[above, c] + f * (texels[above + 1, c] - texels[above, c])
    return low + g * (high - low)


@inlined
def look_up(faces, surface, places, texels, face, a, b, out, row):
    """Put the mean radiosity of the four texels round a hit, by bilinear weights, into out[row, :]."""
    s = faces[face, 0] + a * faces[face, 2] + b * faces[face, 4]
    t = faces[face, 1] + a * faces[face, 3] + b * faces[face, 5]
    map_of = surface[face]
    width = places[map_of, 1]
    i = min(max(np.int64(s), 0), width - 2)
    j = min(max(np.int64(t), 0), places[map_of, 2] - 2)
    f, g = s - np.float32(i), t - np.float32(j)
    first = places[map_of, 0] + j * width + i
    above = first + width
    for c in range(0, texels.shape[1], 4):  # four columns side by side are one vector of the machine
        x, y = mixed(texels, first, above, c, f, g), mixed(texels, first, above, c + 1, f, g)
        z, weight = mixed(texels, first, above, c + 2, f, g), mixed(texels, first, above, c + 3, f, g)
        scale = ONE / weight if weight > NONE else ONE
        channel = c // 4 * 3
        out[row, channel], out[row, channel + 1], out[row, channel + 2] = x * scale, y * scale, z * scale


@compiled(
    "f4[:,:], i8[:], i8[:,:], f4[:,:], f4[:], i4[:], f4[:], f4[:], f4[:], b1[:], i8, f4[:,:], i8[:]",
)
def see(faces, surface, places, texels, near, face, a, b, t, is_back, follows, seen, chosen):
    """Radiosity seen (n, 3 G) by rays, 0 for misses and back faces.

    near (surfaces,) : front hits nearer than that are not looked up but listed in chosen (n,), if follows; returns how
    many.
    """
    n_chosen = 0
    for r in range(len(face)):
        if face[r] < 0 or is_back[r]:
            for c in range(seen.shape[1]):
                seen[r, c] = NONE
        elif follows and t[r] < near[surface[face[r]]]:
            chosen[n_chosen] = r
            n_chosen += 1
        else:
            look_up(faces, surface, places, texels, face[r], a[r], b[r], seen, r)
    return n_chosen


@compiled(
    "i8[:], i4[:], f4[:], f8[:,:], f4[:,:], f4[:,:], i8[:], i8, f8[:,:], f8[:], f8[:,:], f4[:,:], f4[:,:], i8[:]",
)
def onward(chosen, face, t, normal, origins, D, ray, K, shift, step, turn, origins_on, D_on, ray_on):
    """One cosine ray each from the hits of the chosen rays.

    chosen (m,) of rays with origins, D (n, 3) and numbers ray (n,), K to a sample of shifts (samples, 2)
    normal (f, 3) of the faces; step (2,), turn (2, 2) as in `qmc.path_steps`; origins_on, D_on, ray_on (m,) come back.
    """
    for m in range(len(chosen)):
        r = chosen[m]
        f, number = face[r], ray[r]
        x, y, z = normal[f, 0], normal[f, 1], normal[f, 2]
        k, sample = number % K, number // K
        p = k * step[0] + shift[sample, 0] * turn[0, 0] + shift[sample, 1] * turn[0, 1]
        q = k * step[1] + shift[sample, 0] * turn[1, 0] + shift[sample, 1] * turn[1, 1]
        p, q = np.float32(p - np.floor(p)), np.float32(q - np.floor(q))
        dx, dy, dz = cosine_direction(np.float32(x), np.float32(y), np.float32(z), p, TURN * q)
        D_on[m, 0], D_on[m, 1], D_on[m, 2] = dx, dy, dz
        origins_on[m, 0] = origins[r, 0] + t[r] * D[r, 0] + x * OFFSET
        origins_on[m, 1] = origins[r, 1] + t[r] * D[r, 1] + y * OFFSET
        origins_on[m, 2] = origins[r, 2] + t[r] * D[r, 2] + z * OFFSET
        ray_on[m] = number
    return 0


@compiled("f4[:,:], i8[:], i8[:,:], f4[:,:], f4[:,:], i8[:], i4[:], f4[:], f4[:], f4[:,:], f4[:,:]")
def reflect(faces, surface, places, direct, rho, chosen, face, a, b, H, seen):
    """Radiosity seen by the chosen rays: direct light by its maps, and rho (surfaces, 3 G) times the irradiance H
    (m, 3 G)."""
    for m in range(len(chosen)):
        r = chosen[m]
        look_up(faces, surface, places, direct, face[r], a[r], b[r], seen, r)
        for c in range(seen.shape[1]):
            seen[r, c] += rho[surface[face[r]], c] * H[m, c]
    return 0


@compiled("f4[:,:], f4[:], i8, f4[:,:], f4[:], f4[:]")
def summed(seen, t, K, H, deviation, reach):
    """Over the K rays of each sample: mean of seen (n K, C), H (n, C); standard deviation, all groups of three channels
    together, largest of the three, (n,); harmonic mean of the distances t, (n,)."""
    C = seen.shape[1]
    for i in range(len(H)):
        first = i * K
        x, y, z, xx, yy, zz, nearness = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for r in range(first, first + K):
            red, green, blue = 0.0, 0.0, 0.0
            for g in range(0, C, 3):
                red, green, blue = red + seen[r, g], green + seen[r, g + 1], blue + seen[r, g + 2]
            x, y, z = x + red, y + green, z + blue
            xx, yy, zz = xx + red * red, yy + green * green, zz + blue * blue
            nearness += ONE / max(t[r], CLOSEST)
        largest = max(xx - x * x / K, yy - y * y / K, zz - z * z / K, 0.0) / K
        H[i, 0], H[i, 1], H[i, 2] = x / K, y / K, z / K
        if C > 3:
            for g in range(C):
                own = 0.0
                for r in range(first, first + K):
                    own += seen[r, g]
                H[i, g] = own / K
        deviation[i] = np.sqrt(largest)
        reach[i] = K / nearness
    return 0
