"""The recursive bilinear transform against anchoring and its simpler kin, on maps that were measured.

The same adaptive samples are turned into a full map in four ways, and the maps are compared with the closed form:

    recursive     lib.maps.resample
    anchored      leaves with T-vertices are triangles that join those to the other corners (Baum et al. 1991, the
                  elements of Moeller 1996 before the transform); leaves without are bilinear
    cracked       every leaf bilinear between its own corners; T-vertices unused
    nearest       every texel takes the value of the nearest corner of its leaf
"""

import numpy as np

from benchmarks.hard_cases.bench import STANDARD, Figure, crossings, parallel_rectangle, rms
from benchmarks.hard_cases.shadows import FLOOR, LAMP, below_sheet, direct_tree, lamp, sheet
from lib.maps.resample import resample
from tests.shapes import rectangle


def per_leaf(tree, value, known, fill):
    """A map filled leaf by leaf, coarse to fine: fill(values (n + 1, n + 1, ...), known) gives those of a leaf."""
    out = np.zeros_like(value)
    for level, j, i in tree.leaves:
        n = 2 ** (tree.level - level)
        part = slice(j * n, j * n + n + 1), slice(i * n, i * n + n + 1)
        out[part] = fill(value[part], known[part])
    out[known] = value[known]
    return out


def bilinear(value, known):
    """Between the four corners."""
    t = np.linspace(0, 1, len(value))
    a, b = t[None, :], t[:, None]
    low, high = value[0, 0] * (1 - a) + value[0, -1] * a, value[-1, 0] * (1 - a) + value[-1, -1] * a
    return low * (1 - b) + high * b


def nearest(value, known):
    """The nearest corner."""
    end = np.where(np.arange(len(value)) * 2 < len(value) - 1, 0, len(value) - 1)
    return value[np.ix_(end, end)]


def anchored(value, known):
    """Triangles fanned out from the first T-vertex of the leaf; bilinear where it has none."""
    n = len(value) - 1
    half = n // 2
    around = [(0, 0), (0, half), (0, n), (half, n), (n, n), (n, half), (n, 0), (half, 0)]
    corner = [p for k, p in enumerate(around) if k % 2 == 0 or (n > 1 and known[p])]
    if len(corner) == 4:
        return bilinear(value, known)
    first = next(k for k, p in enumerate(corner) if half in p)
    ring = corner[first:] + corner[:first]
    grid = np.stack(np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"), axis=-1).astype(float)
    out = np.zeros_like(value)
    for p, q in zip(ring[1:-1], ring[2:], strict=True):
        edges = np.array([np.subtract(p, ring[0]), np.subtract(q, ring[0])], dtype=float)
        if abs(np.linalg.det(edges)) < 0.5:
            continue
        s = (grid - ring[0]) @ np.linalg.inv(edges)
        inside = (s >= -1e-9).all(axis=-1) & (s.sum(axis=-1) <= 1 + 1e-9)
        a, b = s[inside, 0], s[inside, 1]
        out[inside] = value[ring[0]] * (1 - a - b) + value[p] * a + value[q] * b
    return out


def against_anchoring(bench):
    """Direct light below a lamp near the floor, and in the penumbra of a table: measured trees, closed forms."""
    low, high, height = [-0.4, -0.3], [0.4, 0.3], 0.4
    near = {"floor": (rectangle(*FLOOR), {}), "lamp": lamp(*LAMP, 0.5)}
    table = {"floor": (rectangle(*FLOOR), {}), "lamp": lamp(), "table": sheet(low, high, height)}
    truths = {
        "lamp near a floor": (near, lambda x: parallel_rectangle(x, *LAMP, 0.5)),
        "penumbra of a table": (table, lambda x: below_sheet(x, low, high, height)),
    }
    many = {"shadow_rays": [256, 1024], "bounces": 1}  # so that interpolation is what errs
    for name, (surfaces, truth_at) in truths.items():
        bake = bench.bake(surfaces, {"floor": 0.5, "lamp": 0.0, "table": 0.0}, cheap=STANDARD, **many)
        tree = direct_tree(bake, "floor")
        dense, known, hidden = tree.dense()
        value = dense[..., 0, 0].astype(float)
        truth = truth_at(crossings(value.shape, *FLOOR)[..., :2])
        recursive = rms(resample(dense, known, hidden)[0][..., 0, 0], truth)
        for way in (anchored, bilinear, nearest):
            other = rms(per_leaf(tree, value, known, way), truth)
            what = f"{name}, {len(tree.ji)} samples: RMSE of the recursive transform, {recursive:.3%}, over "
            called = {"anchored": "anchored triangles", "bilinear": "cracked leaves", "nearest": "the nearest corner"}
            yield Figure(what + f"{called[way.__name__]}, {other:.3%}", "closed form", 1.0, recursive / other)


CASES = [against_anchoring]
