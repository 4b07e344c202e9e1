"""Compiled loops over the texels of maps: 8-bit codes of linear light, the two halves of push and pull, brightness.

Texels are (h, w, 3).  Every kernel writes into the arrays it is given last.
"""

import numpy as np

from lib.compiled import compiled, inlined

NONE, WHOLE, MOST_CODE = np.float32(0), np.float32(1), 255
LINEAR_END, LINEAR_SLOPE = np.float32(0.0031308), np.float32(255 * 12.92)  # the straight piece of the sRGB curve
KEPT = 23 - 10  # of the 23 bits of a float32's mantissa the upper ten choose a piece of the curve
FIRST_PIECE = int(np.float32(2.0**-9).view(np.int32)) >> KEPT  # 2^-9 < LINEAR_END
N_PIECES = (int(WHOLE.view(np.int32)) >> KEPT) - FIRST_PIECE + 1  # the last one holds 1 alone
UNSURE = np.float32(5e-4)  # of a code: above the error of `codes` and of the curve in float32, 2e-4 each at most
BUCKET_BITS = 16  # of a float32 >= 0, as an integer in the same order
DROPPED = 32 - BUCKET_BITS
SHRUNK, RAISED = np.float32(0.998), np.float32(0.001)


@compiled("f4[:,:,:], i4[:,:,:], f4[:,:], f4[:], f4[:,:], u1[:,:,:], i8[:]")
def codes(linear, bits, row, column, pieces, code, unsure):
    """8-bit sRGB codes (h, w, 3) of linear light, dithered: floor(255 sRGB(x) + threshold), at most 255.

    bits : the same memory as `linear`, finite numbers;  row (h, 3), column (w,) : what thresholds are made of
    pieces (N_PIECES, 2) : a and b of the chords a + b x of 255 sRGB(x) that stand for it
    Returns how many places are too near to the next code to be told by the chords, their numbers first in `unsure`.
    """
    h, w, _ = linear.shape
    n_unsure = 0
    for j in range(h):
        for i in range(w):
            for c in range(3):
                x = min(max(linear[j, i, c], NONE), WHOLE)
                if x <= LINEAR_END:
                    scaled = LINEAR_SLOPE * x
                else:
                    k = min((bits[j, i, c] >> KEPT) - FIRST_PIECE, N_PIECES - 1)
                    scaled = pieces[k, 0] + pieces[k, 1] * x
                scaled += threshold(row[j, c], column[i])
                whole = np.int32(scaled)
                rest = scaled - np.float32(whole)
                code[j, i, c] = np.uint8(min(whole, MOST_CODE))
                if rest < UNSURE or rest > WHOLE - UNSURE:
                    unsure[n_unsure] = (j * w + i) * 3 + c
                    n_unsure += 1
    return n_unsure


@inlined
def threshold(of_row, of_column):
    """A threshold of the dither in (0, 1); a value that is a code exactly must not fall to the next by rounding."""
    t = of_row + of_column
    if t >= WHOLE:
        t -= WHOLE
    return t * SHRUNK + RAISED


@compiled("f8[:,:,:], f8[:,:], f8[:,:,:], f8[:,:]")
def halve(value, weight, coarse, coarse_weight):
    """Means over 2 x 2 texels by weight, and the sums of the weights, at most 1; an odd last line stands alone."""
    h, w = weight.shape
    for j in range(coarse_weight.shape[0]):
        for i in range(coarse_weight.shape[1]):
            total = 0.0
            for c in range(3):
                coarse[j, i, c] = 0.0
            for k in range(4):
                at_j, at_i = 2 * j + k % 2, 2 * i + k // 2
                if at_j < h and at_i < w and weight[at_j, at_i] > 0:
                    total += weight[at_j, at_i]
                    for c in range(3):
                        coarse[j, i, c] += value[at_j, at_i, c] * weight[at_j, at_i]
            if total > 0:
                for c in range(3):
                    coarse[j, i, c] /= total
            coarse_weight[j, i] = min(total, 1.0)
    return 0


@compiled("f8[:,:,:], f8[:,:], f8[:,:,:]")
def fill(coarse, weight, value):
    """Give texels of weight 0 what a map of half the size has there, bilinearly."""
    h, w = weight.shape
    for j in range(h):
        low_j, high_j, t = around(j, coarse.shape[0])
        for i in range(w):
            if weight[j, i] > 0:
                continue
            low_i, high_i, s = around(i, coarse.shape[1])
            for c in range(3):
                left = coarse[low_j, low_i, c] * (1 - t) + coarse[high_j, low_i, c] * t
                right = coarse[low_j, high_i, c] * (1 - t) + coarse[high_j, high_i, c] * t
                value[j, i, c] = left * (1 - s) + right * s
    return 0


@inlined
def around(k, n):
    """Of n coarse texels those before and after the centre of fine texel k, and where it lies between them."""
    at = min(max(k / 2 - 0.25, 0.0), n - 1.0)
    low = min(int(at), max(n - 2, 0))
    return low, min(low + 1, n - 1), at - low


@compiled("f4[:,:], i4[:,:], b1[:], i8[:], f8[:], f4[:], f8[:]")
def brightest(value, bits, hidden, offsets, weight, top, share):
    """The brightest channel of packed texels (N, 3), at least 0, -1 where hidden: top (N,).

    bits : the same memory as `value`;  offsets (m + 1,), weight (m,) : of the maps, as MapSet has them
    share : starts at 0; the weights of the texels are added up by the upper BUCKET_BITS of their `top`
    """
    for k in range(len(weight)):
        for n in range(offsets[k], offsets[k + 1]):
            top[n] = -WHOLE
            if hidden[n]:
                continue
            here, of = NONE, np.int32(0)
            for c in range(3):
                if value[n, c] > here:
                    here, of = value[n, c], bits[n, c]
            top[n] = here
            share[of >> DROPPED] += weight[k]
    return 0
