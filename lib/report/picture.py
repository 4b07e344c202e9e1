"""A picture of a textured mesh as an unlit viewer shows it: one first hit a ray, bilinear texture lookups, no light.

The bake is in the textures, so this picture is what every viewer of the exported files draws, and a wrong texture
coordinate, a flipped face or a seam shows up in it.

Conventions: world y up (glTF). Texture coordinates are glTF's: s, t in [0, 1] from the upper left corner of the
picture, row 0 is its upper row, texel centres at +0.5. Filtering and averaging happen in linear light, as a viewer with
sRGB textures does it; the sRGB curve comes last.
"""

from dataclasses import dataclass, field

import numpy as np

from lib.maps.colour import linear_to_srgb, srgb_to_linear
from lib.report import rays, shading_kernels
from lib.surfaces.rows import numbered

RAYS_AT_ONCE = 1 << 17
THROUGH = 12  # culled faces a ray may pass before it counts as missed
STEP = 1e-6  # a ray goes on behind a culled face by this part of the scene's size (float32 ray tracer: about 8 ulp)
WRAPS = ("clamp", "repeat", "mirror")  # as shading_kernels numbers them
BACKGROUND = (0.16, 0.17, 0.18)  # sRGB; dark enough to set off a lit room, not mistaken for a black surface


@dataclass(frozen=True)
class Part:
    """One drawn piece of mesh.

    V (n_v, 3) float64 metres, y up; F (n_f, 3) int; ST (n_v, 2) float64 texture coordinates or None; colour (n_v, 3)
    float64 linear vertex colours or None; factor (3,) linear; texture: index in the list of textures or -1.
    """

    V: np.ndarray
    F: np.ndarray
    ST: np.ndarray | None = None
    colour: np.ndarray | None = None
    factor: tuple = (1.0, 1.0, 1.0)
    texture: int = -1
    is_two_sided: bool = False
    name: str = ""


@dataclass(frozen=True)
class Texture:
    """A picture: linear light (h, w, 3) float32, or integer codes of it; wrap of s and of t: "clamp", "repeat" or
    "mirror".

    light : (k,) float32, the linear light of each code, or None. A few texels of a picture are seen, all would take
        four times the memory of their codes.
    """

    texels: np.ndarray
    wrap: tuple = ("repeat", "repeat")
    light: np.ndarray | None = None

    @property
    def rgb(self):
        """Linear light (h, w, 3) float32 of all texels."""
        return self.texels if self.light is None else self.light[self.texels]

    def at(self, k):
        """Linear light (n, 3) float32 of the texels of numbers k (n,), row after row."""
        found = self.texels.reshape(-1, 3).take(k, 0)
        return found if self.light is None else self.light.take(found)


@dataclass(frozen=True)
class Model:
    """Parts joined into one mesh, ready to be looked at."""

    mesh: rays.Mesh
    face_part: np.ndarray  # (n_f,)
    normal: np.ndarray  # (n_f, 3) geometric, any length
    ST: np.ndarray  # (n_f, 3, 2) texture coordinates of the corners
    colour: np.ndarray | None  # (n_f, 3, 3) vertex colours of the corners, None where no part has any
    twin: np.ndarray  # (n_f,) the face that is the other side of the same triangle, or -1
    order: np.ndarray  # (n_f, 3) corners in an order that twins have in common
    parts: list = field(repr=False)

    @property
    def size(self):
        return self.mesh.scale


