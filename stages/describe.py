"""List what a geometry file or a scene folder holds: unit, surfaces, layers, materials, lights, and what is skipped.

    python -m stages.describe PATH

reads   a .bpt, teaset .txt, geomdl .json or .3dm, or a scene folder;  writes nothing.
A door of its own, not an option of import_scene: an edit in the code that describes must not re-bake anything.
"""

from lib import door
from lib.formats import describe


def arguments(parser):
    parser.add_argument("path", metavar="PATH", help="geometry file or scene folder")


def body(args, cost):
    print("\n".join(describe.lines(args.path)))


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
