"""Tell what a bake did: report.json for machines, report.html for people, one offline file.

reads   scene.npz, casters.npz, solution.npz, trees of refine, light maps, textures.npz, budget.json, lods.json with the
        exported files beside it, the cost files of all jobs                        (lib.formats.bake_files)
        settings: {"settings": what the bake used, "camera": {"eye", "target", "fov"} in the scene's units or null,
        "units", "up", "warnings": [text]}
writes  report.json, report.html

`--results FOLDER` names the files of a finished bake where no file is given by itself; of those, scene.npz, casters.npz
and lods.json are needed, and any other that is missing leaves its section out. Rays of this run are those of cost files
whose run is the environment's BAKE_RUN. The rays of the pictures are not rays of the bake.
"""

import os
from pathlib import Path

from lib import door
from lib.formats import bake_files, report_html, report_pictures
from lib.formats.artefact import write_json
from lib.report import figures


def arguments(parser):
    parser.add_argument("--results", metavar="FOLDER", help="results/<scene>, for files not named one by one")
    for name, (pattern, is_list, _) in bake_files.GIVEN.items():
        parser.add_argument(f"--{name}", metavar="FILE", nargs="*" if is_list else None, help=f"default: {pattern}")
    parser.add_argument("--name", help="of the scene (default: the name of the folder that holds lods.json)")
    parser.add_argument("--settings", type=door.json_text, default={}, metavar="JSON")
    parser.add_argument("--out-html", metavar="FILE", help="default: report.html beside lods.json")
    parser.add_argument("--out-json", metavar="FILE", help="default: report.json beside lods.json")


def body(args, cost):
    given = {name: getattr(args, name) for name in bake_files.GIVEN}
    bake = bake_files.load(bake_files.find(given, args.results))
    name = args.name or Path(bake.folder).resolve().name
    facts = figures.collect(name, bake, args.settings, os.environ.get("BAKE_RUN", ""))
    drawn, model = report_pictures.draw(bake, facts, args.settings)
    write_json(args.out_json or bake.folder / "report.json", {**facts, "camera": drawn.camera})
    report_html.save(args.out_html or bake.folder / "report.html", facts, drawn, model)


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
