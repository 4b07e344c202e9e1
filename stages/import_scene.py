"""Turn a scene's geometry, inline or in files, into named NURBS surfaces in world metres.

reads   geometry-<hash>.json    the slice of the settings for geometry, roles and light     (lib.formats.scene_import)
        folder.json beside it, and the geometry files and emission pictures in the folder it names
writes  scene.npz                                                                           (lib.formats.scene)

    python -m stages.import_scene --describe PATH      lists what a file or a scene folder holds (stages.describe)
"""

import os
import sys
from pathlib import Path

from lib import door
from lib.formats import artefact, scene, scene_import


def arguments(parser):
    parser.add_argument("--scene-slice", required=True, metavar="FILE", help="geometry-<hash>.json")
    parser.add_argument("--out", required=True, metavar="FILE", help="scene.npz")


def body(args, cost):
    at = artefact.read_json(Path(args.scene_slice).parent / "folder.json")
    home = Path(args.scene_slice).parents[1]
    piece = artefact.read_json(args.scene_slice)
    made = scene_import.read(piece, at["folder"], at["file"], home / "cache", home / "pictures")
    told = at["warnings"] if "BAKE_RUN" in os.environ else []  # by the reader of the Snakefile
    for warning in made.warnings:
        door.warn(warning, warning in told)
    scene.save(args.out, made)
    cost.notes.update(surfaces=len(made.names))


def main(argv=None):
    argv = sys.argv[1:] if argv is None else argv
    if argv[:1] == ["--describe"]:  # a program of its own: an edit there must not re-bake anything
        os.execv(sys.executable, [sys.executable, "-m", "stages.describe", *argv[1:]])
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
