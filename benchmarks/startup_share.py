"""How much of a bake of a million texels is not its light: python benchmarks/startup_share.py --help.

Bakes scenes at a tolerance that gives their maps about a million texels and compares the CPU seconds that no job
accounts for (Snakemake, shells, interpreters, imports; see bake.py) with all.  Writes startup_share.md into
benchmarks/results; the exit status is 1 if a share is above MOST.
"""

import argparse
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import bake  # noqa: E402
import reference  # noqa: E402
from run import SCENES, machine  # noqa: E402

MOST = 0.15
TOLERANCE = 0.002  # gives the maps of each about a million texels
BAKES = (*SCENES, "fruit_room")


def measured(scene, work, cores, tolerance=TOLERANCE):
    """One bake: its row."""
    folder = HERE.parent / "data" / "scenes" / scene
    if scene in SCENES:
        folder = work / "scenes" / scene
        reference.write_scene(scene, folder, {})
    _, figures = bake.bake(folder, work / "startup_share", cores, {"bake": f"{{tolerance: {tolerance}}}"})
    return {"scene": scene, "share": figures["scheduling"] / figures["cpu"], **figures}


def markdown(rows, on):
    """The table."""
    text = [
        "# Start and scheduling in a bake of a million texels",
        "",
        f"Made by `python benchmarks/startup_share.py`; {on['cores']} cores of {on['processor']}, commit"
        f" {on['commit']}. CPU seconds from nothing to maps, textures and levels of detail, `package` and `report`"
        f" apart, tolerance {TOLERANCE:g}; start and scheduling are all that no job accounts for. Asked: at most"
        f" {MOST:.0%}.",
        "",
        "| scene | texels, M | jobs | rays, M | CPU s | start and scheduling | share | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [
            row["scene"],
            f"{row['texels'] / 1e6:.2f}",
            f"{row['jobs']}",
            f"{row['rays'] / 1e6:.0f}",
            f"{row['cpu']:.1f}",
            f"{row['scheduling']:.1f}",
            f"{row['share']:.1%}",
            "" if row["share"] <= MOST else "missed",
        ]
        text.append("| " + " | ".join(cells) + " |")
    return "\n".join(text) + "\n"


def main(argv=None):
    """Bake, tell, write the table after each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=BAKES, choices=BAKES)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--work", type=Path, default=HERE.parent / "results" / "benchmarks")
    parser.add_argument("--out", type=Path, default=HERE / "results")
    args = parser.parse_args(argv)
    args.out.mkdir(parents=True, exist_ok=True)
    measured(SCENES[0], args.work, args.cores, tolerance=0.04)  # what a machine compiles once is no bake's
    rows = []
    for scene in args.scenes:
        rows.append(measured(scene, args.work, args.cores))
        print(*markdown(rows[-1:], machine()).splitlines()[-1:], flush=True)
        (args.out / "startup_share.md").write_text(markdown(rows, machine()), encoding="utf-8")
    return int(any(row["share"] > MOST for row in rows))


if __name__ == "__main__":
    raise SystemExit(main())
