"""First samples of a chunk of surfaces: direct light on the base lattices, and the elements with their rows."""

from dataclasses import dataclass

import numpy as np

from lib.elements.grids import POINTS, by_element, point_parameters
from lib.elements.lattice import OFFSET, receivers
from lib.elements.parts import parts
from lib.nurbs.evaluate import evaluate_grid, frame_grid
from lib.radiosity.direct import direct_light
from lib.radiosity.rows import Rows, element_rows, without
from lib.radiosity.world import FINEST
from lib.visibility.hidden import are_buried
from lib.visibility.qmc import shift, stream

FEW_RAYS = (16, 16)  # to a lamp from one of an element's 16 points


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
        x, N = receivers(
            world.surface(s), world.scene.flip[s], world.casters.sag[s], world.lattices[s], level_of[s], j, i
        )
        up = 2 ** (FINEST - level_of[s])
        cell = np.full(len(j), world.side(s) * 2.0 ** -level_of[s])
        h, w = world.lattices[s].shape(level_of[s])
        uv = np.stack([i / (w - 1), j / (h - 1)], axis=1)
        parts.append((np.full(len(j), s), cell, uv, x, N, shift(stream(seed, world.scene.names[s]), i * up, j * up)))
    return Points(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def direct_at(world, points, shadow_rays):
    """Direct light at points: DirectLight, and which are hidden (only those that no light reaches can be)."""
    light = direct_light(
        points.x,
        points.N,
        points.shift,
        world.emitters,
        world.n_groups,
        world.tracer,
        world.mesh.face_surface,
        *shadow_rays,
    )
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
    wanted = {s: np.nonzero(world.lattices[s].is_own(level_of[s])) for s in surfaces}
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
        shade, noise = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=np.float32)
        value[j, i], shade[j, i], noise[j, i] = light.H[part].reshape(len(j), -1), hidden[part], light.noise[part]
        out[s] = (*(world.lattices[s].copy_own(array) for array in (value, shade, noise)), level_of[s])
    return out, (light.below_horizon, light.dim, light.agreed)


@dataclass(frozen=True)
class Elements:
    """Elements of one surface: rows, is_alone (k,) bool as Parts has it, visible area (k,), mean direct light over
    visible points H_direct (k, 3 G)."""

    rows: Rows
    is_alone: np.ndarray
    area: np.ndarray
    H_direct: np.ndarray


def surface_elements(world, s, seed, grids, R, base):
    """Elements of surface s: their points, rows and direct light.

    base : (value, hidden, ...) of the surface's base lattice; R rays per element, 0 casts none (one bounce).
    """
    n_u, n_v = int(grids.n_u[s]), int(grids.n_v[s])
    surface = world.surface(s)
    u, v = point_parameters(n_u, n_v)
    S, N = frame_grid(surface, u, v)
    N = -N if world.scene.flip[s] else N
    _, S_u, S_v = evaluate_grid(surface, u, v)
    density = by_element(np.linalg.norm(np.cross(S_u, S_v), axis=2))
    x = by_element(S + N * (world.casters.sag[s] + OFFSET))
    number = np.arange(n_u * n_v)
    shifts = shift(stream(f"{seed} rows", world.scene.names[s]), number % n_u, number // n_u)
    if R:
        rows = element_rows(x, by_element(N), shifts, R, world.tracer, world.mesh, grids)
    else:
        none = np.full(density.shape, -1, dtype=np.int32)
        rows = Rows(none, np.zeros(none.shape, dtype=np.uint8), np.zeros(density.shape, dtype=bool))
    found, is_walled = _parts(world, s, S + N * OFFSET, rows.is_hidden, n_u, n_v)
    rows = without(rows, ~found.keeps & ~rows.is_hidden)
    visible = ~rows.is_hidden
    area = (density * visible).mean(axis=1) / (n_u * n_v)
    value, hidden = base[:2]
    light = _bilinear(value, hidden, u, v)
    beside = _beside_walls(is_walled, hidden.shape)
    if beside.any():  # between samples of two rooms nothing can be interpolated
        key = stream(f"{seed} elements", world.scene.names[s])
        j, i = np.nonzero(beside)
        lifted = S[beside] + N[beside] * (world.casters.sag[s] + OFFSET)
        points = Points(np.full(len(j), s), None, None, lifted, N[beside], shift(key, i, j))
        light[beside] = direct_at(world, points, FEW_RAYS)[0].H.reshape(len(j), -1)
    light = by_element(light)
    count = np.maximum(visible.sum(axis=1), 1)[:, None]
    return Elements(rows, found.is_alone, area, (light * visible[..., None]).sum(axis=1) / count)


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


def _beside_walls(blocked, shape):
    """(4 n_v, 4 n_u) bool: points in cells of the base lattice (h, w) in which a link between points is blocked."""
    blocked_u, blocked_v = blocked
    rows, columns = blocked_u.shape[0], blocked_v.shape[1]
    walled = np.zeros((rows, columns), dtype=bool)
    for link, first, last in (
        (blocked_u, np.s_[:, :-1], np.s_[:, 1:]),
        (blocked_v, np.s_[:-1], np.s_[1:]),
    ):
        walled[first] |= link
        walled[last] |= link
    cell_j = ((np.arange(rows) + 0.5) / rows * (shape[0] - 1)).astype(int)
    cell_i = ((np.arange(columns) + 0.5) / columns * (shape[1] - 1)).astype(int)
    cells = np.zeros((shape[0] - 1, shape[1] - 1), dtype=bool)
    j, i = np.nonzero(walled)
    cells[cell_j[j], cell_i[i]] = True
    return cells[cell_j][:, cell_i]


def _bilinear(value, hidden, u, v):
    """Lattice values (h, w, C) on the tensor grid u, v, by their visible corners alone: (len v, len u, C)."""
    h, w = value.shape[:2]
    seen = ~hidden[..., None]
    value = np.concatenate([value * seen, seen], axis=2)
    i, j = np.minimum((u * (w - 1)).astype(int), w - 2), np.minimum((v * (h - 1)).astype(int), h - 2)
    fu, fv = (u * (w - 1) - i)[None, :, None], (v * (h - 1) - j)[:, None, None]
    rows = value[j] * (1 - fv) + value[j + 1] * fv
    light = rows[:, i] * (1 - fu) + rows[:, i + 1] * fu
    return light[..., :-1] / np.where(light[..., -1:] > 0, light[..., -1:], 1.0)
