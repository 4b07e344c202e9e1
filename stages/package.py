"""Write the files a viewer opens: textures, one glTF per level of detail, all levels in one GLB, and lods.json.

reads   scene.npz, casters.npz, textures.npz, lod_<k>.npz of every level, finest first, reflectances
                                                  (lib.formats.scene, .casters, .textured_maps, .lod_mesh)
        budget.json: the automatic exposure; without it that of textures.npz
        settings: {"exposure": "auto" or a number > 0, "reconstruction": {surface: "texture" | "gouraud"}}
writes  RESULTS/textures/<surface>.png, scene_LOD<k>.gltf and .bin, scene.glb, lods.json

Profile `standard`: KHR_materials_unlit, base colour texture = (B_final + E) / pi times exposure, sRGB, one a surface.
A surface that shines by a picture has it, times its emission, in place of E.
A surface of one even colour gets that colour and no texture.  A surface that only casts shadows has no map: its
vertices carry an estimate, its reflectance in the lamps' light without shadows and the mean radiosity of the rest.
Reconstruction `gouraud` puts a map's light into the vertices, and so does `auto` where it would not show: all levels
have vertices on the lines of the map's lattice.
"""

from pathlib import Path

import numpy as np

from lib import door
from lib.formats import casters, export, gltf, lod_mesh, scene, textured_maps
from lib.formats.artefact import read_json, write_json
from lib.lod.coverage import screen_coverage
from lib.maps import exposure as exposures
from lib.refusal import refusal


def arguments(parser):
    parser.add_argument("--scene", required=True, metavar="FILE", help="scene.npz")
    parser.add_argument("--casters", required=True, metavar="FILE", help="casters.npz")
    parser.add_argument("--textures", required=True, metavar="FILE", help="textures.npz")
    parser.add_argument("--budget", metavar="FILE", help="budget.json of budget_reduce")
    parser.add_argument("--materials", required=True, metavar="FILE", help="JSON: rho_avg of every surface")
    parser.add_argument("--lods", required=True, nargs="+", metavar="FILE", help="lod_<k>.npz, finest first")
    parser.add_argument("--settings", type=door.json_text, default={}, metavar="JSON", help="exposure")
    parser.add_argument("--results", required=True, metavar="FOLDER", help="where the files go")


def body(args, cost):
    x, shapes, maps = scene.load(args.scene), casters.load(args.casters), textured_maps.load(args.textures)
    levels = [lod_mesh.load(path) for path in args.lods]
    results, mapped = Path(args.results), maps.final.surface

    asked = args.settings.get("exposure", "auto")
    if asked == "auto" and args.budget:
        asked = read_json(args.budget)["exposure"]
    exposure = chosen_exposure(asked, maps, shapes.area[mapped])
    extras = {"unit": "B_over_pi", "encoding": "srgb", "exposure": exposure}
    rho_avg, ways = read_json(args.materials)["rho_avg"], args.settings.get("reconstruction", {})
    looks = export.looks(x, shapes, maps, rho_avg, exposure, ways, levels, results)
    materials = [look.material for look in looks]

    origin = export.origin(shapes, x.up)
    pieces = [export.pieces(level, looks, x.up, origin) for level in levels]
    coverage = screen_coverage([level.distance.max() for level in levels], shapes.scale).tolist()
    rows = []
    for k, level in enumerate(levels):
        path = results / f"scene_LOD{k}.gltf"
        n_bytes = gltf.write_level(path, pieces[k], materials, origin, extras)
        rows.append(export.row(path.name, level, pieces[k], origin, shapes.area, mapped, coverage[k], n_bytes))
    whole = gltf.write_combined(results / "scene.glb", pieces, materials, coverage, origin, extras)

    textures = {m.name: m.uri for m in materials if m.uri}
    export.sweep(results, len(levels), set(textures.values()))
    manifest = {
        "profile": "standard",
        "up": "y",
        "length_unit": "m",
        **extras,
        "combined": {"file": "scene.glb", "bytes": whole},
        "textures": textures,
        "texture_bytes": sum(len(m.png) for m in materials if m.uri),
        "in_vertices": [look.material.name for look in looks if look.in_vertices is not None],
        "levels": rows,
    }
    write_json(results / "lods.json", manifest)
    cost.notes.update(textures=len(textures), in_vertices=len(manifest["in_vertices"]), exposure=exposure)


def chosen_exposure(asked, maps, area):
    """The exposure as a number: asked for, or by the light of TexturedMaps whose surfaces have `area` (m,)."""
    if asked == "auto":
        return exposures.automatic(textured_maps.reflected(maps), area)
    if isinstance(asked, bool) or not isinstance(asked, int | float) or not 0 < asked < np.inf:
        raise refusal(f"{asked!r}, allowed are auto or a number > 0", field="export: exposure")
    return float(asked)


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
