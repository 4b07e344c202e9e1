"""What the exported files hold: how each surface looks, its triangles in every level, and what lods.json says of them.

A surface looks, in this order: as its own reflectance in the scene's mean light (no map: it only casts shadows); as one
colour (an even map); by light in its vertices (`gouraud`, or `auto` where nothing would show); by its texture.
"""

from dataclasses import dataclass, replace

import numpy as np

from lib.formats import gltf, pictures
from lib.maps import display, gouraud

FAR = 100  # a scene farther from the origin than this many of its sizes is exported around its own centre: float32
GREY = (0.5, 0.5, 0.5)  # reflectance of what has none stated


@dataclass(frozen=True)
class Look:
    """How a surface is drawn: material, (h, w) of its texture, or the linear light (h, w, 3) its vertices carry."""

    material: gltf.Material
    size: tuple | None = None
    in_vertices: np.ndarray | None = None


def looks(x, shapes, maps, rho_avg, exposure, levels, results):
    """A Look for every surface of the scene x; writes the textures.

    shapes : Casters;  maps : TexturedMaps;  rho_avg : {name: (3,)};  levels : LodMeshes;  results : Path
    """
    area = shapes.area[maps.light.surface]
    H = display.mean_irradiance(maps.light, maps.rho_avg, area)
    out = []
    for s, name in enumerate(x.names):
        k = maps.final.position(s)
        if k < 0:
            own = display.light(np.asarray(rho_avg.get(name, GREY)) * H + x.E[s], exposure)
            out.append(Look(gltf.Material(name, colour=_clipped(own))))
            continue
        light = display.picture(maps.final.map(k), maps.final.hidden_map(k), maps.E[k], exposure)
        if (light == light[0, 0]).all():
            out.append(Look(gltf.Material(name, colour=_clipped(light[0, 0]))))
        elif _in_vertices(x.reconstruction[s], maps, k, light, [level.UV[_vertices(level, s)] for level in levels]):
            out.append(Look(gltf.Material(name), in_vertices=light))
        else:
            uri = f"textures/{x.files[s]}.png"
            pictures.write_png_srgb(results / uri, light)
            png = (results / uri).read_bytes()
            out.append(Look(gltf.Material(name, uri=uri, png=png), size=light.shape[:2]))
    return out


def _in_vertices(asked, maps, k, light, vertices):
    """True when map k's light goes into the vertices: asked for, or not to be told from its texture in any level."""
    if asked != "auto":
        return asked == "gouraud"
    h, w = light.shape[:2]
    return (
        maps.final.level[k] == 0
        and not maps.textured[k]
        and gouraud.is_untwisted(light)
        and all(gouraud.holds_lattice(UV, w, h) for UV in vertices)
    )


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
            piece = replace(piece, colour=np.clip(gouraud.at(look.in_vertices, level.UV[own]), 0.0, 1.0))
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
