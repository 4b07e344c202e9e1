"""Adaptive sampling against uniform grids of equal error: python benchmarks/uniform.py --help.

Both go through the same stages, sample to balance_resample, from the same import and mesh.  Adaptive: the tolerances
named. Uniform: grids of one spacing in space for the direct and the indirect half, level by level, with the rays a
sample of one tolerance takes; nothing is divided, nothing dropped.  A uniform grid's error is met by the adaptive
curve at some CPU seconds, rays and texels: the ratios.
"""

import argparse
import json
import shutil
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import bake  # noqa: E402
import jobs  # noqa: E402
import numpy as np  # noqa: E402
import reference  # noqa: E402
import score  # noqa: E402

from lib.formats import artefact, light_maps, scene  # noqa: E402
from lib.maps.fill import one_deep  # noqa: E402

STAGES = ("sample", "shoot", "refine", "balance_resample")
NO_END = 1e-9  # a threshold under which nothing is dropped


def irradiance(stages, names, uv):
    """H of the maps of balance_resample at uv (k, 2) of the named surfaces, (k, 3); their texels; the samples
    measured."""
    of = scene.load(stages / "import_scene" / "scene.npz").names
    all_maps = light_maps.merge(light_maps.load(path) for path in sorted(stages.glob("balance_resample/chunk_*.npz")))
    maps, samples = all_maps.maps, sum(f["samples_direct"] + f["samples_indirect"] for f in all_maps.stats.values())
    H = np.full((len(uv), 3), np.nan)
    for k, surface in enumerate(maps.surface):
        mine = np.flatnonzero(names == of[surface])
        texels = one_deep(maps.map(k).sum(axis=2), maps.hidden_map(k))
        size = np.array([texels.shape[1] - 1, texels.shape[0] - 1])
        H[mine] = score.bilinear(texels, *(uv[mine] * size).T)
    return H, len(maps.value), samples


def measured(work, listed, reference_points):
    """Run jobs one after the other; CPU seconds less starts, rays, texels and errors."""
    names, uv, E, se = reference_points
    cpu = rays = 0.0
    for job in listed:
        cpu += job.run(work).cpu - bake.start_up(job.stage)
        rays += artefact.read_json(Path(work) / job.arguments["--cost"][0])["rays"]
    stages = next(Path(work).glob("results/*/stages"))
    H, texels, samples = irradiance(stages, names, uv)
    return {"cpu": cpu, "rays": rays, "texels": texels, "samples": samples, **score.errors(H, E, se)}


def flat(job, level):
    """The job as one of a uniform grid."""
    chosen = job.settings if "--settings" in job.arguments else {}
    wanted = {
        "base_direct": level,
        "base_indirect": level,
        "top": level,
        "first_shadow_rays": chosen.get("shadow_rays"),
        "t_direct": NO_END,
        "t_indirect": NO_END,
    }
    if job.stage == "sample":
        wanted["first_shadow_rays"] = flat.shadow_rays
    if job.stage == "shoot":
        return job
    return job.with_settings(**{key: value for key, value in wanted.items() if key in chosen})


def compare(name, tolerances, levels, rays_of, work):
    """Rows of one scene: adaptive ones, then uniform ones."""
    points, rows = reference.points_on_pieces(name), []
    folder = work / "scenes" / name
    for tolerance in sorted({*tolerances, rays_of}, reverse=True):
        reference.write_scene(name, folder, {"tolerance": tolerance})
        bake.bake(folder, work / "uniform")
        listed = jobs.jobs_of(folder, work / "uniform", STAGES)
        rows.append(
            {"kind": "adaptive", "setting": f"tolerance {tolerance:g}", **measured(work / "uniform", listed, points)}
        )
        print(
            name, rows[-1]["setting"], {k: round(v, 4) for k, v in rows[-1].items() if isinstance(v, float)}, flush=True
        )
        if tolerance == rays_of:
            shutil.rmtree(work / "flat", ignore_errors=True)
            shutil.copytree(work / "uniform", work / "flat")
            kept = listed
    flat.shadow_rays = next(j.settings["shadow_rays"] for j in kept if j.stage == "refine")
    for level in levels:
        found = measured(work / "flat", [flat(job, level) for job in kept], points)
        rows.append({"kind": "uniform", "setting": f"level {level}", **found})
        print(
            name, rows[-1]["setting"], {k: round(v, 4) for k, v in rows[-1].items() if isinstance(v, float)}, flush=True
        )
    return [{"scene": name, **row} for row in rows]


COUNTED = {"cpu": (1, "CPU s"), "rays": (1e6, "rays, M"), "samples": (1e3, "samples, k"), "texels": (1e3, "texels, k")}


def markdown(rows):
    """The table with ratios at equal error."""
    columns = ["scene", "grid", "RMSE, %", *(name for _, name in COUNTED.values())]
    columns += [f"times adaptive: {name.split(',')[0]}" for _, name in COUNTED.values()]
    text = ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
    for r in rows:
        mine = [a for a in rows if a["scene"] == r["scene"] and a["kind"] == "adaptive"]
        cells = [r["scene"], f"{r['kind']}, {r['setting']}", f"{100 * r['rmse']:.2f}"]
        cells += [f"{r[f] / size:.1f}" for f, (size, _) in COUNTED.items()]
        for f in COUNTED:
            at = score.cpu_at([(a[f], a["rmse"]) for a in mine], r["rmse"]) if r["kind"] == "uniform" else None
            cells.append("" if at is None else f"{r[f] / at:.1f}")
        text.append("| " + " | ".join(cells) + " |")
    return "\n".join(text) + "\n"


def main(argv=None):
    """Compare and write benchmarks/results/uniform.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["cornell", "room"])
    parser.add_argument("--tolerances", nargs="+", type=float, default=[0.04, 0.02, 0.014, 0.01, 0.007])
    parser.add_argument("--levels", nargs="+", type=int, default=[4, 5, 6])
    parser.add_argument("--rays-of", type=float, default=0.01, help="tolerance whose rays a uniform sample takes")
    args = parser.parse_args(argv)
    work, rows = HERE.parent / "results" / "benchmarks", []
    for name in args.scenes:
        rows += compare(name, args.tolerances, args.levels, args.rays_of, work)
        (HERE / "results").mkdir(exist_ok=True)
        (HERE / "results" / "uniform.md").write_text(markdown(rows), encoding="utf-8")
        (HERE / "results" / "uniform.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print(markdown(rows))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
