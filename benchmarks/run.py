"""Error against CPU seconds on the two reference scenes, ours and the peers', in one run: `make bench`.

Ours: whole bakes from an empty folder through Snakemake, every process counted (user + system); `package` and
`report`, which make the files people open and not the light, are a second run, counted apart.  The irradiance is that
of maps/*.exr, B over rho_avg, read bilinearly at the reference points (benchmarks/reference/README.md); points on the
lights are none.  Run k of --repeat takes seed k, the table is medians.

Peers, where their packages are installed in the Python of --peers (pip install '.[bench]' in an environment of its
own: bpy pins an older numpy): Mitsuba 3 at the points alone, and a light map of Blender's Cycles, denoised.  Their
start is left out: CPU seconds begin after their packages are imported, and hold reading, building and tracing.

Writes speed.json, speed.md and speed.svg into benchmarks/results, after every bake, so that a run that is cut short
is not lost.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
from functools import partial
from pathlib import Path
from statistics import median

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import bake  # noqa: E402
import measure  # noqa: E402
import numpy as np  # noqa: E402
import reference  # noqa: E402
import score  # noqa: E402
import speed_report  # noqa: E402

ROOT = HERE.parent
SCENES = ("cornell", "room")
TOLERANCES = (0.04, 0.02, 0.014, 0.01, 0.007, 0.004, 0.002)
CYCLES = {  # texels, paths a texel
    "cornell": ((100_000, 16), (200_000, 32), (300_000, 96)),
    "room": ((200_000, 16), (600_000, 16), (1_000_000, 24)),
}
OTHER_GRIDS = (
    1.0,
    1.06,
    0.94,
    1.03,
    0.97,
)  # a light map's error hangs on where its texels lie beside the contacts: every repeat lays them anew
MITSUBA = (64, 256, 1024)
QUICK = {"tolerances": (0.04, 0.02), "cycles": {name: ((5_000, 16),) for name in SCENES}, "mitsuba": (16,)}
SILENT = {"PYTHONWARNINGS": "ignore", "OMP_NUM_THREADS": "2"}


def ours(scene, tolerance, seed, args):
    """One bake: its row."""
    folder = args.work / "scenes" / scene
    reference.write_scene(scene, folder, {"tolerance": tolerance, "seed": seed})
    results, figures = bake.bake(folder, args.work / "bake", args.cores)
    names, uv, E, se = reference.points_on_pieces(scene)
    H = bake.irradiance(results, names, uv)
    return {
        "setting": f"tolerance {tolerance:g}",
        "tolerance": tolerance,
        **score.errors(H, E, se),
        "by_area": score.rmse_by_area(H, E, se, reference.shares_of_area(scene)),
        "estimate": bake.artefact.read_json(results / "report.json")["totals"]["error"],
        **figures,
    }


def starts(args):
    """Rows of what the machine itself takes: a Snakemake run with nothing to do, and the import of open3d."""
    empty = args.work / "empty"
    empty.mkdir(parents=True, exist_ok=True)
    (empty / "Snakefile").write_text('rule all:\n    shell: "true"\n')
    commands = {
        "empty Snakemake run": [sys.executable, "-m", "snakemake", "--cores", "1", "--quiet", "all"],
        "import open3d": [sys.executable, "-c", "import open3d"],
    }
    return [
        {
            "who": "machine",
            "scene": "",
            "setting": name,
            "cpu": median(measure.run(command, cwd=empty).cpu for _ in range(3)),
        }
        for name, command in commands.items()
    ]


def peer(script, scene, options, seed, args):
    """One run of a peer's script: its row."""
    out = args.work / "peer.npz"
    log = args.work / "peer.txt"
    command = [
        args.peers,
        HERE / "peers" / script,
        HERE / "reference" / scene,
        out,
        "--seed",
        seed,
        "--threads",
        args.cores,
    ]
    spent = measure.run([*command, *options], env={**os.environ, **SILENT}, log=log)
    said = json.loads(next(line for line in reversed(log.read_text().splitlines()) if line.startswith("{")))
    _, _, E, se = reference.points_on_pieces(scene)
    errors = score.errors(np.load(out)["E"].astype(float), E, se)
    return {**errors, **said, "cpu": spent.cpu - said["cpu_import"], "wall": spent.wall, "peak_mb": spent.peak_mb}


def cycles(scene, texels, paths, seed, args):
    """One light map: its row."""
    options = ["--texels", int(texels * OTHER_GRIDS[seed % len(OTHER_GRIDS)]), "--samples", paths]
    return peer("blender.py", scene, options, seed, args)


def can(python, package):
    """The interpreter has the package and it starts; "" or what it said."""
    done = subprocess.run([python, "-c", f"import {package}"], capture_output=True, text=True)
    return "" if done.returncode == 0 else (done.stderr.strip().splitlines() or ["it does not start"])[-1]


