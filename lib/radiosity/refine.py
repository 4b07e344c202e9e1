"""Refinement of all trees of a chunk together, level by level: every new sample of a level is measured in one batch."""

from functools import partial
from typing import NamedTuple

import numpy as np

from lib.elements.balance import children
from lib.elements.quadtree import SMALLEST_CELL, Quadtree
from lib.radiosity.gather import LookupTable, indirect_light
from lib.radiosity.sampling import direct_at, points_at

LARGE_CELL = 1 / 8  # of the scene's largest side
LEAST_RAYS = 32  # or half of what a large cell gets
USUAL_CONTRAST = 0.6
AVERAGED = 0.8  # between samples, interpolation averages their noise
SMOOTH = 0.25  # dividing a cell once more leaves a quarter of the departure of a smooth field


class Effort(NamedTuple):
    """What surfaces (n,) are worth: share of the usual shadow rays, of gather rays its root, and levels by which their
    trees end above the cells of an atlas."""

    share: np.ndarray
    coarser: np.ndarray


def full(n):
    """The Effort of n surfaces that get all there is."""
    return Effort(np.ones(n), np.zeros(n, dtype=np.int64))


def refine(world, trees, sample, seed, tau, top, recheck=None):
    """Measure and divide until every leaf is within its threshold.

    trees : {surface: Quadtree}, whose wanted() samples are missing
    sample(points) -> value (n, C), hidden, noise, reach (n,); recheck: the same with more effort, for doubtful()
    samples
    tau : {surface: threshold [W/m^2]}; top : deepest level.  Works on the trees in place.
    """
    active = sorted(trees)
    while active:
        _measure(world, trees, {s: trees[s].wanted() for s in active}, sample, seed)
        if recheck:
            _measure(world, trees, {s: trees[s].doubtful() for s in active}, recheck, seed)
        active = [s for s in active if trees[s].split(tau[s], top)]


def _measure(world, trees, at, sample, seed):
    """Put the samples of all trees at crossings {surface: (j, i)}, measured in one batch."""
    at = {s: needed_of(world, trees[s], s, place) for s, place in at.items()}
    at = {s: place for s, place in at.items() if len(place[0])}
    if not at:
        return
    measured = sample(points_at(world, seed, at, {s: trees[s].level for s in at}))
    first = 0
    for s, place in at.items():
        part = slice(first, first + len(place[0]))
        first = part.stop
        trees[s].put(place, *(array[part] for array in measured))


def needed_of(world, tree, s, at):
    """Those of the crossings `at` (j, i) that a part of surface s lies beside; the others are put down as hidden."""
    needed = world.is_needed(s, tree.level)
    if needed is None or not len(at[0]):
        return at
    wanted = needed[at]
    tree.put(tuple(axis[~wanted] for axis in at), 0.0, True, 0.0, np.inf)
    return tuple(axis[wanted] for axis in at)


def tree_of(world, s, base, smallest, coarser):
    """An empty Quadtree of surface s, at least `base` deep and `coarser` levels less than its atlas."""
    cover = None if world.domain(s) is None else partial(world.cover, s)
    finest = None if world.finest(s) is None else max(base, world.finest(s) - int(coarser))
    return Quadtree(world.lattices[s], base, world.channels, world.side(s), cover, finest, smallest)


def refine_direct(world, base, seed, tau, top, shadow_rays, smallest=SMALLEST_CELL, effort=None):
    """Direct trees from their base lattices.

    base : {surface: (value (h, w, C), hidden, noise, level)}; effort : an Effort, None for all.
    Returns {surface: Quadtree} and counts of spared rays.

    A surface of less effort gets that share of the shadow rays, and none for doubts.
    """
    trees, spared = {}, np.zeros(3, dtype=np.int64)
    effort = effort or full(world.n)
    for s, (value, hidden, noise, level) in base.items():
        trees[s] = tree_of(world, s, level, smallest, effort.coarser[s])
        own = trees[s].wanted()
        trees[s].put(own, value[own], hidden[own], noise[own], np.inf)

    def sampler(rays):
        def sample(points):
            light, buried = direct_at(world, points, rays)
            spared[:] += light.below_horizon, light.dim, light.agreed
            return light.H.reshape(len(buried), -1), buried, light.noise, np.full(len(buried), np.inf, dtype=np.float32)

        return sample

    n0, n1 = shadow_rays
    whole = {s: tree for s, tree in trees.items() if effort.share[s] >= 1}
    refine(world, whole, sampler((n0, n1)), seed, tau, top, recheck=sampler((n1, n1)))
    for share in sorted({float(effort.share[s]) for s in trees if effort.share[s] < 1}):
        less = {s: tree for s, tree in trees.items() if effort.share[s] == share}
        refine(world, less, sampler(tuple(max(1, round(share * n)) for n in shadow_rays)), seed, tau, top)
    return trees, spared


def efforts(world, surfaces, own, chart_effort, chart_coarser=0):
    """The Effort that `surfaces` are worth: share chart_effort on meshes, whose cells stop at those of their atlas (or
    chart_coarser levels above) however the light changes, but where a finer tolerance is asked; all elsewhere.

    own : (n,) of own_share
    """
    meshes = [s for s in surfaces if world.finest(s) is not None]
    less = np.zeros(world.n, dtype=bool)
    less[meshes] = own[meshes] >= 1
    return Effort(np.where(less, chart_effort, 1.0), np.where(less, chart_coarser, 0))


