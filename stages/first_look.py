"""Draw a scene before its light is baked, for a first look: what its camera sees, by a few random paths a pixel.

reads   geometry-<hash>.json    the slice of the settings for geometry, roles and light     (lib.formats.scene_import)
        folder.json beside it, and the geometry files in the folder it names
        materials: {"rho_avg": {surface: [r, g, b]}}
        settings: {"camera": {"eye", "target", "fov"} in the scene's units or null, "units", "up", "exposure": "auto" or
        a number > 0, "bounces": 1 for direct light alone, "seed"}
writes  first_look.png

Colours are averages of surfaces, curved ones have facets, and the light is smoothed noise: it shows where lamps, camera
and things stand while the bake runs.  No other stage reads it, and its rays are none of the bake.
"""

from pathlib import Path

import numpy as np

from lib import door, forks
from lib.formats import artefact, pictures, scene_import
from lib.formats.scene_view import scene_camera
from lib.report import first_look
from lib.report.first_look import Side, Thing
from lib.surfaces.coarse import coarse

LINES = 33  # of a curved surface


def arguments(parser):
    parser.add_argument("--scene-slice", required=True, metavar="FILE", help="geometry-<hash>.json")
    parser.add_argument("--materials", required=True, metavar="FILE", help="JSON: rho_avg of every surface")
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
        things(x, rho_avg),
        view=scene_camera(camera, told) if camera else None,
        exposure=None if exposure == "auto" else float(exposure),
        reflections=told.get("bounces", "converge") != 1,
        seed=int(told.get("seed", 1)),
    )
    pictures.write_png8(args.out, image)
    print(f"first look: {args.out}", flush=True)


def things(x, rho_avg):
    """The things of a Scene x, a back being one with its front."""
    fronts = np.flatnonzero(x.front < 0).tolist()
    back = {int(front): s for s, front in enumerate(x.front) if front >= 0}
    out = []
    for s, (V, F) in zip(fronts, forks.mapped(lambda s: coarse(x.surfaces[s], LINES), fronts), strict=True):
        front, other = (
            None if k is None else Side(x.E[k], np.array(rho_avg[x.names[k]]), x.role[k] != "cast_only")
            for k in (s, back.get(s))
        )
        V = np.stack([V[:, 0], V[:, 2], -V[:, 1]], axis=1) if x.up == "z" else V
        out.append(Thing(V, F[:, ::-1] if x.flip[s] else F, front, other, blocks=x.role[s] != "receive_only"))
    return out


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
