"""Error against seconds on the reference scenes, by whole bakes: `make bench`, or python benchmarks/run.py --help.

Each row is one bake up to its illumination maps, from a clean folder: CPU seconds and rays of all its jobs, and the
irradiance of the maps against the path traced one at the reference points (benchmarks/reference/README.md):

    RMSE = sqrt(mean over points and channels of (H - E)^2 - se^2) / mean E;   95 % = that percentile of |H - E| / E
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import reference  # noqa: E402

from lib.formats import artefact, casters, light_maps, scene  # noqa: E402
from lib.maps.fill import one_deep  # noqa: E402

COLUMNS = "| scene | tolerance | surfaces | samples | rays, M | CPU s | RMSE, % | 95 %, % | bias, % |"


def bake(name, tolerance, cores):
    """Bake a reference scene anew up to its maps; the folder of its stages."""
    called = f"reference_{name}_{tolerance:g}".replace(".", "_")
    folder, results = ROOT / "results" / "benchmarks" / called, ROOT / "results" / called
    for old in (folder, results):
        shutil.rmtree(old, ignore_errors=True)
    reference.write_scene(name, folder, {"tolerance": tolerance})
    snakemake = [sys.executable, "-m", "snakemake", "--cores", str(cores), "--quiet", "all"]
    subprocess.run([*snakemake, "--until", "balance_resample", "--config", f"scene={folder}"], cwd=ROOT, check=True)
    return results / "stages"


def irradiance(stages, names, uv):
    """H of the baked maps at (k, 2) parameters of named surfaces, (k, 3): bilinear, hidden samples filled one deep."""
    x, shapes = scene.load(stages / "import_scene" / "scene.npz"), casters.load(stages / "tessellate" / "casters.npz")
    maps = light_maps.merge(light_maps.load(path) for path in sorted(stages.glob("balance_resample/chunk_*.npz"))).maps
    H = np.full((len(uv), 3), np.nan)
    for k, surface in enumerate(maps.surface):
        mine = np.flatnonzero(names == x.names[surface])
        texels = one_deep(maps.map(k).sum(axis=2), maps.hidden_map(k), shapes.is_closed[surface])
        s, t = uv[mine, 0] * (texels.shape[1] - 1), uv[mine, 1] * (texels.shape[0] - 1)
        i, j = np.minimum(s.astype(int), texels.shape[1] - 2), np.minimum(t.astype(int), texels.shape[0] - 2)
        a, b = (s - i)[:, None], (t - j)[:, None]
        low = texels[j, i] * (1 - a) + texels[j, i + 1] * a
        high = texels[j + 1, i] * (1 - a) + texels[j + 1, i + 1] * a
        H[mine] = low * (1 - b) + high * b
    return H, maps


def row(name, tolerance, cores):
    """One line of the table."""
    stages = bake(name, tolerance, cores)
    names, uv, E, se = reference.points_on_pieces(name)
    H, maps = irradiance(stages, names, uv)
    seen = np.isfinite(H).all(axis=1)
    wrong, E, se = (H - E)[seen], E[seen], se[seen]
    rmse = np.sqrt(max((wrong**2 - se**2).mean(), 0)) / E.mean()
    p95 = np.percentile(np.abs(wrong) / np.maximum(E, 1e-9 * E.mean()), 95)
    costs = [artefact.read_json(path) for path in stages.glob("*/cost*.json")]
    seconds, rays = sum(cost["cpu_seconds"] for cost in costs), sum(cost["rays"] for cost in costs)
    figures = [f"{rays / 1e6:.1f}", f"{seconds:.1f}", *(f"{100 * x:.2f}" for x in (rmse, p95, wrong.mean() / E.mean()))]
    left_out = f" ({(~seen).sum()} points on surfaces without a map)" if not seen.all() else ""
    sizes = [str(len(maps.surface)), str(len(maps.value))]
    return "| " + " | ".join([name, f"{tolerance:g}", *sizes, *figures]) + " |" + left_out


def main(argv=None):
    """Print the table, a line as soon as it is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["cornell", "room"], choices=["cornell", "room"])
    parser.add_argument("--tolerances", nargs="+", type=float, default=[0.05, 0.02, 0.01])
    parser.add_argument("--cores", type=int, default=2)
    args = parser.parse_args(argv)
    print(COLUMNS, "|---" * 9 + "|", sep="\n", flush=True)
    for name in args.scenes:
        for tolerance in args.tolerances:
            print(row(name, tolerance, args.cores), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