def refine_indirect(world, surfaces, table, solution, seed, tau, top, level, K, smallest=SMALLEST_CELL, effort=None):
    """Indirect trees of `surfaces`, by gather rays through the LookupTable: {surface: Quadtree}.

    solution : has spread, H_element, n_u, n_v, first; K (surfaces,) gather rays
    for a large cell of usual surroundings; effort : an Effort, None for all.
    """
    effort = effort or full(world.n)
    trees = {s: tree_of(world, s, world.base_level(s, level), smallest, effort.coarser[s]) for s in surfaces}
    K = K * np.sqrt(effort.share)  # too few show as blotches on even walls, where shadow rays only blur edges

    def sample(points):
        n = len(points.x)
        out = (
            np.zeros((n, world.channels), np.float32),
            np.zeros(n, bool),
            np.zeros(n, np.float32),
            np.zeros(n, np.float32),
        )
        tiny = np.where(effort.share[points.surface] < 1, points.cell / smallest, 1.0)
        rays = rays_for(points.cell, contrast_at(points, solution), K[points.surface], tiny)
        for k in np.flatnonzero(np.bincount(rays)):  # np.unique loads numpy.ma, 0.06 s
            of = np.flatnonzero(rays == k)
            light = indirect_light(
                points.x[of], points.N[of], points.shift[of], int(k), world.tracer, world.mesh, table, world.channels
            )
            for array, part in zip(out, (light.H, light.hidden, light.noise, light.reach), strict=True):
                array[of] = part
        return out

    refine(world, trees, sample, f"{seed} indirect", tau, top)
    return trees


def rays_for(cell, contrast, K, tiny=1.0):
    """Gather rays of samples: K for cells of LARGE_CELL where the light around varies by USUAL_CONTRAST.

    cell, contrast, K (n,); tiny (n,) : below 1, the side of a cell over the smallest that light would be followed to,
    whose sample may have fewer than the least.  With variance ~ contrast^2 rays^-1.6, the sum of area x variance is
    least for a given number of rays when rays ~ (area contrast^2)^(1/2.6).  Rounded to sizes that share a batch.
    """
    need = K * np.minimum(1.0, cell / LARGE_CELL) ** (2 / 2.6) * (contrast / USUAL_CONTRAST) ** (2 / 2.6)
    least = np.maximum(np.minimum(LEAST_RAYS, K / 2), K / 8) * np.minimum(1.0, tiny) ** (2 / 2.6)
    need = np.clip(need, least, 4 * K)
    return np.maximum(16 * np.round(2 ** (np.round(2 * np.log2(need)) / 2) / 16), 16).astype(np.int64)


def rays_of_surfaces(K, own_light):
    """Gather rays of surfaces whose errors count beside their own light, `own_light` (n,) of the scene's: (n,).

    contrast_at takes the geometric mean of both, so half of the ratio is left for here.
    """
    return K * own_light ** (-0.5 * 2 / 2.6)


def contrast_at(points, solution):
    """How much the light around varies over directions, by the element each point lies in: (n,).

    The spread, in units of the irradiance between the element's own and the scene's mean (the geometric mean of
    both): an error is seen beside its surroundings, but counts less where there is little light.  The scene's mean
    where a surface has no elements.
    """
    s = points.surface
    n_u, n_v = solution.n_u[s], solution.n_v[s]
    if not len(solution.spread):
        return np.full(len(s), USUAL_CONTRAST)
    own = solution.H_element.astype(np.float64)
    H = np.sqrt(np.maximum(own, 1e-12 * own.max()) * own.mean())
    contrast = solution.spread / np.maximum(H, 1e-300)
    i = np.minimum((points.uv[:, 0] * n_u).astype(np.int64), n_u - 1)
    j = np.minimum((points.uv[:, 1] * n_v).astype(np.int64), n_v - 1)
    element = np.where(n_u > 0, solution.first[s] + j * n_u + i, 0)
    return np.where((n_u > 0) & (contrast[element] > 0), contrast[element], contrast.mean())


def lookup_table(world, maps, solution, follows_near=True):
    """LookupTable of the RadiosityMaps of all chunks.

    solution : has n_u, n_v, rho (surfaces, 3)
    follows_near : near hits are followed on, which adds a reflection: not where they are numbered
    """
    elements = np.maximum(solution.n_u * solution.n_v, 1)
    width = np.sqrt(world.casters.area / elements) * follows_near
    return LookupTable(maps, world.mesh, np.tile(solution.rho, (1, world.n_groups)), width)


def error_of(tree, lookups=0.0):
    """Estimated RMS error of a tree's map [W/m^2]: sampling noise, and what the leaves still depart from their
    prediction, by the departure seen when their parents were divided; both by the area they stand for.

    lookups : error of what the rays read [W/m^2], which no sample shows
    """
    share = tree.shares() * ~tree.hidden
    noise = AVERAGED * np.sqrt((share * tree.noise.astype(np.float64) ** 2).sum() / max(share.sum(), 1e-300))
    departure, area = 0.0, 0.0
    for level in range(max(tree.base, 1), tree.level + 1):
        leaf, size = tree.is_leaf(level), 4.0**-level
        departure += float((children(tree.residual(level - 1))[leaf].astype(np.float64) ** 2).sum()) * size
        area += leaf.sum() * size
    interpolation = SMOOTH * np.sqrt(departure / area) if area else 0.0
    return float(np.sqrt(noise**2 + interpolation**2 + lookups**2))
