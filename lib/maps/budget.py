"""Meet a texture budget by removing the deepest quadtree level of the map that loses least, again and again.

Sources: Moeller 1996, for D_i, S and T.  Departures: the low pass keeps ramps at borders (odd reflection) and
goes round closed directions; hidden samples take no part.

Conventions: maps (h, w, 3), [j, i], side = roots 2^level + 1.  "Kept" samples have even i and even j; D_i is summed
over the others.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np

from lib.maps.base_texture import upsample
from lib.maps.mapset import pack, side_lengths
from lib.refusal import Refusal


@dataclass(frozen=True)
class Removal:
    """One step: global surface index, level before, its D_i [W/m^2], all bytes S after it."""

    surface: int
    level: int
    D: float
    S: int


def gpu_bytes(w, h):
    """Return the GPU bytes of a w x h RGBA8 texture with its whole mip chain, each mip floor(side/2) down to 1 x 1.

    >>> gpu_bytes(4, 2)
    44
    """
    total = 4 * w * h
    while w > 1 or h > 1:
        w, h = max(w // 2, 1), max(h // 2, 1)
        total += 4 * w * h
    return total


def map_bytes(roots, level):
    """Return gpu_bytes of a map with `roots` = [n_u, n_v] at `level`."""
    return gpu_bytes(*side_lengths(roots, level))


def detail(value, hidden):
    """Return D_i: sum over samples of odd i or j of |value - bilinear prediction from the kept ones|, all channels.

    value (h, w, 3) with odd sides, hidden (h, w). A hidden sample adds nothing and predicts nothing, unless it is a
    kept one beside visible ones, which takes their mean; the weights of the others are raised to sum 1.
    """
    lower, weight = _predictions(value, hidden)
    return float(sum(_loss(value[part], ~hidden[part], lower[name], weight[name]) for name, part in PARTS.items()))


PARTS = {"u": np.s_[0::2, 1::2], "v": np.s_[1::2, 0::2], "uv": np.s_[1::2, 1::2]}


def _predictions(value, hidden):
    """Return sums of visible kept neighbours and their numbers, for samples between two in u, two in v, and four."""
    if hidden.any():
        beside, weight = _beside(value, hidden)
        seen = ~hidden[0::2, 0::2]
        kept = np.where(seen[..., None], value[0::2, 0::2], beside.astype(value.dtype))
        count = (seen | (weight > 0)).astype(np.float32)
    else:
        kept, count = value[0::2, 0::2], None

    def sums(a):
        in_u = a[:, :-1] + a[:, 1:]
        return {"u": in_u, "v": a[:-1] + a[1:], "uv": in_u[:-1] + in_u[1:]}

    return sums(kept), sums(count) if count is not None else {"u": 2, "v": 2, "uv": 4}


def _loss(value, seen, total, weight):
    """Return sum |value - total / weight| over seen samples, in float64."""
    if np.isscalar(weight):
        return np.abs(value - total * value.dtype.type(1 / weight)).sum(dtype=np.float64)
    prediction = total / np.maximum(weight, 1)[..., None]
    return np.abs(value - prediction)[seen].sum(dtype=np.float64)


def low_pass(value, hidden, closed=(False, False)):
    """Return the map one level up: (1, 2, 1)/4 along both directions, read at the kept samples; and its hidden mask.

    At a border the map is continued by odd reflection (v[-1] = 2 v[0] - v[1]), so a border row is filtered along
    itself only, corners stay, and ramps stay ramps. Along a `closed` direction (u, v) it goes round and the last line
    equals the first. A sample with a hidden neighbour on a line is treated like a border sample of that line.  A hidden
    sample takes the mean of the visible ones around it, if there are any: at a border that runs between the samples
    that are kept, no light is lost.
    """
    seen = ~hidden
    exact = np.where(seen[..., None], value, 0).astype(np.float64)
    result = _smooth(_smooth(exact, seen, closed[0], 1), seen[:, ::2], closed[1], 0)
    if hidden.any():  # with gaps the order of the two passes matters: neither direction comes first
        other = _smooth(_smooth(exact, seen, closed[1], 0), seen[::2], closed[0], 1)
        result = (result + other) / 2
    kept = hidden[::2, ::2].copy()
    if kept.any():
        beside, weight = _beside(value, hidden, closed)
        result = np.where(kept[..., None], beside, result)
        kept &= weight <= 0
    return np.where(kept[..., None], 0, result).astype(value.dtype), kept


def _beside(value, hidden, closed=(False, False)):
    """Mean (h', w', 3) float64 of the visible samples around each kept one by the weights (1, 2, 1)/4 along both
    directions, 0 without one, and the sum of their weights (h', w')."""
    weight = (~hidden).astype(np.float64)
    total = np.where(hidden[..., None], 0.0, value)
    for axis, goes_round in ((1, closed[0]), (0, closed[1])):
        weight, total = (_binomial(a, axis, goes_round) for a in (weight, total))
    return total / np.where(weight > 0, weight, 1.0)[..., None], weight


def _binomial(a, axis, goes_round):
    a = np.moveaxis(a, axis, 0)
    out = a[::2] / 2
    out[:-1] += a[1::2] / 4
    out[1:] += a[1::2] / 4
    if goes_round:
        out[0] += a[-2] / 4
        out[-1] = out[0]
    return np.moveaxis(out, 0, axis)


def _smooth(value, seen, closed, axis):
    """Filter along axis at even samples only."""
    value, seen = np.moveaxis(value, axis, 0), np.moveaxis(seen, axis, 0)
    result = value[::2].copy()
    if closed:
        before, after = np.roll(value[1::2], 1, axis=0), value[1::2]
        usable = np.roll(seen[1::2], 1, axis=0) & seen[1::2]
        middle = result[:-1]
    else:
        before, after = value[1:-2:2], value[3::2]
        usable = seen[1:-2:2] & seen[3::2]
        middle = result[1:-1]
    middle += np.where(usable[..., None], (before + after - 2 * middle) / 4, 0)
    if closed:
        result[-1] = result[0]
    return np.moveaxis(result, 0, axis)


def smallest_total(roots, fixed=0):
    """Return the bytes of all maps at their root grids plus `fixed`: no budget below it can be met."""
    return fixed + sum(map_bytes(r, 0) for r in roots)


def total(maps, fixed=0):
    """Return S: the GPU bytes of all maps of a MapSet plus `fixed`."""
    return fixed + sum(map_bytes(r, level) for r, level in zip(maps.roots, maps.level, strict=True))


def checked(budget, smallest):
    """Return budget as an int number of bytes; raises Refusal with the smallest possible total for anything unfit."""
    possible = f"the smallest possible total of these textures is {smallest} bytes"
    if isinstance(budget, bool) or not isinstance(budget, int | float) or not math.isfinite(budget) or budget <= 0:
        raise Refusal(f"budget: {budget!r}, expected a number of bytes > 0; {possible}")
    if budget < smallest:
        raise Refusal(f"budget: {int(budget)} bytes can not be met; {possible}, each at its root grid")
    return int(budget)


# What is smallest goes first, given D_i, the bytes its removal saves and the levels the map has given up already.
# "loss" is the paper's rule.  A map it has begun with has fewer samples and so a smaller D_i than before: it tends to
# be taken down to its roots before the next is touched.  "loss_per_byte" counts D_i in samples of the map as baked, of
# which one stands for 4^given_up now, and divides by the gain: all maps coarsen together.
ORDERS = {
    "loss": lambda D, saved, given_up: D,
    "loss_per_byte": lambda D, saved, given_up: D * 4.0**given_up / saved,
}


def reduce(maps, closed, budget, fixed=0, order="loss"):
    """Remove levels from maps until S <= budget.

    Parameters
    ----------
    maps : MapSet, value (N, 3)
    closed : (m, 2) bool, the surface of map k is closed in u, in v
    budget : T [bytes], > 0;  fixed : bytes that count in S but can not shrink
    order : "loss", the smallest D_i goes first (Moeller 1996); or "loss_per_byte", see ORDERS

    Returns
    -------
    maps : MapSet, `maps` itself if S <= T already
    steps : list of Removal, in order
    D : (m,) float64, D_i of the maps as given; 0 at the root grid

    Raises Refusal, with both numbers, if the budget can not be met.
    """
    T = checked(budget, smallest_total(maps.roots, fixed))
    S = total(maps, fixed)
    value = [maps.map(k) for k in range(len(maps))]
    hidden = [maps.hidden_map(k) for k in range(len(maps))]
    level = maps.level.astype(np.int64)
    D = np.array([detail(value[k], hidden[k]) if level[k] else 0.0 for k in range(len(maps))])

    def saved(k):
        return map_bytes(maps.roots[k], level[k]) - map_bytes(maps.roots[k], level[k] - 1)

    def entry(k, loss):
        return (
            ORDERS[order](loss, saved(k), maps.level[k] - level[k]),
            k,
            loss,
        )  # names are sorted: the index breaks ties by name

    heap = [entry(k, D[k]) for k in range(len(maps)) if level[k]]
    heapq.heapify(heap)
    steps = []
    while S > T:
        _, k, loss = heapq.heappop(heap)
        S -= saved(k)
        steps.append(Removal(int(maps.surface[k]), int(level[k]), float(loss), S))
        value[k], hidden[k] = low_pass(value[k], hidden[k], closed[k])
        level[k] -= 1
        if level[k]:
            heapq.heappush(heap, entry(k, detail(value[k], hidden[k])))
    if not steps:
        return maps, steps, D
    return pack(maps.surface, maps.roots, level, value, hidden), steps, D


def lost(before, after, area):
    """Return the mean error of reduced maps, stretched to their size before as viewers do, over the mean of what was.

    before, after : MapSets of the same surfaces;  area : (m,) of the surfaces, which the means are taken over
    """
    error, light = 0.0, 0.0
    for k, share in enumerate(np.asarray(area, np.float64)):
        value, seen = before.map(k), ~before.hidden_map(k)
        if not seen.any():
            continue
        each = share / (3 * np.count_nonzero(seen))
        light += each * np.einsum("jic,ji->", value, seen, dtype=np.float64)
        levels = int(before.level[k] - after.level[k])
        if levels:
            shown, _ = upsample(after.map(k), after.hidden_map(k), levels)
            shown -= value
            error += each * np.einsum("jic,ji->", np.abs(shown, out=shown), seen, dtype=np.float64)
    return error / light if light > 0 else 0.0
