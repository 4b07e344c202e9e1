"""How far the exact surface is from triangles between points of it, by samples of each triangle."""

from dataclasses import dataclass

import numpy as np

from lib.nurbs.facet_kernels import measure

MANY = 300  # triangles; with more, fewer samples in each tell the distance


def _samples(n):
    """Barycentric weights (q, 3) of the points of a triangle in steps of 1 / n, but for the corners."""
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
    w = np.stack([i, j, n - i - j], axis=-1).reshape(-1, 3)
    return w[(w >= 0).all(axis=1) & (w < n).all(axis=1)] / n


BETWEEN = np.array([[5, 5, 2], [5, 2, 5], [2, 5, 5]]) / 12  # of the edges' middles and the triangle's
FEW_SAMPLES, MANY_SAMPLES = np.concatenate([_samples(2), np.full((1, 3), 1 / 3), BETWEEN]), _samples(4)


@dataclass(frozen=True)
class Distances:
    """Of m triangles, each named by its corners.

    key (m,) int64; height (m,) largest distance from the facet's plane; on_edge (m, 3) that of the samples on the edge
    from corner k to the next; square (m,) mean; slide (m,) largest whole vector; area (m,)
    """

    key: np.ndarray
    height: np.ndarray
    on_edge: np.ndarray
    square: np.ndarray
    slide: np.ndarray
    area: np.ndarray


def distances(base, S, uv, F, before=None):
    """The Distances of triangles F (m, 3) of points S (k, 3) at uv (k, 2) from the surface `base`; those that have
    the same corners in `before` are not measured again.
    """
    turn = np.argmin(F, axis=1)
    first = F[np.arange(len(F))[:, None], (turn[:, None] + np.arange(3)) % 3]
    key = (first[:, 0] << 42) + (first[:, 1] << 21) + first[:, 2]
    is_new = np.ones(len(F), dtype=bool) if before is None else ~np.isin(key, before.key)
    new = _measured(base, S, uv, first[is_new], MANY_SAMPLES if len(F) <= MANY else FEW_SAMPLES)
    out = [np.empty((len(F), *x.shape[1:])) for x in new]
    for whole, part in zip(out, new, strict=True):
        whole[is_new] = part
    if before is not None:
        order = np.argsort(before.key)
        old = order[np.searchsorted(before.key, key[~is_new], sorter=order)]
        known = (before.height, before.on_edge, before.square, before.slide, before.area)
        for whole, part in zip(out, known, strict=True):
            whole[~is_new] = part[old]
    height, on_edge, square, slide, area = out
    return Distances(key, height, on_edge, square, slide, area), first


def _measured(base, S, uv, F, weights):
    m = len(F)
    height, square, slide, area, on_edge = np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty((m, 3))
    surface = base.knots_u, base.knots_v, np.ascontiguousarray(base.Pw), base.degree_u, base.degree_v
    scratch = np.empty((4, max(base.degree_u, base.degree_v) + 1))
    uv, S, F = np.ascontiguousarray(uv), np.ascontiguousarray(S), np.ascontiguousarray(F)
    measure(*surface, uv, S, F, weights, scratch, height, on_edge, square, slide, area)
    return height, on_edge, square, slide, area
