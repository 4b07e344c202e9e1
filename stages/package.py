"""Write the files a viewer opens: textures, one glTF per level of detail, all levels in one GLB, and lods.json.

reads   scene.npz, casters.npz, textures.npz, lod_<k>.npz of every level, finest first, reflectances
                                                  (lib.formats.scene, .casters, .textured_maps, .lod_mesh)
        settings: {"exposure": "auto" or a number > 0}
writes  RESULTS/textures/<surface>.png, scene_LOD<k>.gltf and .bin, scene.glb, lods.json

Profile `standard`: KHR_materials_unlit, base colour texture = (B_final + E) / pi times exposure, sRGB, one a surface.
A surface of one even colour gets that colour and no texture.  A surface that only casts shadows has no map: it is drawn
in its reflectance, lit by the scene's mean irradiance.
"""

import json
from pathlib import Path

import numpy as np

from lib import door
from lib.formats import casters, gltf, lod_mesh, pictures, scene, textured_maps
from lib.formats.artefact import read_json, write_json
from lib.lod.coverage import screen_coverage
from lib.maps import exposure as exposures
from lib.maps.fill import push_pull
from lib.refusal import refusal

FAR = 100  # a scene farther from the origin than this many of its sizes is exported around its own centre: float32


def arguments(parser):
    parser.add_argument("--scene", required=True, metavar="FILE", help="scene.npz")
    parser.add_argument("--casters", required=True, metavar="FILE", help="casters.npz")
    parser.add_argument("--textures", required=True, metavar="FILE", help="textures.npz")
    parser.add_argument("--materials", required=True, metavar="FILE", help="JSON: rho_avg of every surface")
    parser.add_argument("--lods", required=True, nargs="+", metavar="FILE", help="lod_<k>.npz, finest first")
    parser.add_argument("--settings", type=json.loads, default={}, metavar="JSON", help="exposure")
    parser.add_argument("--results", required=True, metavar="FOLDER", help="where the files go")


def body(args, cost):
    x, shapes, maps = scene.load(args.scene), casters.load(args.casters), textured_maps.load(args.textures)
    rho_avg = read_json(args.materials)["rho_avg"]
    levels = [lod_mesh.load(path) for path in args.lods]
    results = Path(args.results)

    exposure = chosen_exposure(args.settings.get("exposure", "auto"), maps, shapes.area)
    extras = {"unit": "B_over_pi", "encoding": "srgb", "exposure": exposure}
    H = ambient(maps, shapes.area)
    materials = [look(s, x, maps, rho_avg, exposure, H, results) for s in range(len(x.names))]

    origin = shapes.centre if np.abs(shapes.centre).max() > FAR * shapes.scale else np.zeros(3)
    origin = gltf.y_up(origin, x.up).astype(np.float32).astype(np.float64)
    pieces = [cut(level, x, maps, materials, origin) for level in levels]
    coverage = screen_coverage([level.distance.max() for level in levels], shapes.scale)
    rows = []
    for k, level in enumerate(levels):
        path = results / f"scene_LOD{k}.gltf"
        n_bytes = gltf.write_level(path, pieces[k], materials, origin, extras)
        rows.append(row(path.name, level, pieces[k], origin, shapes.area, maps, float(coverage[k]), n_bytes))
    whole = gltf.write_combined(results / "scene.glb", pieces, materials, coverage, origin, extras)
    sweep(results, len(levels), {m.uri for m in materials})
    write_json(
        results / "lods.json",
        {
            "profile": "standard",
            "up": "y",
            "length_unit": "m",
            **extras,
            "combined": {"file": "scene.glb", "bytes": whole},
            "textures": {m.name: m.uri for m in materials if m.uri},
            "texture_bytes": sum(len(m.png) for m in materials if m.uri),
            "levels": rows,
        },
    )
    cost.notes.update(textures=sum(m.uri is not None for m in materials), exposure=exposure)


def chosen_exposure(asked, maps, area):
    """The exposure as a number."""
    if asked == "auto":
        return exposures.automatic(maps.final, area[maps.final.surface])
    if isinstance(asked, bool) or not isinstance(asked, int | float) or not 0 < asked < np.inf:
        raise refusal(f"{asked!r}, allowed are auto or a number > 0", field="export: exposure")
    return float(asked)


def ambient(maps, area):
    """Mean irradiance (3,) of the surfaces that have a map and reflect; 0 where there is none."""
    total, weight = np.zeros(3), np.zeros(3)
    for k, s in enumerate(maps.light.surface):
        seen = ~maps.light.hidden_map(k)
        if seen.any():
            rho = maps.rho_avg[k]
            H = np.where(rho > 0, maps.light.map(k)[seen].mean(axis=0) / np.where(rho > 0, rho, 1), 0)
            total += area[s] * H
            weight += area[s] * (rho > 0)
    return total / np.where(weight > 0, weight, 1)


def look(s, x, maps, rho_avg, exposure, H, results):
    """The gltf.Material of surface s; its texture is written if it has one."""
    name, k = x.names[s], maps.final.position(s)
    if k < 0:
        B = np.asarray(rho_avg.get(name, (0.5, 0.5, 0.5))) * H
        return gltf.Material(name, colour=shown(B + x.E[s], exposure))
    value, hidden = maps.final.map(k), maps.final.hidden_map(k)
    light = (push_pull(value, hidden) + maps.E[k]) / np.pi * exposure
    if (light == light[0, 0]).all():
        return gltf.Material(name, colour=shown(value[0, 0] + maps.E[k], exposure))
    uri = f"textures/{x.files[s]}.png"
    pictures.write_png_srgb(results / uri, light)
    return gltf.Material(name, uri=uri, png=(results / uri).read_bytes())


def shown(B, exposure):
    """Radiosity (3,) as a linear colour of the screen, clipped at white."""
    return tuple(np.clip(np.asarray(B, dtype=np.float64) / np.pi * exposure, 0.0, 1.0).tolist())


def cut(level, x, maps, materials, origin):
    """The pieces of a LodMesh: a gltf.Piece a surface, y up, relative to `origin` (3,)."""
    V = gltf.y_up(level.V, x.up) - origin
    N = gltf.y_up(level.N, x.up)
    w, h = maps.final.sizes()
    pieces = []
    for s, material in enumerate(materials):
        own = slice(level.vertex_start[s], level.vertex_start[s + 1])
        F = level.F[level.face_start[s] : level.face_start[s + 1]] - level.vertex_start[s]
        ST = None
        if material.uri:
            k = maps.final.position(s)
            ST = gltf.texture_coordinates(level.UV[own], int(w[k]), int(h[k]))
        pieces.append(gltf.Piece(x.names[s], s, V[own], N[own], F, ST))
    return pieces


def row(file, level, pieces, origin, area, maps, coverage, n_bytes):
    """What lods.json says of one level."""
    V = np.concatenate([p.V for p in pieces if len(p.F)]) + origin
    mapped = np.diff(level.face_start)[maps.final.surface]
    return {
        "file": file,
        "asked": level.asked,
        "note": level.note,
        "triangles": len(level.F),
        "mapped_triangles": int(mapped.sum()),
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


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
