"""From adaptive samples to a plain bitmap: the recursive bilinear interpolation of Moeller 1996, Figures 3 and 4.

From the coarsest level to the finest, over the whole map: an edge midpoint is the value measured there, else the mean
of the edge's ends; a centre is the value measured, else from its four edge midpoints M and four corners C

    centre = sum M / 2 - sum C / 4        clamped to the range of the eight

The paper gives no weights; these (Coons 1967) reproduce every quadratic.  Neighbouring leaves read the same edge
values, so there is no crack at a T-junction.  Hidden samples are passed over.
"""

import numpy as np


def resample(value, known, hidden):
    """Fill a lattice from the samples known on it.

    value (h, w, G, 3) float, known, hidden (h, w) bool; h - 1 and w - 1 share a power of two 2^l, and the crossings
    of level 0 are known.  Returns (value, hidden): new arrays; known values are kept bit for bit; hidden marks what
    no visible sample reaches.
    """
    value, hidden = value.copy(), hidden & known
    known = known.copy()
    step = _root_step(*known.shape)
    while step > 1:
        half = step // 2
        _fill_edges(value, known, hidden, step, half, axis=1)
        _fill_edges(value, known, hidden, step, half, axis=0)
        _fill_centres(value, known, hidden, step, half)
        step = half
    return value, hidden


def _root_step(h, w):
    step = np.gcd(h - 1, w - 1)
    return int(step & -step)


def _fill_edges(value, known, hidden, step, half, axis):
    along = (
        (slice(None, None, step), slice(half, None, step))
        if axis == 1
        else (slice(half, None, step), slice(None, None, step))
    )
    v, k, s = value[along], known[along], hidden[along]
    corner, shade = value[::step, ::step], hidden[::step, ::step]
    a, b = (corner[:, :-1], corner[:, 1:]) if axis == 1 else (corner[:-1], corner[1:])
    a_hidden, b_hidden = (shade[:, :-1], shade[:, 1:]) if axis == 1 else (shade[:-1], shade[1:])
    mean = np.where(a_hidden[..., None, None], b, np.where(b_hidden[..., None, None], a, (a + b) / 2))
    v[...] = np.where(k[..., None, None], v, mean)
    s[...] = np.where(k, s, a_hidden & b_hidden)
    k[...] = True


def _fill_centres(value, known, hidden, step, half):
    middle = (slice(half, None, step), slice(half, None, step))
    row, column = value[::step, half::step], value[half::step, ::step]
    corner = value[::step, ::step]
    M = np.stack([row[:-1], row[1:], column[:, :-1], column[:, 1:]])
    C = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]])
    row_hidden, column_hidden, shade = hidden[::step, half::step], hidden[half::step, ::step], hidden[::step, ::step]
    M_hidden = np.stack([row_hidden[:-1], row_hidden[1:], column_hidden[:, :-1], column_hidden[:, 1:]])
    C_hidden = np.stack([shade[:-1, :-1], shade[:-1, 1:], shade[1:, :-1], shade[1:, 1:]])
    # Pairs of opposite points are added first: the same bits whichever way the map is turned or mirrored.
    coons = ((M[0] + M[1]) + (M[2] + M[3])) / 2 - ((C[0] + C[3]) + (C[1] + C[2])) / 4
    coons = _clamp(coons, np.concatenate([M, C]))
    seen = ~M_hidden
    count = seen.sum(axis=0)
    kept = np.where(seen[..., None, None], M, 0.0)
    mean = ((kept[0] + kept[1]) + (kept[2] + kept[3])) / np.maximum(count, 1)[..., None, None]
    whole = ~(M_hidden.any(axis=0) | C_hidden.any(axis=0))
    centre = np.where(whole[..., None, None], coons, mean)
    k = known[middle]
    value[middle] = np.where(k[..., None, None], value[middle], centre)
    hidden[middle] = np.where(k, hidden[middle], count == 0)
    known[middle] = True


def _clamp(centre, eight):
    """Clamp the sum over light groups to the range of the eight; all groups are scaled alike."""
    total, sums = centre.sum(axis=-2), eight.sum(axis=-2)
    clamped = np.clip(total, sums.min(axis=0), sums.max(axis=0))
    scale = np.where(total != clamped, clamped / np.where(total == 0, 1.0, total), 1.0)
    single = centre.shape[-2] == 1
    return clamped[..., None, :] if single else centre * scale[..., None, :].astype(centre.dtype)


def upsample(value, hidden, levels):
    """The map on a lattice `levels` finer, bilinearly: (value, hidden)."""
    for _ in range(levels):
        h, w = hidden.shape
        wide = np.zeros((2 * h - 1, 2 * w - 1, *value.shape[2:]), dtype=value.dtype)
        known = np.zeros(wide.shape[:2], dtype=bool)
        shade = np.zeros_like(known)
        wide[::2, ::2], known[::2, ::2], shade[::2, ::2] = value, True, hidden
        _fill_edges(wide, known, shade, 2, 1, axis=1)
        _fill_edges(wide, known, shade, 2, 1, axis=0)
        row, row_hidden = wide[::2, 1::2], shade[::2, 1::2]
        a, b = row_hidden[:-1, ..., None, None], row_hidden[1:, ..., None, None]
        wide[1::2, 1::2] = np.where(a, row[1:], np.where(b, row[:-1], (row[:-1] + row[1:]) / 2))
        shade[1::2, 1::2] = row_hidden[:-1] & row_hidden[1:]
        value, hidden = wide, shade
    return value, hidden


def drop_levels(value, hidden, level, tolerance):
    """Drop the deepest levels whose visible samples all lie within `tolerance` of their bilinear prediction from the
    rest.

    value (h, w, G, 3), the sum over groups decides.  Returns (value, hidden, level); level 0 is the root grid.
    """
    while level > 0:
        coarse, coarse_hidden = value[::2, ::2], hidden[::2, ::2]
        predicted, _ = upsample(coarse, coarse_hidden, 1)
        departure = np.abs((value - predicted).sum(axis=-2)).max(axis=-1)
        if not (np.where(hidden, 0.0, departure) <= tolerance).all():
            break
        value, hidden, level = coarse, coarse_hidden, level - 1
    return value, hidden, level