def join(parts):
    """Model of a list of Part."""
    starts = np.cumsum([0] + [len(p.V) for p in parts])
    V = np.concatenate([np.zeros((0, 3))] + [np.asarray(p.V, float) for p in parts])
    F = np.concatenate(
        [np.zeros((0, 3), int)] + [np.asarray(p.F, int) + s for p, s in zip(parts, starts, strict=False)]
    )
    ST = np.concatenate([np.zeros((0, 2))] + [np.zeros((len(p.V), 2)) if p.ST is None else p.ST for p in parts])
    colour = None
    if any(p.colour is not None for p in parts):
        colour = np.concatenate([np.ones((len(p.V), 3)) if p.colour is None else p.colour for p in parts])[F]
    face_part = np.repeat(np.arange(len(parts)), [len(p.F) for p in parts])
    mesh, corner = rays.prepare(V, F), V[F]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return Model(mesh, face_part, normal, ST[F], colour, *_twins(corner), list(parts))


def _twins(corner):
    """(twin (n_f,), order (n_f, 3)) of triangles (n_f, 3, 3): which lie in one another, wound the other way round."""
    n = len(corner)
    twin, order = np.full(n, -1), np.zeros((n, 3), dtype=np.int64)
    if not n:
        return twin, order
    place = numbered(corner.reshape(-1, 3))[0].reshape(n, 3)
    order = np.argsort(place, axis=1, kind="stable")
    same = np.unique(np.take_along_axis(place, order, axis=1), axis=0, return_inverse=True)[1].ravel()
    by = np.argsort(same, kind="stable")
    next_to = same[by[1:]] == same[by[:-1]]
    a, b = by[:-1][next_to], by[1:][next_to]
    step = (order[:, 1] - order[:, 0]) % 3  # 1 or 2: which way round
    turned = step[a] != step[b]
    twin[a[turned]], twin[b[turned]] = b[turned], a[turned]
    return twin, order


def first_visible(model, origin, direction):
    """Like `rays.first_hits`, but a ray passes through the back of a one-sided part (back-face culling).

    Returns t (n,) in lengths of `direction`, face (n,), weight (n, 3).
    """
    t, face, weight = rays.first_hits(model.mesh, origin, direction)
    two_sided = np.array([p.is_two_sided for p in model.parts] + [True])
    step = STEP * model.size / np.maximum(np.linalg.norm(direction, axis=1), 1e-300)
    for _ in range(THROUGH):
        hit = np.flatnonzero(face >= 0)
        behind = np.einsum("nx,nx->n", model.normal.take(face[hit], 0), direction.take(hit, 0)) > 0
        again = hit[behind & ~two_sided[model.face_part[face[hit]]]]
        again = again[~_turned(model, face, weight, again)]
        if not len(again):
            break
        start = t[again] + step[again]
        more, face[again], weight[again] = rays.first_hits(
            model.mesh, origin[again] + start[:, None] * direction[again], direction[again]
        )
        t[again] = start + more
    else:
        t[again], face[again], weight[again] = np.inf, -1, 0.0
    return t, face, weight


def _turned(model, face, weight, some):
    """Hits of the rays `some` on the back of a face with a twin become hits on the twin, in place: which (k,) bool."""
    twin = model.twin[face[some]]
    has = twin >= 0
    of, old = some[has], face[some[has]]
    moved = np.take_along_axis(weight[of], model.order[old], axis=1)
    face[of] = twin[has]
    out = np.zeros_like(moved)
    np.put_along_axis(out, model.order[twin[has]], moved, axis=1)
    weight[of] = out
    return has


def render(model, textures, camera, width, height, samples=2, background=BACKGROUND):
    """Draw a model: (height, width, 3) uint8, sRGB. Arguments as for `render_with_edges`."""
    return render_with_edges(model, textures, camera, width, height, samples, background, 0.0)[0]


