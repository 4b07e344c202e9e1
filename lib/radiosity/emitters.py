"""Emitting surfaces as flat facets: what direct light is computed from.

A flat parallelogram is one facet.  A curved emitter is triangles over a uv grid fine enough for its shape.  Where it is
convex on the side that shines, each carries the exact area of its piece of surface, so the power is that of the exact
surface.  A hollow is seen from within, by its outline and not by its area: there they lie at the mean height of their
piece of surface and count as they are.
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs import shape
from lib.nurbs.evaluate import evaluate_grid, frame_grid
from lib.nurbs.surface import NurbsSurface
from lib.surfaces.mesh_build import normals_areas

FLATNESS = 0.01  # chord error of the facets, as a share of the size of the lines they follow
MEAN_HEIGHT = 2 / 3  # of a paraboloid above the chords of a small cell, in units of its height above the cell's middle
HOLLOW = 1e-6  # least such height, as a share of the emitter's size
MOST_CELLS = 16  # along one direction
ENOUGH, LEAST = 1024, 4  # facets of all emitters that are known by their triangles, and of each of them


@dataclass(frozen=True)
class Facets:
    """k facets origin + a e1 + b e2 (k, 3 each): parallelograms with a, b in [0, 1], or triangles with a + b <= 1.

    normal (k, 3) the emitting side, area (k,), weight (k,) exact area of the piece over the facet's, 1 in hollows.
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


def facets_of(surface, flip=False, box=(0, 1, 0, 1)):
    """Facets of one surface, emitting along N (negated where `flip`); of its part in the box u0, u1, v0, v1."""
    cells_u, cells_v = _cells(surface)
    u0, u1, v0, v1 = box
    cells_u, cells_v = max(1, round(cells_u * (u1 - u0))), max(1, round(cells_v * (v1 - v0)))
    u, v = np.linspace(u0, u1, cells_u + 1), np.linspace(v0, v1, cells_v + 1)
    S, N = frame_grid(surface, u, v)
    S00, S10, S01, S11 = _cell_corners(S)
    exact, is_hollow = _cell_areas(surface, u, v), np.zeros((cells_v, cells_u), dtype=bool)
    size = np.ptp(S.reshape(-1, 3), axis=0).max()
    if cells_u == cells_v == 1 and np.abs(S00 + S11 - S10 - S01).max() <= 1e-9 * size:
        origin, e1, e2 = S00, S10 - S00, S01 - S00
        triangle = np.zeros(1, dtype=bool)
        exact = exact[None]
    else:
        height = _heights(surface, u, v, S)
        is_hollow = height * (-1.0 if flip else 1.0) < -HOLLOW * size
        rise = MEAN_HEIGHT * np.where(is_hollow, height, 0.0)[..., None]
        S00, S10, S01, S11 = (c + rise * n for c, n in zip(_cell_corners(S), _cell_corners(N), strict=True))
        origin = np.stack([S00, S11])
        e1, e2 = np.stack([S10 - S00, S01 - S11]), np.stack([S01 - S00, S10 - S11])
        triangle = np.ones(2 * exact.size, dtype=bool)
        part = np.linalg.norm(np.cross(e1, e2), axis=-1)
        exact, is_hollow = exact * part / np.maximum(part.sum(axis=0), 1e-300), np.stack([is_hollow, is_hollow])
    origin, e1, e2, exact = origin.reshape(-1, 3), e1.reshape(-1, 3), e2.reshape(-1, 3), exact.ravel()
    cross = np.cross(e1, e2)
    length = np.linalg.norm(cross, axis=1)
    keep = length > 1e-9 * length.max()
    area = length[keep] * np.where(triangle[keep], 0.5, 1.0)
    normal = cross[keep] / length[keep, None] * (-1.0 if flip else 1.0)
    weight = exact[keep] / area
    weight *= exact.sum() / (weight @ area)
    weight[is_hollow.ravel()[keep]] = 1.0
    return Facets(origin[keep], e1[keep], e2[keep], triangle[keep], normal, area, weight)


def facets_of_triangles(corners, area):
    """Facets of a surface that is known by its triangles: corners, three arrays (k, 3) round the lit side; area [of
    the exact surface] they stand for."""
    a, b, c = corners
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    keep = length > 1e-9 * length.max(initial=0.0)
    own = length[keep] / 2
    weight = np.full(own.shape, area / max(own.sum(), 1e-300))
    triangle = np.ones(own.shape, dtype=bool)
    return Facets(a[keep], (b - a)[keep], (c - a)[keep], triangle, cross[keep] / length[keep, None], own, weight)


