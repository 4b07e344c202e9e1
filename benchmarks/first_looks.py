"""How long a first look at each default scene takes: python benchmarks/first_looks.py --help.

Bakes the scenes of data/scenes with `quality: preview` from an empty folder, and once more with nothing kept but the
readings of its models; notes when the picture it begins with is there, and when all is.  With --against another
checkout the two take turns, so that their ratio is that of one machine at one time.  Writes first_looks.md into
benchmarks/results.
"""

import argparse
import shutil
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import measure  # noqa: E402
from jobs import snakemake  # noqa: E402
from run import machine  # noqa: E402

SCENES = ("cornell", "jussi_car", "monet_room", "fruit_room", "conference")  # cad_part needs the extra `step`


class Look(NamedTuple):
    """Seconds of one preview: until first_look.png was there (None where a checkout draws none), in all, and of CPU."""

    picture: float | None
    wall: float
    cpu: float


def look(root, scene, work, cores):
    """The Look of one preview of a scene by the checkout `root`, in the working folder `work` as it is."""
    command = [str(word) for word in snakemake(work, cores)]
    command[command.index("--snakefile") + 1] = str(root / "Snakefile")
    chosen = [f"scene={HERE.parent / 'data' / 'scenes' / scene}", "bake={quality: preview}"]
    begin, drawn = time.time(), work / "results" / scene / "first_look.png"
    spent = measure.run([*command, "--quiet", "all", "--config", *chosen], log=work / "log.txt")
    return Look(drawn.stat().st_mtime - begin if drawn.exists() else None, spent.wall, spent.cpu)


def looks(root, scene, work, cores):
    """[the Look from nothing, the Look once its models are read]."""
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    cold = look(root, scene, work, cores)
    results = work / "results" / scene
    for path in results.iterdir():
        if path.name != "cache":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    shutil.rmtree(work / ".snakemake")
    return [cold, look(root, scene, work, cores)]


def medians(found):
    """The Look of medians of several."""
    return Look(*(median(values) if None not in values else None for values in zip(*found, strict=True)))


def markdown(rows, on, repeat, is_pair):
    """The table; rows : {scene: [[Look from nothing, with its models read] of each checkout]}."""
    head = ["scene", "picture after s", "all after s", "CPU s", "picture after s, models read", "all, models read"]
    head += ["all after s, before", "CPU s before", "all, ratio", "CPU, ratio"] if is_pair else []
    text = [
        "# First looks",
        "",
        f"Made by `python benchmarks/first_looks.py`; {on['cores']} cores of {on['processor']}, commit {on['commit']};"
        f" medians of {repeat} runs of each. Wall seconds from the command until `first_look.png` is there, and until"
        " all is, report and GLB too.",
        "",
        "| " + " | ".join(head) + " |",
        "|---" * len(head) + "|",
    ]
    for scene, (now, *before) in rows.items():
        cells = [*now[0], now[1].picture, now[1].wall]
        if before:
            old = before[0][0]
            cells += [old.wall, old.cpu, old.wall / now[0].wall, old.cpu / now[0].cpu]
        text.append(f"| {scene} | " + " | ".join(f"{cell:.1f}" for cell in cells) + " |")
    return "\n".join(text) + "\n"


def main(argv=None):
    """Measure and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=SCENES, choices=SCENES)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--against", type=Path, metavar="CHECKOUT", help="set up, to take turns with")
    parser.add_argument("--out", type=Path, default=HERE / "results")
    args = parser.parse_args(argv)
    roots = [HERE.parent, *([args.against.resolve()] if args.against else [])]
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        for scene in args.scenes:
            spent = [
                [looks(root, scene, Path(folder) / "work", args.cores) for root in roots] for _ in range(args.repeat)
            ]
            rows[scene] = [[medians([turn[k][kind] for turn in spent]) for kind in (0, 1)] for k in range(len(roots))]
            print(scene, rows[scene], flush=True)
            table = markdown(rows, machine(), args.repeat, len(roots) > 1)
            (args.out / "first_looks.md").write_text(table, encoding="utf-8")


if __name__ == "__main__":
    main()
