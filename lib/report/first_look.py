"""A first look at a scene before its light is baked: what its camera sees, lit by random paths.

Direct light is asked for at every pixel, reflected light by a path from one pixel in four (lib.visibility.paths); both
are then smoothed over the plane that a pixel shows, by edge-avoiding wavelets (Dammertz et al. 2010).
Surfaces are of triangles, coarse where they are curved; pictures are on what the camera sees, paths meet averages. For
placing lamps and the camera; no figure of the bake hangs on it.
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
from lib.report.painting import Painting
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
    """One side of a surface: average exitance E (3,) [W/m^2] and reflectance rho (3,), if its light reaches others, and
    the pictures that the two are averages of: None for even ones."""

    E: np.ndarray
    rho: np.ndarray
    reflects: bool = True
    E_picture: Painting | None = None
    rho_picture: Painting | None = None


NO_SIDE = Side(np.zeros(3), np.zeros(3), reflects=False)


@dataclass(frozen=True)
class Thing:
    """One surface of a scene.

    V (n, 3) metres, y up; F (m, 3) int, counterclockwise seen from the front
    front, back : its Sides; None for a back that is not seen;  blocks : it casts shadows
    T (m, 3, 2) : texture coordinates of the triangles' corners, if a side has a picture
    """

    V: np.ndarray
    F: np.ndarray
    front: Side
    back: Side | None = None
    blocks: bool = True
    T: np.ndarray | None = None

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
    t, face, weight = picture.first_visible(model, origin, D)
    hit = np.flatnonzero(face >= 0)
    part, n = model.face_part[face[hit]], len(D)
    N = model.normal[face[hit]]
    N = N / np.maximum(np.linalg.norm(N, axis=1), 1e-300)[:, None]
    is_back = np.einsum("ij,ij->i", N, D[hit]) > 0
    N[is_back] *= -1
    x = (origin[hit] + t[hit, None] * D[hit] - model.mesh.centre) / model.mesh.scale
    side = is_back * len(things) + part
    E, rho = (np.array([getattr(one.sides[k], name) for k in (0, 1) for one in things])[side] for name in ("E", "rho"))
    _paint(E, rho, side, things, model, face[hit], weight[hit], N, D[hit], t[hit] * view.pixel(h))

    direct, indirect = room.direct(x, N, rng, DIRECT_RAYS), np.zeros((len(hit), 3))
    if reflections:
        row, column = hit // w, hit % w
        some = np.flatnonzero(((row + rows[0]) % 2 == 0) & (column % 2 == 0))
        indirect[some] = room.indirect(x[some], N[some], rng)
    out = []
    for values in (np.ones((len(hit), 1)), E, rho, N, x, direct, indirect):
        whole = np.zeros((n, values.shape[1]), dtype=np.float32)
        whole[hit] = values
        out.append(whole.reshape(-1, w, values.shape[1]))
    return Pixels(out[0][..., 0], *out[1:])


def _paint(E, rho, side, things, model, face, weight, N, D, width):
    """Put the pictures of sides in place of their averages E and rho (m, 3), at hits of rays D on faces with normals N
    (m, 3) by pixels of `width` (m,) [m]; side (m,) counts fronts, then backs."""
    first = np.searchsorted(model.face_part, np.arange(len(things)))
    cosine = np.abs(np.einsum("ij,ij->i", N, D)) / np.linalg.norm(D, axis=1)
    for k in np.flatnonzero(np.bincount(side, minlength=1)):
        one = things[k % len(things)]
        own = one.sides[k // len(things)]
        for values, painting in ((E, own.E_picture), (rho, own.rho_picture)):
            if painting is not None:
                at = np.flatnonzero(side == k)
                f = face[at]
                corners = model.mesh.V[model.mesh.F[f]], one.T[f - first[k % len(things)]]
                values[at] = painting.seen(*corners, weight[at], width[at], cosine[at])


def _smoothed(light, known, found, levels):
    """Light (h, w, 3) of pixels, taken from those that are known (h, w) 1, after so many levels of wavelets."""
    for level in range(levels):
        out, out_known = np.empty_like(light), np.empty_like(known)
        smooth(light, known, found.normal, found.place, 1 << level, THICKNESS, out, out_known)
        light, known = out, out_known
    return light