def simplified(triangles):
    """Fewer triangles for emitters that are known by theirs, ENOUGH for all: a faint glow on a whole model must not
    cost more than its lamps.

    triangles : list of (V (n, 3), F (k, 3));  returns a list of the same kind.  Corners that lie in one cell of a grid
    move to their mean; what is left without an area is dropped  [rossignac1993].
    """
    if sum(len(F) for _, F in triangles) <= ENOUGH:
        return triangles
    size = np.array([np.sqrt(normals_areas(V, F)[1].sum()) for V, F in triangles])
    most = np.maximum(ENOUGH * size / max(size.sum(), 1e-300), LEAST)
    return [_clustered(V, F, n) if len(F) > n else (V, F) for (V, F), n in zip(triangles, most, strict=True)]


def _clustered(V, F, n):
    """About n of the triangles F (k, 3) of V; all of them where nothing would be left."""
    area = normals_areas(V, F)[1].sum()
    used, corner = np.unique(F, return_inverse=True)
    cell = np.sqrt(2 * area / n)  # two triangles to a cell
    at = np.floor((V[used] - V[used].min(axis=0)) / cell).astype(np.int64)
    _, cluster, count = np.unique(at, axis=0, return_inverse=True, return_counts=True)
    cluster = cluster.ravel()
    mean = np.stack([np.bincount(cluster, V[used, k]) for k in range(3)], axis=1) / count[:, None]
    few = cluster[corner].reshape(-1, 3)
    first = np.argmin(few, axis=1)[:, None]
    few = np.unique(np.take_along_axis(few, (first + np.arange(3)) % 3, axis=1), axis=0)
    few = few[normals_areas(mean, few)[1] > 1e-3 * area / n]
    return (mean, few) if len(few) else (V, F)


def _cell_corners(S):
    """Corners (0, 0), (1, 0), (0, 1), (1, 1) of the cells of a grid, each (h - 1, w - 1, 3)."""
    return S[:-1, :-1], S[:-1, 1:], S[1:, :-1], S[1:, 1:]


def _heights(surface, u, v, S):
    """Heights of the surface along its normal above the means of the cells' corners, in the middle of the cells."""
    middle, N = frame_grid(surface, (u[:-1] + u[1:]) / 2, (v[:-1] + v[1:]) / 2)
    return ((middle - sum(_cell_corners(S)) / 4) * N).sum(axis=2)


def _cells(surface):
    """Cells along u and v, powers of two: chords along each stay within FLATNESS of the size of the lines they follow,
    so a tube stays round however long it is."""
    if not _is_bent(surface):
        return 1, 1
    t = np.linspace(0, 1, 2 * MOST_CELLS + 1)
    S = evaluate_grid(surface, t, t)[0]
    cells = []
    for axis in (1, 0):
        bound = FLATNESS * np.ptp(S, axis=axis).max()
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


def gather_emitters(surfaces, flip, E, group, glow=None):
    """Emitters of a scene, by surface.

    surfaces : list of n NurbsSurface in the scene's frame, or Facets of other kinds; flip (n,) bool; E (n, 3) exitance,
    an emitter is E > 0; group (n,) int
    glow : {surface: lib.maps.glow.Glow} of those that shine unevenly, one emitter for each of their parts that
    shines; of other kinds, a list of the Facets of every part
    """
    E = np.asarray(E, dtype=np.float64)
    of, exitance, parts = [], [], []
    for s in np.flatnonzero(E.max(axis=1, initial=0.0) > 0):
        own, surface, turned = (glow or {}).get(s), surfaces[s], bool(flip[s])
        if own is None:
            shining, facets = E[s : s + 1], [surface if isinstance(surface, Facets) else facets_of(surface, turned)]
        else:
            facets = surface if isinstance(surface, list) else [facets_of(surface, turned, box) for box in own.box]
            shining = parts_exitance(E[s], own.colour, facets)
        for e, part in zip(shining, facets, strict=True):
            if e.max() > 0 and len(part.area):
                of, exitance, parts = [*of, s], [*exitance, e], [*parts, part]
    fields = Facets.__dataclass_fields__
    empty = {name: np.zeros((0, 3)) for name in ("origin", "e1", "e2", "normal")}
    empty |= {"is_triangle": np.zeros(0, dtype=bool), "area": np.zeros(0), "weight": np.zeros(0)}
    facets = Facets(**{name: np.concatenate([empty[name], *(getattr(p, name) for p in parts)]) for name in fields})
    first = np.concatenate([[0], np.cumsum([len(p.area) for p in parts])]).astype(np.int64)
    is_curved = np.array([not isinstance(surfaces[s], NurbsSurface) or _is_bent(surfaces[s]) for s in of], dtype=bool)
    of = np.array(of, dtype=np.int64)
    return Emitters(facets, first, np.array(exitance).reshape(-1, 3), np.asarray(group)[of], of, is_curved)


def parts_exitance(E, colour, parts):
    """Exitance (L, 3) of the parts of a surface whose own is E (3,): `colour` (L, 3) times E, scaled so that Facets of
    all `parts` have the power of E on all of them."""
    area = np.array([part.area @ part.weight for part in parts])
    power = area @ colour
    return E * colour * np.divide(area.sum(), power, out=np.zeros(3), where=power > 0)
