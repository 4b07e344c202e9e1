"""Check a scene folder before the first job, and write what the rules read of its settings.

reads   FOLDER/scene.yaml, and the geometry files and pictures it names
writes  RESULTS/<scene>/preflight.json, settings/, cache/ and pictures/ beside it             (lib.formats.preflight)
        and what it cost, stages/preflight/cost.json, if nothing was refused

No rule: Snakemake has it done while it reads the Snakefile, if anything has changed since it was done last.
"""

from lib import door
from lib.formats import preflight, scene_check  # noqa: F401  the reader is loaded where the jobs can share it
from lib.formats.artefact import write_json


def arguments(parser):
    parser.add_argument("--scene", required=True, metavar="FOLDER", help="holds scene.yaml")
    parser.add_argument("--overrides", type=door.json_text, default={}, metavar="JSON", help="settings that were typed")
    parser.add_argument("--results", default="results", metavar="FOLDER", help="of the results of all scenes")


def body(args, cost):
    home = preflight.make(args.scene, args.overrides, args.results)
    write_json(home / "stages" / "preflight" / "cost.json", cost.as_dict())


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
