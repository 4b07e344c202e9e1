"""Emitting surfaces as flat facets: what direct light is computed from.

A flat parallelogram is one facet.  A curved emitter is triangles over a uv grid fine enough for its shape; each
carries the exact area of its piece of surface, so the power is that of the exact surface.
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs import shape
from lib.nurbs.evaluate import evaluate_grid

FLATNESS = 0.01  # chord error of the facets, as a share of the emitter's size
MOST_CELLS = 16  # along one direction


@dataclass(frozen=True)
class Facets:
    """k facets origin + a e1 + b e2 (k, 3 each): parallelograms with a, b in [0, 1], or triangles with a + b <= 1.

    normal (k, 3) the emitting side, area (k,), weight (k,) exact area of the piece over the facet's.
    """

    origin: np.ndarray
    e1: np.ndarray
    e2: np.ndarray
    is_triangle: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    weight: np.ndarray

    @property
    def centre(self):
        """Centres, (k, 3)."""
        return self.origin + (self.e1 + self.e2) * np.where(self.is_triangle, 1 / 3, 1 / 2)[:, None]

    def corners(self):
        """Corners in order, (k, 4, 3); a triangle repeats its last."""
        far = self.origin + self.e2 + np.where(self.is_triangle[:, None], 0.0, self.e1)
        return np.stack([self.origin, self.origin + self.e1, far, self.origin + self.e2], axis=1)


@dataclass(frozen=True)
class Emitters:
    """L emitters; those of emitter l are facets[first[l]:first[l + 1]].

    E (L, 3) exitance, group (L,) light group, surface (L,) index of the surface, is_curved (L,) bool.
    """

    facets: Facets
    first: np.ndarray
    E: np.ndarray
    group: np.ndarray
    surface: np.ndarray
    is_curved: np.ndarray


def facets_of(surface, flip=False):
    """Facets of one surface, emitting along N (negated where `flip`)."""
    cells_u, cells_v = _cells(surface)
    u, v = np.linspace(0, 1, cells_u + 1), np.linspace(0, 1, cells_v + 1)
    S = evaluate_grid(surface, u, v)[0]
    S00, S10, S01, S11 = S[:-1, :-1], S[:-1, 1:], S[1:, :-1], S[1:, 1:]
    exact = _cell_areas(surface, u, v)
    size = np.ptp(S.reshape(-1, 3), axis=0).max()
    if cells_u == cells_v == 1 and np.abs(S00 + S11 - S10 - S01).max() <= 1e-9 * size:
        origin, e1, e2 = S00, S10 - S00, S01 - S00
        triangle = np.zeros(1, dtype=bool)
        exact = exact[None]
    else:
        origin = np.stack([S00, S11])
        e1, e2 = np.stack([S10 - S00, S01 - S11]), np.stack([S01 - S00, S10 - S11])
        triangle = np.ones(2 * exact.size, dtype=bool)
        part = np.linalg.norm(np.cross(e1, e2), axis=-1)
        exact = exact * part / np.maximum(part.sum(axis=0), 1e-300)
    origin, e1, e2, exact = origin.reshape(-1, 3), e1.reshape(-1, 3), e2.reshape(-1, 3), exact.ravel()
    cross = np.cross(e1, e2)
    length = np.linalg.norm(cross, axis=1)
    keep = length > 1e-9 * length.max()
    area = length[keep] * np.where(triangle[keep], 0.5, 1.0)
    normal = cross[keep] / length[keep, None] * (-1.0 if flip else 1.0)
    weight = exact[keep] / area
    weight *= exact.sum() / (weight @ area)
    return Facets(origin[keep], e1[keep], e2[keep], triangle[keep], normal, area, weight)


def _cells(surface):
    """Cells along u and v, powers of two, so that chords along each stay within FLATNESS of the size."""
    if not _is_bent(surface):
        return 1, 1
    t = np.linspace(0, 1, 2 * MOST_CELLS + 1)
    S = evaluate_grid(surface, t, t)[0]
    bound = FLATNESS * np.ptp(S.reshape(-1, 3), axis=0).max()
    cells = []
    for axis in (1, 0):
        n = 1
        while n < MOST_CELLS:
            step = 2 * MOST_CELLS // n
            ends = np.take(S, np.arange(0, 2 * MOST_CELLS + 1, step), axis=axis)
            middle = np.take(S, np.arange(step // 2, 2 * MOST_CELLS, step), axis=axis)
            first = np.take(ends, np.arange(n), axis=axis)
            last = np.take(ends, np.arange(1, n + 1), axis=axis)
            if np.linalg.norm(middle - (first + last) / 2, axis=-1).max() <= bound:
                break
            n *= 2
        cells.append(n)
    return cells


def _is_bent(surface):
    return (
        surface.degree_u > 1 or surface.degree_v > 1 or surface.Pw.shape[:2] != (2, 2) or not shape.is_planar(surface)
    )


def _cell_areas(surface, u, v, order=4):
    """Areas of the uv cells, (len(v) - 1, len(u) - 1), by Gauss-Legendre."""
    x, weight = np.polynomial.legendre.leggauss(order)
    x, weight = (x + 1) / 2, weight / 2
    uu = (u[:-1, None] + np.diff(u)[:, None] * x).ravel()
    vv = (v[:-1, None] + np.diff(v)[:, None] * x).ravel()
    _, S_u, S_v = evaluate_grid(surface, uu, vv)
    density = np.linalg.norm(np.cross(S_u, S_v), axis=-1).reshape(len(v) - 1, order, len(u) - 1, order)
    return np.einsum("jbia,a,b->ji", density, weight, weight) * np.diff(v)[:, None] * np.diff(u)


def gather_emitters(surfaces, flip, E, group):
    """Emitters of a scene.

    surfaces : list of n NurbsSurface in the scene's frame; flip (n,) bool; E (n, 3) exitance, an emitter is E > 0;
    group (n,) int.
    """
    lit = np.flatnonzero(np.asarray(E).max(axis=1, initial=0.0) > 0)
    parts = [facets_of(surfaces[s], bool(flip[s])) for s in lit]
    fields = Facets.__dataclass_fields__
    empty = {name: np.zeros((0, 3)) for name in ("origin", "e1", "e2", "normal")}
    empty |= {"is_triangle": np.zeros(0, dtype=bool), "area": np.zeros(0), "weight": np.zeros(0)}
    facets = Facets(**{name: np.concatenate([empty[name], *(getattr(p, name) for p in parts)]) for name in fields})
    first = np.concatenate([[0], np.cumsum([len(p.area) for p in parts])]).astype(np.int64)
    is_curved = np.array([_is_bent(surfaces[s]) for s in lit], dtype=bool)
    return Emitters(facets, first, np.asarray(E, dtype=np.float64)[lit], np.asarray(group)[lit], lit, is_curved)
