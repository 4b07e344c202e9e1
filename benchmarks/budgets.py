"""What is lost to a texture budget, by either order of giving up levels: python benchmarks/budgets.py --help.

Bakes a default scene, then asks it for one budget after another, which runs budget_reduce alone; its table says how far
the textures are off, on average over the scene's area.  Writes budgets.md into benchmarks/results.
"""

import argparse
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import measure  # noqa: E402
from jobs import snakemake  # noqa: E402
from run import machine  # noqa: E402

from lib.formats import artefact  # noqa: E402
from lib.maps.budget import ORDERS  # noqa: E402

MIB = (32, 16, 8, 4, 2, 1)


def rows_of(scene, work, cores, budgets):
    """Rows [MiB asked for, order, MiB left, share of the light lost] of one scene."""
    table, out = work / "results" / scene / "stages" / "budget_reduce" / "budget.json", []
    for mib in budgets:
        for order in ORDERS:
            chosen = [f"budget={mib} MiB", f"export={{budget_order: {order}}}"]
            command = [*snakemake(work, cores), "--quiet", "all", "--until", "budget_reduce"]
            folder = f"scene={HERE.parent / 'data' / 'scenes' / scene}"
            measure.run([*command, "--config", folder, *chosen], log=work / "log.txt")
            found = artefact.read_json(table)
            out.append([mib, order, found["S_after"] / 2**20, found["lost"]])
            print(scene, *out[-1], flush=True)
    return out


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["monet_room", "fruit_room"])
    parser.add_argument("--budgets", nargs="+", type=float, default=MIB, metavar="MIB")
    parser.add_argument("--cores", type=int, default=2)
    args = parser.parse_args(argv)
    on = machine()
    text = ["# Texture budgets", "", f"Made by `python benchmarks/budgets.py`; commit {on['commit']}.", ""]
    text += ["| scene | budget, MiB | order | textures, MiB | mean error, % |", "|---|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as work:
        for scene in args.scenes:
            for mib, order, left, lost in rows_of(scene, Path(work), args.cores, args.budgets):
                text.append(f"| {scene} | {mib:g} | {order} | {left:.1f} | {100 * lost:.2f} |")
    (HERE / "results" / "budgets.md").write_text("\n".join(text) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
