"""A first look at a scene before its light is baked: what its camera sees, lit by random paths.

Direct light is asked for at every pixel, reflected light by a path from one pixel in four (lib.visibility.paths); both
are then smoothed over the plane that a pixel shows, by edge-avoiding wavelets (Dammertz et al. 2010).
Surfaces are of triangles, coarse where they are curved, and have their average reflectance. For placing lamps and the
camera; no figure of the bake hangs on it.
"""

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from lib import forks
from lib.maps import display
from lib.maps.colour import linear_to_srgb
from lib.report import camera as cameras
from lib.report import picture
from lib.report.smoothing_kernels import smooth
from lib.visibility.paths import Room, lamps_of
from lib.visibility.tracer import Tracer

SIZE = (640, 400)  # pixels
BANDS = 8  # of rows, drawn by themselves
DIRECT_RAYS = 6
DIRECT_LEVELS, INDIRECT_LEVELS = 2, 5  # of wavelets: as many smooth out the noise
THICKNESS = 0.02  # sine^2 of the angle under which a place leaves the plane of another that it counts for by half
LAMP_SIDE = 0.02  # of a lamp's triangles at most, in the frame
WHITE = 0.99  # of the pixels stay below it; a bake's is that of its surfaces' area


@dataclass(frozen=True)
class Side:
    """One side of a surface: exitance E (3,) [W/m^2], average reflectance rho (3,), and if its light reaches others."""

    E: np.ndarray
    rho: np.ndarray
    reflects: bool = True


NO_SIDE = Side(np.zeros(3), np.zeros(3), reflects=False)


@dataclass(frozen=True)
class Thing:
    """One surface of a scene.

    V (n, 3) metres, y up; F (m, 3) int, counterclockwise seen from the front
    front, back : its Sides; None for a back that is not seen;  blocks : it casts shadows
    """

    V: np.ndarray
    F: np.ndarray
    front: Side
    back: Side | None = None
    blocks: bool = True

    @property
    def sides(self):
        """Front and back, NO_SIDE for none."""
        return self.front, self.back or NO_SIDE


class Pixels(NamedTuple):
    """What (h, w) pixels show: seen 1, or 0 where nothing is; emitted light, reflectance, normal and place in the frame
    of the scene, irradiance by direct light and, on every other row and column, by reflections: (h, w, 3) float32 each.
    """

    seen: np.ndarray
    emitted: np.ndarray
    rho: np.ndarray
    normal: np.ndarray
    place: np.ndarray
    direct: np.ndarray
    indirect: np.ndarray


def draw(things, view=None, exposure=None, reflections=True, seed=0):
    """The picture (height, width, 3) uint8, sRGB, of SIZE.

    things : list of Thing;  view : lib.report.camera.Camera, None for one that shows most
    exposure : of radiance, as in a bake; None takes the 99th percentile to white;  reflections : False for direct light

    The same for any number of processes.
    """
    w, h = SIZE
    model = cache(lambda: _model(things))
    room = cache(lambda: _room(things, model()))
    # Each process makes its own tracers; a fork can wait forever for threads of one that its parent has used.
    few = 1 if view else BANDS
    view = view or cameras.automatic(model())

    def band(rows):
        rng = np.random.default_rng([seed, rows[0]])
        return _seen(things, model(), room(), view, rows, reflections, rng)

    edges = np.linspace(0, h, BANDS + 1).astype(int).tolist()
    bands = forks.mapped(band, list(zip(edges[:-1], edges[1:], strict=True)), few=few)
    found = Pixels(*(np.concatenate(part) for part in zip(*bands, strict=True)))
    H = _smoothed(found.direct, found.seen, found, DIRECT_LEVELS)
    if reflections:
        known = np.zeros_like(found.seen)
        known[::2, ::2] = found.seen[::2, ::2]
        H += _smoothed(found.indirect, known, found, INDIRECT_LEVELS)
    B = found.rho * H
    if exposure is None:
        top = B.max(axis=2)[found.seen > 0]
        white = float(np.quantile(top, WHITE)) / np.pi if top.size else 0.0
        exposure = 1 / white if white > 0 else 1.0
    shown = np.rint(255 * linear_to_srgb(display.light(B + found.emitted, exposure))).astype(np.uint8)
    shown[found.seen == 0] = np.rint(255 * np.array(picture.BACKGROUND))
    return shown


def _model(things):
    return picture.join([picture.Part(one.V, one.F, is_two_sided=one.back is not None) for one in things])


def _room(things, model):
    """The Room of what casts shadows; lamps shine to the side that they emit on."""
    V = (model.mesh.V - model.mesh.centre) / model.mesh.scale
    surface, n = model.face_part, len(things)
    sides = [one.sides[k] for k in (0, 1) for one in things]
    both = np.concatenate([model.mesh.F, model.mesh.F[:, ::-1]])
    E = np.array([side.E for side in sides], dtype=np.float64)
    lamps = lamps_of(V, both, np.concatenate([surface, surface + n]), E, LAMP_SIDE)
    rho = np.array([side.rho * side.reflects for side in sides], dtype=np.float64)
    blocks = np.array([one.blocks for one in things])[surface]
    F = model.mesh.F[blocks]
    return Room(V, F, surface[blocks], rho[:n], rho[n:], lamps, Tracer(V, F))


def _seen(things, model, room, view, rows, reflections, rng):
    """The Pixels of some rows of the picture."""
    w, h = SIZE
    origin, D = view.rays(w, h, *rows)
    t, face, _ = picture.first_visible(model, origin, D)
    hit = np.flatnonzero(face >= 0)
    part, n = model.face_part[face[hit]], len(D)
    N = model.normal[face[hit]]
    N = N / np.maximum(np.linalg.norm(N, axis=1), 1e-300)[:, None]
    is_back = np.einsum("ij,ij->i", N, D[hit]) > 0
    N[is_back] *= -1
    x = (origin[hit] + t[hit, None] * D[hit] - model.mesh.centre) / model.mesh.scale
    side = is_back * len(things) + part
    E, rho = (np.array([getattr(one.sides[k], name) for k in (0, 1) for one in things]) for name in ("E", "rho"))

    direct, indirect = room.direct(x, N, rng, DIRECT_RAYS), np.zeros((len(hit), 3))
    if reflections:
        row, column = hit // w, hit % w
        some = np.flatnonzero(((row + rows[0]) % 2 == 0) & (column % 2 == 0))
        indirect[some] = room.indirect(x[some], N[some], rng)
    out = []
    for values in (np.ones((len(hit), 1)), E[side], rho[side], N, x, direct, indirect):
        whole = np.zeros((n, values.shape[1]), dtype=np.float32)
        whole[hit] = values
        out.append(whole.reshape(-1, w, values.shape[1]))
    return Pixels(out[0][..., 0], *out[1:])


def _smoothed(light, known, found, levels):
    """Light (h, w, 3) of pixels, taken from those that are known (h, w) 1, after so many levels of wavelets."""
    for level in range(levels):
        out, out_known = np.empty_like(light), np.empty_like(known)
        smooth(light, known, found.normal, found.place, 1 << level, THICKNESS, out, out_known)
        light, known = out, out_known
    return light
