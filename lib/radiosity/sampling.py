"""First samples of a chunk of surfaces: direct light on the base lattices, and the elements with their rows."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lib.elements.grids import POINTS, by_element, point_parameters
from lib.elements.lattice import OFFSET, receivers
from lib.elements.parts import parts
from lib.nurbs.evaluate import density_grid
from lib.radiosity.direct import direct_light
from lib.radiosity.rows import Rows, element_rows, without
from lib.radiosity.world import FINEST
from lib.surfaces.frames import density as frame_density
from lib.surfaces.frames import frame, whole
from lib.visibility.hidden import are_buried
from lib.visibility.qmc import shift, stream

FEW_RAYS = (4, 4)  # to a lamp from one of an element's 16 points
MOST_PAIRS = 2**20  # of points and lamp facets on a surface; beyond, only what can not be interpolated is asked
ROUGH = 0.2  # contrast of a cell's corners from which its elements get shadow rays of their own


@dataclass(frozen=True)
class Points:
    """Samples of several surfaces in one batch: surface (n,), cell (n,) side of the lattice's cells in the scene's
    frame, uv (n, 2) in [0, 1], x, N (n, 3) lifted, shift (n, 2)."""

    surface: np.ndarray
    cell: np.ndarray
    uv: np.ndarray
    x: np.ndarray
    N: np.ndarray
    shift: np.ndarray


def points_at(world, seed, wanted, level_of):
    """Lattice crossings as ray origins.

    wanted : {surface: (j, i)}; level_of : {surface: level of the lattice they count on}.  In the order of the dict.
    """
    parts = []
    for s, (j, i) in wanted.items():
        own = world.scene.flip[s], world.casters.sag[s], world.lattices[s]
        x, N = receivers(world.surface(s), *own, level_of[s], j, i, world.domain(s))
        up = 2 ** (FINEST - level_of[s])
        cell = np.full(len(j), world.side(s) * 2.0 ** -level_of[s])
        h, w = world.lattices[s].shape(level_of[s])
        uv = np.stack([i / (w - 1), j / (h - 1)], axis=1)
        parts.append((np.full(len(j), s), cell, uv, x, N, shift(stream(seed, world.scene.names[s]), i * up, j * up)))
    return Points(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def light_at(world, points, shadow_rays):
    """DirectLight at points."""
    return direct_light(
        points.x,
        points.N,
        points.shift,
        world.emitters,
        world.n_groups,
        world.tracer,
        world.mesh.face_surface,
        *shadow_rays,
    )


def direct_at(world, points, shadow_rays):
    """DirectLight at points, and which are hidden (only those that no light reaches can be)."""
    light = light_at(world, points, shadow_rays)
    hidden = np.zeros(len(points.x), dtype=bool)
    dark = np.flatnonzero(light.H.max(axis=(1, 2), initial=0.0) <= 0)
    if dark.size:
        hidden[dark] = are_buried(points.x[dark], points.N[dark], points.shift[dark], world.tracer, world.mesh)
    return light, hidden


def base_lattice(world, surfaces, seed, level, shadow_rays):
    """Direct light on the base lattices: {surface: (value (h, w, 3 G), hidden, noise (h, w), level)} and
    DirectLight's counts.

    level : of large surfaces; smaller ones begin coarser.
    """
    level_of = {s: world.base_level(s, level) for s in surfaces}
    needed = {s: world.is_needed(s, level_of[s]) for s in surfaces}
    wanted = {
        s: np.nonzero(world.lattices[s].is_own(level_of[s]) & (True if needed[s] is None else needed[s]))
        for s in surfaces
    }
    if not wanted:
        return {}, (0, 0, 0)
    points = points_at(world, seed, wanted, level_of)
    light, hidden = direct_at(world, points, shadow_rays)
    out, first = {}, 0
    for s, (j, i) in wanted.items():
        part = slice(first, first + len(j))
        first += len(j)
        shape = world.lattices[s].shape(level_of[s])
        value = np.zeros((*shape, world.channels), dtype=np.float32)
        shade, noise = np.full(shape, needed[s] is not None), np.zeros(shape, dtype=np.float32)
        value[j, i], shade[j, i], noise[j, i] = light.H[part].reshape(len(j), -1), hidden[part], light.noise[part]
        out[s] = (*(world.lattices[s].copy_own(array) for array in (value, shade, noise)), level_of[s])
    return out, (light.below_horizon, light.dim, light.agreed)


@dataclass(frozen=True)
class Elements:
    """Elements of one surface: rows, is_alone (k,) bool as Parts has it, area (k, 16) that their points stand for and
    direct light there H_direct (k, 16, 3 G), both 0 where hidden."""

    rows: Rows
    is_alone: np.ndarray
    area: np.ndarray
    H_direct: np.ndarray


def elements_of(world, surfaces, seed, grids, R, base):
    """Elements of each of the surfaces: their points, rows and direct light; a list.

    base : {surface: (value, hidden, noise, level)} of base lattices; R rays per element, 0 casts none (one bounce).
    """
    drafts = [_draft(world, s, seed, grids, R, base[s]) for s in surfaces]
    asked = [draft for draft in drafts if draft.own.any()]
    if asked:  # all in one batch: a small surface asks for a few
        points = Points(*(_joined(field) for field in zip(*(draft.points for draft in asked), strict=True)))
        H = light_at(world, points, FEW_RAYS).H.reshape(len(points.x), -1)
        for draft, part in zip(asked, np.split(H, np.cumsum([draft.own.sum() for draft in asked])[:-1]), strict=True):
            draft.light[draft.own] = part
    return [Elements(d.rows, d.is_alone, d.area, by_element(d.light) * ~d.rows.is_hidden[..., None]) for d in drafts]


def _joined(fields):
    return None if fields[0] is None else np.concatenate(fields)


class _Draft(NamedTuple):
    """Elements but for the direct light at some of their points (4 n_v, 4 n_u): light (.., 3 G) interpolated, own (..)
    bool where it is not good enough; points, the fields of Points there."""

    rows: Rows
    is_alone: np.ndarray
    area: np.ndarray
    light: np.ndarray
    own: np.ndarray
    points: tuple


def _draft(world, s, seed, grids, R, base):
    n_u, n_v = int(grids.n_u[s]), int(grids.n_v[s])
    u, v = point_parameters(n_u, n_v)
    on = points_on(world, s, u, v)
    lifted = on.S + on.N * (world.casters.sag[s] + OFFSET)
    number = np.arange(n_u * n_v)
    shifts = shift(stream(f"{seed} rows", world.scene.names[s]), number % n_u, number // n_u)
    outside = by_element(~on.is_part)
    if R:
        rows = element_rows(by_element(lifted), by_element(on.N), shifts, R, world.tracer, world.mesh, grids, ~outside)
    else:
        none = np.full(outside.shape, -1, dtype=np.int32)
        rows = Rows(none, np.zeros(none.shape, dtype=np.uint8), outside)
    found, is_walled = _parts(world, s, on.S + on.N * OFFSET, rows.is_hidden, n_u, n_v)
    rows = without(rows, ~found.keeps & ~rows.is_hidden)
    visible = ~rows.is_hidden
    area = by_element(on.density) * visible / visible.size
    is_alone = found.is_alone | _between_charts(by_element(on.chart), outside, n_u, n_v)
    value, hidden, noise, level = base
    cover = world.cover(s, level)
    light = _bilinear(*(finer(value, hidden) if cover is None else (value, hidden)), u, v)
    # Between samples in light and shadow, of two rooms, or of two charts, nothing can be interpolated.
    cells = _walled_cells(is_walled, hidden.shape) | (cover[1] if cover is not None else False)
    rough = cells | is_rough(value, hidden, noise)
    at = np.ix_(_cells_of(v, hidden.shape[0]), _cells_of(u, hidden.shape[1]))
    if (rough[at] & on.is_part).sum() * len(world.emitters.facets.area) <= MOST_PAIRS:
        cells = rough
    own = cells[at] & on.is_part
    j, i = np.nonzero(own)
    key = stream(f"{seed} elements", world.scene.names[s])
    points = np.full(len(j), s), None, None, lifted[own], on.N[own], shift(key, i, j)
    return _Draft(rows, is_alone, area, light, own, points)


@dataclass(frozen=True)
class OnSurface:
    """Points of a surface on a tensor grid (h, w): S, N (h, w, 3); density (h, w), area over area of the map, 0 where
    no part of the surface is; is_part (h, w) bool; chart (h, w) int."""

    S: np.ndarray
    N: np.ndarray
    density: np.ndarray
    is_part: np.ndarray
    chart: np.ndarray


def points_on(world, s, u, v):
    """OnSurface of the tensor grid u, v, the middles of equal cells.

    Where the surface does not fill its map, a cell that holds some of it has a point on it, and counts by the share it
    holds; the whole is as large as the surface.
    """
    surface, domain, turn = world.surface(s), world.domain(s), -1.0 if world.scene.flip[s] else 1.0
    shape = len(v), len(u)
    if domain is None:
        S, N, density = density_grid(whole(surface), u, v)
        return OnSurface(S, N * turn, density, np.ones(shape, dtype=bool), np.zeros(shape, dtype=np.int64))
    chart, share = domain.shares(*shape)
    is_part = chart >= 0
    S, N, density = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
    N[..., 2] = 1.0
    j, i = np.nonzero(is_part)
    places = domain.locate(np.stack([u[i], v[j]], axis=1))
    S[j, i], N[j, i] = frame(surface, places.uv, places.face)
    density[j, i] = frame_density(surface, places.uv, places.face) * share[j, i]
    density *= world.casters.area[s] / max(density.mean(), 1e-300)
    chart[j, i] = places.chart
    return OnSurface(S, N * turn, density, is_part, chart)


def _between_charts(chart, outside, n_u, n_v):
    """(n_v n_u,) bool: elements with points of several charts, or beside one with points of another."""
    low = np.where(outside, np.iinfo(np.int64).max, chart).min(axis=1).reshape(n_v, n_u)
    high = np.where(outside, -1, chart).max(axis=1).reshape(n_v, n_u)
    around_low, around_high = np.pad(low, 1, mode="edge"), np.pad(high, 1, mode="edge")
    for dj in range(3):
        for di in range(3):
            low = np.minimum(low, around_low[dj : dj + n_v, di : di + n_u])
            high = np.maximum(high, around_high[dj : dj + n_v, di : di + n_u])
    return (high > low).ravel()


def _cells_of(t, n):
    """Cell of a lattice with n crossings that holds each parameter t."""
    return np.minimum((t * (n - 1)).astype(int), n - 2)


def _parts(world, s, x, hidden, n_u, n_v):
    """Parts of the elements of surface s, and which links between its points x (4 n_v, 4 n_u, 3) are blocked."""
    usable = _by_point(~hidden, n_u, n_v)
    blocked_u, blocked_v = np.zeros(usable[:, 1:].shape, dtype=bool), np.zeros(usable[1:].shape, dtype=bool)
    if world.casters.is_planar[s]:  # on a curved surface the straight way runs through the surface itself
        for blocked, a, b in ((blocked_u, x[:, :-1], x[:, 1:]), (blocked_v, x[:-1], x[1:])):
            a, b = (np.ascontiguousarray(p.reshape(-1, 3), dtype=np.float32) for p in (a, b))
            blocked[...] = world.tracer.is_blocked(a, b - a).reshape(blocked.shape)
    return parts(blocked_u, blocked_v, usable), (blocked_u, blocked_v)


def _by_point(array, n_u, n_v):
    """The inverse of by_element: (n_v n_u, 16) as (4 n_v, 4 n_u)."""
    return array.reshape(n_v, n_u, POINTS, POINTS).swapaxes(1, 2).reshape(n_v * POINTS, n_u * POINTS)


def is_rough(value, hidden, noise):
    """Cells (h - 1, w - 1) of a lattice in which light is not smooth: corners hidden, in penumbra, or far apart."""
    light = value.max(axis=2, initial=0.0)
    corners = np.stack([light[:-1, :-1], light[:-1, 1:], light[1:, :-1], light[1:, 1:]])
    doubt = (noise > 0) | hidden
    doubt = doubt[:-1, :-1] | doubt[:-1, 1:] | doubt[1:, :-1] | doubt[1:, 1:]
    return doubt | (np.ptp(corners, axis=0) > ROUGH * corners.max(axis=0))


def _walled_cells(blocked, shape):
    """Cells of the base lattice (h, w) in which a link between points is blocked."""
    blocked_u, blocked_v = blocked
    rows, columns = blocked_u.shape[0], blocked_v.shape[1]
    walled = np.zeros((rows, columns), dtype=bool)
    for link, first, last in (
        (blocked_u, np.s_[:, :-1], np.s_[:, 1:]),
        (blocked_v, np.s_[:-1], np.s_[1:]),
    ):
        walled[first] |= link
        walled[last] |= link
    cells = np.zeros((shape[0] - 1, shape[1] - 1), dtype=bool)
    j, i = np.nonzero(walled)
    cells[_cells_of((j + 0.5) / rows, shape[0]), _cells_of((i + 0.5) / columns, shape[1])] = True
    return cells


def finer(value, hidden):
    """Lattice values (h, w, C), hidden (h, w) on the lattice twice as fine, bent as their neighbours say.

    Straight lines cut through every crest, and light is all crests below lamps: the elements would get 0.3 % less than
    was sent.  A midpoint lies above its ends' mean by an eighth of the lesser of the second differences there, where
    both bend the same way: exact on parabolas, straight across shadow edges, and never light between two dark ends.
    """
    for axis in (0, 1):
        value, hidden = np.swapaxes(value, 0, axis), np.swapaxes(hidden, 0, axis)
        bend = np.zeros_like(value)
        bend[1:-1] = value[2:] - 2 * value[1:-1] + value[:-2]
        bend[1:-1][hidden[2:] | hidden[1:-1] | hidden[:-2]] = 0
        bend[0], bend[-1] = bend[1], bend[-2]
        a, b = bend[:-1], bend[1:]
        least = np.where(a * b > 0, np.sign(a) * np.minimum(np.abs(a), np.abs(b)), 0)
        seen = (~hidden).astype(value.dtype)[..., None]
        weight = seen[1:] + seen[:-1]
        mean = (value[1:] * seen[1:] + value[:-1] * seen[:-1]) / np.maximum(weight, 1)
        fine = np.empty((2 * len(value) - 1, *value.shape[1:]), dtype=value.dtype)
        shade = np.empty(fine.shape[:2], dtype=bool)
        fine[::2], fine[1::2] = value, np.maximum(mean - least / 8, 0)
        shade[::2], shade[1::2] = hidden, hidden[1:] & hidden[:-1]
        value, hidden = np.swapaxes(fine, 0, axis), np.swapaxes(shade, 0, axis)
    return value, hidden


def _bilinear(value, hidden, u, v):
    """Lattice values (h, w, C) on the tensor grid u, v, by their visible corners alone: (len v, len u, C)."""
    h, w = value.shape[:2]
    seen = ~hidden[..., None]
    value = np.concatenate([value * seen, seen], axis=2)
    i, j = _cells_of(u, w), _cells_of(v, h)
    fu, fv = (u * (w - 1) - i)[None, :, None], (v * (h - 1) - j)[:, None, None]
    rows = value[j] * (1 - fv) + value[j + 1] * fv
    light = rows[:, i] * (1 - fu) + rows[:, i + 1] * fu
    return light[..., :-1] / np.where(light[..., -1:] > 0, light[..., -1:], 1.0)
