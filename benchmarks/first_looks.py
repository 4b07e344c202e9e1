"""How long a first look at each default scene takes: python benchmarks/first_looks.py --help.

Bakes the scenes of data/scenes with `quality: preview` from an empty folder, and once more with nothing kept but the
readings of its models.  With --against another checkout the two take turns, so that their ratio is that of one machine
at one time.  Writes first_looks.md into benchmarks/results.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path
from statistics import median

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import measure  # noqa: E402
from jobs import snakemake  # noqa: E402
from run import machine  # noqa: E402

SCENES = ("cornell", "jussi_car", "monet_room", "fruit_room", "conference")  # cad_part needs the extra `step`


def look(root, scene, work, cores):
    """Spent of one first look at a scene by the checkout `root`, in the working folder `work` as it is."""
    command = [str(word) for word in snakemake(work, cores)]
    command[command.index("--snakefile") + 1] = str(root / "Snakefile")
    chosen = [f"scene={HERE.parent / 'data' / 'scenes' / scene}", "bake={quality: preview}"]
    return measure.run([*command, "--quiet", "all", "--config", *chosen], log=work / "log.txt")


def looks(root, scene, work, cores):
    """[Spent of a first look from nothing, Spent once its models are read]."""
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    cold = look(root, scene, work, cores)
    results = work / "results" / scene
    for path in results.iterdir():
        if path.name != "cache":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    shutil.rmtree(work / ".snakemake")
    return [cold, look(root, scene, work, cores)]


def markdown(rows, on, repeat, is_pair):
    """The table; rows : {scene: [medians [(wall, CPU) from nothing, with its models read] of each checkout]}."""
    head = ["scene", "wall s", "CPU s", "wall s, models read"]
    head += ["wall s before", "CPU s before", "wall, ratio", "CPU, ratio"] if is_pair else []
    text = [
        "# First looks",
        "",
        f"Made by `python benchmarks/first_looks.py`; {on['cores']} cores of {on['processor']}, commit {on['commit']};"
        f" medians of {repeat} runs of each, everything counted, `package` and `report` too.",
        "",
        "| " + " | ".join(head) + " |",
        "|---" * len(head) + "|",
    ]
    for scene, (now, *before) in rows.items():
        cells = [now[0][0], now[0][1], now[1][0]]
        if before:
            (wall, cpu), _ = before[0]
            cells += [wall, cpu, wall / now[0][0], cpu / now[0][1]]
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
            rows[scene] = [
                [
                    tuple(median(getattr(turn[k][kind], key) for turn in spent) for key in ("wall", "cpu"))
                    for kind in (0, 1)
                ]
                for k in range(len(roots))
            ]
            print(scene, rows[scene], flush=True)
            table = markdown(rows, machine(), args.repeat, len(roots) > 1)
            (args.out / "first_looks.md").write_text(table, encoding="utf-8")


if __name__ == "__main__":
    main()
