"""What sample and refine cost beside a bare loop that casts the same rays: python benchmarks/kernels.py --help.

Every ray job of a bake runs three ways: as it is (CPU seconds less the start of its process), with its calls of the
tracer written down, and as a loop over those calls, the same rays in the same chunks and order on the same mesh, with
nothing else in it.
"""

import argparse
import json
import os
import runpy
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import numpy as np  # noqa: E402

ROOT = HERE.parent
STAGES = ("sample", "refine")


def record(out, module, argv):
    """Run a stage and write down its mesh and the arguments of every call of the tracer."""
    from lib.visibility import tracer

    with open(out, "wb") as file:

        def noted(kind, method):
            def call(self, origins, D, *more):
                if not getattr(self, "is_noted", False):
                    self.is_noted = True
                    for array in (self._V, self._F):
                        np.save(file, array)
                np.save(file, np.int32(kind))
                for array in (origins, D):
                    np.save(file, np.asarray(array, dtype=np.float32))
                np.save(file, np.float32(-1 if not more or more[0] is None else more[0]))
                return method(self, origins, D, *more)

            return call

        tracer.Tracer.closest = noted(0, tracer.Tracer.closest)
        tracer.Tracer.is_blocked = noted(1, tracer.Tracer.is_blocked)
        sys.argv = [module, *argv]
        try:
            runpy.run_module(module, run_name="__main__")
        except SystemExit as done:
            return done.code


def replay(path, times):
    """Cast the rays written down, `times` times over; prints the least CPU seconds and the rays as JSON."""
    from lib.visibility.tracer import Tracer

    with open(path, "rb") as file:
        V, F = np.load(file), np.load(file)
        end, calls = os.fstat(file.fileno()).st_size, []
        while file.tell() < end:
            calls.append(tuple(np.load(file) for _ in range(4)))
    spent = []
    for _ in range(times):
        begin = os.times()
        tracer = Tracer(V, F)
        for kind, origins, D, reach in calls:
            if kind:
                tracer.is_blocked(origins, D)
            else:
                tracer.closest(origins, D, None if reach < 0 else reach)
        now = os.times()
        spent.append(now.user + now.system - begin.user - begin.system)
    print(json.dumps({"cpu": min(spent), "rays": tracer.rays, "calls": len(calls)}))
    return 0


def compare(scene, tolerance, times, work):
    """Rows of one bake: a job each."""
    import bake
    import jobs
    import measure
    import reference

    folder = work / "scenes" / scene
    reference.write_scene(scene, folder, {"tolerance": tolerance})
    bake.bake(folder, work / "kernels")
    rows = []
    for job in jobs.jobs_of(folder, work / "kernels", STAGES):
        calls = work / "kernels" / "calls.bin"
        job.run(work / "kernels", HERE / "kernels.py", "--record", calls, f"stages.{job.stage}")
        plain, bare = [], []
        for _ in range(times):  # turn by turn, so that both meet the same neighbours
            plain.append(job.run(work / "kernels").cpu)
            log = work / "kernels" / "replay.txt"
            measure.run(
                [sys.executable, HERE / "kernels.py", "--replay", calls],
                env={**os.environ, **jobs.ENVIRONMENT},
                log=log,
            )
            bare.append(json.loads(log.read_text().splitlines()[-1]))
        calls.unlink()
        half = job.arguments.get("--half", [""])[0]
        work_cpu = min(plain) - bake.start_up(job.stage)
        loop = min(b["cpu"] for b in bare)
        rows.append(
            {
                "scene": scene,
                "tolerance": tolerance,
                "job": f"{job.stage} {half}".strip(),
                "cpu": work_cpu,
                "loop": loop,
                "rays": bare[0]["rays"],
                "calls": bare[0]["calls"],
            }
        )
    return rows


def markdown(rows):
    """A table, with sums."""
    text = [
        "| scene | tolerance | job | rays, M | CPU s less start | bare loop, CPU s | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for key in dict.fromkeys((r["scene"], r["tolerance"]) for r in rows):
        mine = [r for r in rows if (r["scene"], r["tolerance"]) == key]
        names = list(dict.fromkeys(r["job"] for r in mine))
        groups = [(name, [r for r in mine if r["job"] == name]) for name in names] + [("all", mine)]
        for name, group in groups:
            cpu, loop, rays = (sum(r[f] for r in group) for f in ("cpu", "loop", "rays"))
            text.append(
                f"| {key[0]} | {key[1]:g} | {name} | {rays / 1e6:.2f} | {cpu:.2f} | {loop:.2f} | {cpu / loop:.2f} |"
            )
    return "\n".join(text) + "\n"


def main(argv=None):
    """Compare, or do one of the two inner runs."""
    argv = sys.argv[1:] if argv is None else argv
    if argv[:1] == ["--record"]:
        return record(argv[1], argv[2], argv[3:])
    if argv[:1] == ["--replay"]:
        return replay(argv[1], 2)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["cornell", "room"])
    parser.add_argument("--tolerances", nargs="+", type=float, default=[0.02, 0.01])
    parser.add_argument("--times", type=int, default=3, help="runs of each; the least counts")
    args = parser.parse_args(argv)
    rows = []
    for scene in args.scenes:
        for tolerance in args.tolerances:
            rows += compare(scene, tolerance, args.times, ROOT / "results" / "benchmarks")
            (HERE / "results").mkdir(exist_ok=True)
            (HERE / "results" / "kernels.md").write_text(markdown(rows), encoding="utf-8")
    print(markdown(rows))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
