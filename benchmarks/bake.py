"""One whole bake through the real pipeline and what it cost: Snakemake and all its jobs, from nothing to the end."""

import functools
import os
import shutil
import sys
from pathlib import Path

import measure
import numpy as np
import score
from jobs import ENVIRONMENT, snakemake

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from lib.formats import artefact, pictures  # noqa: E402
from lib.formats.names import cleaned  # noqa: E402

APART = ("package", "report")  # counted beside the pipeline: they make the files people open, not the light


def bake(folder, work, cores=2, settings=None):
    """Bake the scene `folder` from nothing, in the working folder `work`: (its results folder, dict of figures).

    cpu, wall, peak_mb : of a run that ends before APART; apart : CPU seconds of the run that adds them; scheduling :
    Snakemake, shells, interpreters and imports, all of the first run that no job accounts for; stages : CPU seconds
    and rays by stage.
    """
    shutil.rmtree(work, ignore_errors=True)
    Path(work).mkdir(parents=True)
    given = [f"{key}={value}" for key, value in (settings or {}).items()]
    command = [*snakemake(work, cores), "--quiet", "all", "--config", f"scene={folder}", *given]
    spent = measure.run([*command, "--omit-from", APART[0]], log=Path(work) / "log.txt")
    apart = measure.run(command, log=Path(work) / "log_apart.txt").cpu
    results = Path(work) / "results" / cleaned(Path(folder).name)
    stages, seconds, jobs, rays, peak = {}, 0.0, 0, 0, 0.0
    for path in sorted((results / "stages").glob("*/cost*.json")):
        cost = artefact.read_json(path)
        half = next((h for h in ("indirect", "direct") if h in path.stem), "")
        name = f"{cost['stage']} {half}".strip()
        row = stages.setdefault(name, {"jobs": 0, "cpu": 0.0, "rays": 0})
        row["jobs"] += 1
        row["cpu"] += cost["cpu_seconds"]
        row["rays"] += cost["rays"]
        seconds += cost["cpu_seconds"] if name not in APART else 0.0
        rays += cost["rays"]
        jobs += 1
        peak = max(peak, cost["peak_mb"])
    figures = {
        "cpu": spent.cpu,
        "apart": apart,
        "wall": spent.wall,
        "scheduling": spent.cpu - seconds,
        "peak_mb": spent.peak_mb,
        "largest_job_mb": peak,
        "rays": rays,
        "jobs": jobs,
        "texels": texels(results),
        "stages": stages,
    }
    return results, figures


@functools.cache
def start_up(stage):
    """CPU seconds of a process that imports a stage, loads its compiled loops and does nothing, as that does of which
    jobs are forks."""
    environment = {**os.environ, **ENVIRONMENT}
    loads = f"import stages.{stage}; from lib import compiled; compiled.load_kept()"
    return measure.least_of([sys.executable, "-c", loads], cwd=ROOT, env=environment)


def maps(results):
    """{surface name: (B (h, w, 3), rho_avg (3,))} of a bake's illumination maps, as anybody would read them."""
    out = {}
    for path in sorted((Path(results) / "maps").glob("*.exr")):
        B, metadata = pictures.read_exr(path)
        out[metadata["surface"]] = B, np.array(metadata["rho_avg"])
    return out


def texels(results):
    """Texels of all maps."""
    return sum(B.shape[0] * B.shape[1] for B, _ in maps(results).values())


def irradiance(results, names, uv):
    """H at uv (k, 2) of the named surfaces, (k, 3): B of maps/*.exr over rho_avg, bilinear; NaN where rho_avg is 0."""
    H = np.full((len(uv), 3), np.nan)
    for name, (B, rho) in maps(results).items():
        mine = np.flatnonzero(names == name)
        if mine.size and (rho > 0).all():
            size = np.array([B.shape[1] - 1, B.shape[0] - 1])
            H[mine] = score.bilinear(B, *(uv[mine] * size).T) / rho
    return H
