"""Turn a scene's geometry, inline or in files, into named NURBS surfaces in world metres.

reads   geometry-<hash>.json    the slice of the settings for geometry, roles and light     (lib.formats.scene_import)
        folder.json beside it, and the geometry files in the folder it names
writes  scene.npz                                                                           (lib.formats.scene)
"""

from pathlib import Path

from lib import door
from lib.formats import artefact, scene, scene_import


def arguments(parser):
    parser.add_argument("--scene-slice", required=True, metavar="FILE", help="geometry-<hash>.json")
    parser.add_argument("--out", required=True, metavar="FILE", help="scene.npz")


def body(args, cost):
    at = artefact.read_json(Path(args.scene_slice).parent / "folder.json")
    made = scene_import.read(artefact.read_json(args.scene_slice), at["folder"], at["file"])
    for warning in made.warnings:
        door.warn(warning)
    scene.save(args.out, made)
    cost.notes.update(surfaces=len(made.names), skipped=sum("skipped" in text for text in made.warnings))


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