def render_with_edges(model, textures, camera, width, height, samples=2, background=BACKGROUND, edges=0.6):
    """Draw a model, and once more with its triangles.

    Parameters
    ----------
    model : Model
    textures : list of Texture
    camera : lib.report.camera.Camera
    samples : int
        Rays a pixel are samples x samples.
    background : (3,) sRGB in [0, 1], where no face is seen.
    edges : float
        Share by which light is dimmed where two triangles meet, in the second picture.

    Returns
    -------
    two pictures (height, width, 3) uint8, sRGB
    """
    w, h = width * samples, height * samples
    back = srgb_to_linear(np.asarray(background, float))
    image = np.empty((h, w, 3), np.float32)
    seen = np.full((h, w), -1, np.int64)
    rows = max(1, RAYS_AT_ONCE // w)
    for top in range(0, h, rows):
        below = min(h, top + rows)
        origin, direction = camera.rays(w, h, top, below)
        _, face, weight = first_visible(model, origin, direction)
        colour = shade(model, textures, face, weight)
        colour[face < 0] = back
        image[top:below] = colour.reshape(below - top, w, 3)
        seen[top:below] = face.reshape(below - top, w)
    plain = _developed(image, height, width, samples)
    if not edges:
        return plain, plain
    image[borders(seen)] *= 1 - edges
    return plain, _developed(image, height, width, samples)


def _developed(image, height, width, samples):
    """8-bit sRGB of linear light, averaged over samples x samples."""
    image = image.reshape(height, samples, width, samples, 3)
    mean = sum(image[:, a, :, b] for a in range(samples) for b in range(samples)) / samples**2
    return np.rint(linear_to_srgb(mean) * 255).astype(np.uint8)


def shade(model, textures, face, weight):
    """Linear colour (n, 3) float32 of hits; black where face is -1."""
    part = np.append(model.face_part, len(model.parts)).take(face)
    factor = np.array([p.factor for p in model.parts] + [(0, 0, 0)], np.float32)
    colour = factor.take(part, 0)
    if model.colour is not None:
        colour *= _interpolated(model.colour, np.maximum(face, 0), weight)
    texture = np.array([p.texture for p in model.parts] + [-1]).take(part)
    for k in np.flatnonzero(np.bincount(texture + 1)[1:]):
        here, own = np.flatnonzero(texture == k), textures[k]
        if own.texels.dtype == np.uint8:
            wraps = (WRAPS.index(how) for how in own.wrap)
            shading_kernels.multiply(here, face, weight, model.ST, own.texels, own.light, *wraps, colour)
        else:
            colour[here] *= lookup(own, _interpolated(model.ST, face.take(here), weight.take(here, 0)))
    return colour


def _interpolated(corners, face, weight):
    """Values (n, c) of corner values (n_f, 3, c) at barycentric weights (n, 3) of faces."""
    value = corners.take(face, 0)
    return sum(weight[:, k, None] * value[:, k] for k in range(3))


def lookup(texture, st):
    """Bilinear value (n, 3) at texture coordinates (n, 2): the sample of column i, row j is at ((i+.5)/w, (j+.5)/h)."""
    h, w = texture.texels.shape[:2]
    x, y = st[:, 0] * w - 0.5, st[:, 1] * h - 0.5
    i, j = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    a, b = ((x - i)[:, None]).astype(np.float32), ((y - j)[:, None]).astype(np.float32)
    i0, i1 = (_wrap(k, w, texture.wrap[0]) for k in (i, i + 1))
    j0, j1 = (_wrap(k, h, texture.wrap[1]) * w for k in (j, j + 1))
    upper = (1 - a) * texture.at(j0 + i0) + a * texture.at(j0 + i1)
    lower = (1 - a) * texture.at(j1 + i0) + a * texture.at(j1 + i1)
    return (1 - b) * upper + b * lower


def _wrap(k, n, how):
    if how == "clamp":
        return np.clip(k, 0, n - 1)
    if how == "mirror":
        k = k % (2 * n)
        return np.minimum(k, 2 * n - 1 - k)
    return k % n


def borders(seen):
    """Pixels whose right or lower neighbour shows another triangle."""
    border = np.zeros(seen.shape, bool)
    border[:, :-1] |= seen[:, :-1] != seen[:, 1:]
    border[:-1] |= seen[:-1] != seen[1:]
    return border
