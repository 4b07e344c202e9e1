"""What the exported files hold: how each surface looks, its triangles in every level, and what lods.json says of them.

A surface looks, in this order: by its reflectance in estimated light, in its vertices (no map: it only casts shadows);
as one colour (an even map); by its map's light in its vertices (`gouraud`, or `auto` where nothing would show); by its
texture.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from lib import forks
from lib.formats import gltf, pictures, textured_maps
from lib.maps import display, estimate, gouraud
from lib.surfaces.mesh import Mesh

FAR = 100  # a scene farther from the origin than this many of its sizes is exported around its own centre: float32
GREY = (0.5, 0.5, 0.5)  # reflectance of what has none stated
FEW = 8  # textures, that are not worth another process


@dataclass(frozen=True)
class Look:
    """How a surface is drawn: its material, (h, w) of its texture, or in_vertices(V, N, UV) -> linear light (k, 3)."""

    material: gltf.Material
    size: tuple | None = None
    in_vertices: Callable | None = None


def looks(x, shapes, maps, rho_avg, exposure, reconstruction, levels, results):
    """A Look for every surface of the scene x; writes the textures.

    shapes : Casters;  maps : TexturedMaps;  rho_avg : {name: (3,)};  levels : LodMeshes;  results : Path
    reconstruction : {name: "texture" or "gouraud"} of surfaces that ask for one, the rest is "auto"
    """
    mean_B = cache(lambda: display.mean_radiosity(textured_maps.reflected(maps), shapes.area[maps.final.surface]))
    lamps = _facets(levels[-1], np.flatnonzero(x.E.any(axis=1)), x.E)

    def look(s):
        name, k = x.names[s], maps.final.position(s)
        if k < 0 and x.is_black[s]:
            return Look(gltf.Material(name, colour=_clipped(display.light(x.E[s], exposure))))
        if k < 0:
            rho = np.asarray(rho_avg.get(name, GREY))
            return Look(gltf.Material(name), in_vertices=partial(_estimated, rho, x.E[s], lamps, mean_B(), exposure))
        light = display.picture(maps.final.map(k), maps.final.hidden_map(k), maps.E[k], exposure)
        if (light[0] == light[0, 0]).all() and (light == light[0, 0]).all():
            return Look(gltf.Material(name, colour=_clipped(light[0, 0])))
        if not isinstance(x.surfaces[s], Mesh) and _in_vertices(
            reconstruction.get(name, "auto"), light, [level.UV[_vertices(level, s)] for level in levels]
        ):
            return Look(gltf.Material(name), in_vertices=partial(_from_map, light))
        uri = f"textures/{x.files[s]}.png"
        png = pictures.write_png_srgb(results / uri, light)
        return Look(gltf.Material(name, uri=uri, png=png), size=light.shape[:2])

    return forks.mapped(look, range(len(x.names)), few=FEW)


def _facets(level, surfaces, E):
    """Corners A, B, C (f, 3) and exitance (f, 3) of the facets of some surfaces of a level."""
    faces = [np.arange(level.face_start[s], level.face_start[s + 1]) for s in surfaces]
    owner = np.repeat(surfaces, [len(f) for f in faces])
    F = level.F[np.concatenate(faces)] if len(faces) else np.empty((0, 3), int)
    return *(level.V[F[:, k]] for k in range(3)), E[owner]


def _estimated(rho, E, lamps, mean_B, exposure, V, N, UV):
    """A Look's in_vertices for a surface without a map."""
    H = estimate.irradiance(V, N.astype(np.float64), *lamps, mean_B)
    return display.light(rho * H + E, exposure)


def _from_map(light, V, N, UV):
    return gouraud.at(light, UV)


def _in_vertices(asked, light, vertices):
    """True when a map's light goes into the vertices: asked for, or not to be told from its texture in any level."""
    if asked != "auto":
        return asked == "gouraud"
    h, w = light.shape[:2]
    # The coarsest level, which comes last, has too few vertices for most maps: they are told apart without their light.
    return all(gouraud.holds_lattice(UV, w, h) for UV in reversed(vertices)) and gouraud.is_untwisted(light)


def _clipped(light):
    return tuple(np.clip(light, 0.0, 1.0).tolist())


def _vertices(level, s):
    return slice(level.vertex_start[s], level.vertex_start[s + 1])


def origin(shapes, up):
    """Where the exported scene's own origin lies (3,), y up: 0 unless the scene is far away."""
    is_far = np.abs(shapes.centre).max() > FAR * shapes.scale
    return gltf.y_up(shapes.centre if is_far else np.zeros(3), up).astype(np.float32).astype(np.float64)


def pieces(level, looks, up, origin):
    """The level's triangles: a gltf.Piece a surface, y up, relative to `origin` (3,)."""
    V, N = gltf.y_up(level.V, up) - origin, gltf.y_up(level.N, up)
    out = []
    for s, look in enumerate(looks):
        own = _vertices(level, s)
        F = level.F[level.face_start[s] : level.face_start[s + 1]] - level.vertex_start[s]
        piece = gltf.Piece(look.material.name, s, V[own], N[own], F)
        if look.material.uri:
            h, w = look.size
            piece = replace(piece, ST=gltf.texture_coordinates(level.UV[own], w, h))
        elif look.in_vertices is not None:
            colour = look.in_vertices(level.V[own], level.N[own], level.UV[own])
            piece = replace(piece, colour=np.clip(colour, 0.0, 1.0))
        out.append(piece)
    return out


def row(file, level, pieces, origin, area, mapped, coverage, n_bytes):
    """What lods.json says of one level.

    area (n,) of the surfaces, any unit; mapped: indices of those with a map; coverage: its smallest screen coverage
    """
    V = np.concatenate([p.V for p in pieces if len(p.F)]) + origin
    return {
        "file": file,
        "asked": level.asked,
        "note": level.note,
        "triangles": len(level.F),
        "mapped_triangles": int(np.diff(level.face_start)[mapped].sum()),
        "vertices": len(V),
        "tolerance": level.tolerance,
        "max_distance": float(level.distance.max()),
        "rms_distance": float(np.sqrt((area * level.rms**2).sum() / area.sum())),
        "max_slide": float(level.slide.max()),
        "gap": level.gap,
        "bounding_box": {"min": V.min(axis=0).tolist(), "max": V.max(axis=0).tolist()},
        "screen_coverage": coverage,
        "bytes": n_bytes,
    }


def sweep(results, n_levels, uris):
    """Remove what an earlier run with more levels or other surfaces left behind."""
    for path in results.glob("scene_LOD*.*"):
        number = path.stem.removeprefix("scene_LOD")
        if path.suffix in (".gltf", ".bin") and number.isdigit() and int(number) >= n_levels:
            path.unlink()
    for path in (results / "textures").glob("*.png"):
        if f"textures/{path.name}" not in uris:
            path.unlink()