def mitsuba_variant(python):
    """The fastest variant that works here."""
    test = "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); print(mi.Float(1) + 1)"
    return "llvm_ad_rgb" if subprocess.run([python, "-c", test], capture_output=True).returncode == 0 else "scalar_rgb"


def plan(args):
    """What one repeat consists of: [(who, scene, setting text, function of the seed)]."""
    jobs = []
    for scene in args.scenes:
        if "ours" in args.who:
            jobs += [
                ("ours", scene, f"tolerance {t:g}", lambda seed, s=scene, t=t: ours(s, t, seed, args))
                for t in args.tolerances
            ]
        if "mitsuba" in args.who:
            for n in args.mitsuba:
                options = ["--samples", n, "--variant", args.variant]
                jobs.append(
                    (
                        "mitsuba",
                        scene,
                        f"{n} paths a point",
                        lambda seed, s=scene, o=options: peer("mitsuba_points.py", s, o, seed, args),
                    )
                )
        if "cycles" in args.who:
            for texels, n in args.cycles[scene]:
                text = f"{texels // 1000} k texels, {n} paths"
                jobs.append(("cycles", scene, text, lambda seed, s=scene, t=texels, n=n: cycles(s, t, n, seed, args)))
    return jobs


def machine():
    """What it ran on."""
    try:
        models = {
            line.split(":")[1].strip()
            for line in open("/proc/cpuinfo", encoding="utf-8")
            if line.startswith("model name")
        }
    except OSError:
        models = {platform.processor()}
    git = partial(subprocess.run, cwd=ROOT, capture_output=True, text=True)
    commit = git(["git", "rev-parse", "--short", "HEAD"]).stdout.strip()
    changed = git(["git", "status", "--porcelain", "--", ".", ":!benchmarks/results"]).stdout  # those are being written
    commit += "-dirty" if changed else ""
    return {
        "processor": ", ".join(sorted(models)),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "commit": commit,
    }


def parsed(argv):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=SCENES, choices=SCENES)
    parser.add_argument("--tolerances", nargs="+", type=float, default=TOLERANCES)
    parser.add_argument(
        "--repeat", type=int, default=1, help="runs of everything; the table is medians (3 for figures to quote)"
    )
    parser.add_argument("--cores", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument(
        "--peers",
        default=os.environ.get("BENCH_PYTHON", sys.executable),
        metavar="PYTHON",
        help="interpreter that has mitsuba or bpy (default: $BENCH_PYTHON, else this one)",
    )
    parser.add_argument(
        "--who", nargs="+", default=["ours", "mitsuba", "cycles"], choices=["ours", "mitsuba", "cycles"]
    )
    parser.add_argument("--quick", action="store_true", help="two coarse bakes a scene, small peers: does it all work?")
    parser.add_argument("--add", action="store_true", help="keep the rows that speed.json has and add to them")
    parser.add_argument("--out", type=Path, help="default: benchmarks/results; results/benchmarks/quick with --quick")
    args = parser.parse_args(argv)
    args.work = ROOT / "results" / "benchmarks"
    args.out = args.out or (args.work / "quick" if args.quick else HERE / "results")
    args.cycles, args.mitsuba = CYCLES, MITSUBA
    if args.quick:
        args.tolerances, args.cycles, args.mitsuba = QUICK["tolerances"], QUICK["cycles"], QUICK["mitsuba"]
    return args


def main(argv=None):
    """Measure everything, telling each row as it comes."""
    args = parsed(argv)
    for folder in (args.work, args.out):
        folder.mkdir(parents=True, exist_ok=True)
    for who, package in (("mitsuba", "mitsuba"), ("cycles", "bpy")):
        if who in args.who and (why := can(args.peers, package)):
            print(f"{who} is left out: {args.peers}: {why}", flush=True)
            args.who = [w for w in args.who if w != who]
    if "mitsuba" in args.who:
        args.variant = mitsuba_variant(args.peers)
    table = args.out / "speed.json"
    rows = json.loads(table.read_text())["rows"] if args.add and table.exists() else []
    jobs = plan(args)
    if "ours" in args.who:  # once unseen: the first run ever on a machine compiles the loops
        ours(args.scenes[0], max(args.tolerances), 0, args)
    for seed in range(1, args.repeat + 1):
        rows += [{**row, "seed": seed} for row in starts(args)]
        for who, scene, setting, job in jobs:
            row = {"who": who, "scene": scene, "setting": setting, "seed": seed, **job(seed)}
            rows.append(row)
            figures = f"{row['cpu']:8.1f} CPU s {100 * row['rmse']:7.2f} % RMSE {100 * row['p95']:7.2f} % at 95"
            print(f"{who:8} {scene:8} {setting:24} {figures} {100 * row['bias']:+6.2f} % bias", flush=True)
            bake.artefact.write_json(table, {"machine": machine(), "rows": rows})
            speed_report.write(args.out, machine(), rows)
    print(f"{args.out}/speed.md, speed.svg, speed.json")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
