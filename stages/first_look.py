"""Draw a scene before its light is baked, for a first look: what its camera sees, by a few random paths a pixel.

reads   geometry-<hash>.json    the slice of the settings for geometry, roles and light     (lib.formats.scene_import)
        folder.json beside it, and the geometry files in the folder it names
        materials: {"rho_avg": {surface: [r, g, b]}};  textures: see lib.formats.texture_rows; and their pictures
        settings: {"camera": {"eye", "target", "fov"} in the scene's units or null, "units", "up", "exposure": "auto" or
        a number > 0, "bounces": 1 for direct light alone, "seed"}
writes  first_look.png

Curved surfaces have facets, and the light is smoothed noise: it shows where lamps, camera and things stand while the
bake runs.  No other stage reads it, and its rays are none of the bake.
"""

from functools import cache
from pathlib import Path

import numpy as np

from lib import door, forks
from lib.formats import artefact, pictures, scene_import, texture_rows
from lib.formats.scene_view import scene_camera
from lib.maps.base_texture import coordinates, wraps
from lib.maps.mesh_texture import Pyramid
from lib.report import first_look
from lib.report.first_look import Side, Thing
from lib.report.painting import Painting
from lib.surfaces.coarse import coarse

LINES = 33  # of a curved surface


def arguments(parser):
    parser.add_argument("--scene-slice", required=True, metavar="FILE", help="geometry-<hash>.json")
    parser.add_argument("--materials", required=True, metavar="FILE", help="JSON: rho_avg of every surface")
    parser.add_argument("--textures", required=True, metavar="FILE", help="JSON: pictures of surfaces")
    parser.add_argument("--settings", type=door.json_text, default={}, metavar="JSON")
    parser.add_argument("--out", required=True, metavar="FILE", help="PNG to write")


def body(args, cost):
    at = artefact.read_json(Path(args.scene_slice).parent / "folder.json")
    home = Path(args.scene_slice).parents[1]
    piece = artefact.read_json(args.scene_slice)
    x = scene_import.read(piece, at["folder"], at["file"], home / "cache", charts=False)
    told, rho_avg = args.settings, artefact.read_json(args.materials)["rho_avg"]
    camera, exposure = told.get("camera"), told.get("exposure", "auto")
    image = first_look.draw(
        things(x, rho_avg, *paintings(x, *texture_rows.read(args.textures))),
        view=scene_camera(camera, told) if camera else None,
        exposure=None if exposure == "auto" else float(exposure),
        reflections=told.get("bounces", "converge") != 1,
        seed=int(told.get("seed", 1)),
    )
    pictures.write_png8(args.out, image)
    print(f"first look: {args.out}", flush=True)


def paintings(x, textures, emission):
    """{surface: Painting} of reflectance and of exitance of a Scene x, by texture_rows; a file is read once."""
    read = cache(lambda *source: Pyramid(pictures.read_linear(*source)))
    surface = dict(zip(x.names, x.surfaces, strict=True))

    def painting(name, row, most):
        factor = np.ones(3) if row.get("factor") is None else np.array(row["factor"])
        picture, repeat = read(row["file"], row["colour_space"], None, most), np.array(row["repeat"])
        return Painting(picture, repeat, factor, wraps(surface[name], repeat))

    return (
        {name: painting(name, row, most) for name, row in rows.items()}
        for rows, most in ((textures, 1.0), (emission, pictures.ANY))
    )


def things(x, rho_avg, textures, emission):
    """The things of a Scene x, a back being one with its front; textures, emission : {surface: Painting}."""
    fronts = np.flatnonzero(x.front < 0).tolist()
    back = {int(front): s for s, front in enumerate(x.front) if front >= 0}

    def side(s):
        name = x.names[s]
        reflects = x.role[s] != "cast_only"
        return Side(x.E[s], np.array(rho_avg[name]), reflects, emission.get(name), textures.get(name))

    out = []
    cut = forks.mapped(lambda s: coarse(x.surfaces[s], LINES), fronts)
    for s, (V, F, UV) in zip(fronts, cut, strict=True):
        sides = [side(k) for k in (s, back.get(s)) if k is not None]
        T = coordinates(x.surfaces[s], F, UV) if any(one.E_picture or one.rho_picture for one in sides) else None
        V = np.stack([V[:, 0], V[:, 2], -V[:, 1]], axis=1) if x.up == "z" else V
        if x.flip[s]:
            F, T = F[:, ::-1], None if T is None else T[:, ::-1]
        out.append(Thing(V, F, *sides, blocks=x.role[s] != "receive_only", T=T))
    return out


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
