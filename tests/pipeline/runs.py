"""Whole runs as a user starts them: Snakemake in a process of its own, on a scene that bakes in seconds."""

import hashlib
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 300  # seconds a run may take; far more than it needs, so that a busy machine fails no test

# Where the light is made, in the order of the stages; and what follows.
BAKE = ["import_scene", "tessellate", "sample", "shoot", "refine_direct", "refine_indirect", "balance_resample"]
STAGES = [*BAKE, "apply_base_texture", "budget_reduce", "lod_export", "package", "report"]

# A floor with a base texture, a wall and a dome, lit by two lights; tolerance and depth as coarse as they may be.
TINY = """
geometry:
- {name: floor, rectangle: {origin: [0, 0, 0], u: [4, 0, 0], v: [0, 3, 0]}, material: wood}
- {name: back wall, rectangle: {origin: [0, 3, 0], u: [4, 0, 0], v: [0, 0, 2.5]}, material: white}
- name: dome
  nurbs:
    {degree_u: 2, degree_v: 2, knots_u: [0, 0, 0, 1, 1, 1], knots_v: [0, 0, 0, 1, 1, 1], points: [
    [[1.5, 1.2, 0.3], [1.5, 1.6, 0.8], [1.5, 2, 0.3]],
    [[1.9, 1.2, 0.8], [1.9, 1.6, 1.6], [1.9, 2, 0.8]],
    [[2.3, 1.2, 0.3], [2.3, 1.6, 0.8], [2.3, 2, 0.3]]]}
  material: white
- {name: lamp, rectangle: {origin: [1, 1, 2.4], u: [0, 1, 0], v: [1, 0, 0]}, material: lamp}
- {name: glow, rectangle: {origin: [3.9, 1, 0.5], u: [0, 0, 1], v: [0, 1, 0]}, material: glow}
materials:
  wood: {texture: wood.png, repeat: [2, 1]}
  white: {reflectance: [0.7, 0.6, 0.5]}
  lamp: {reflectance: 0, emission: 10}
  glow: {reflectance: 0.2, power: 30}
bake: {tolerance: 0.1, max_level: 5, chunks: 3, texture_level: 5}
budget: 8 KiB
lods: [{deviation: 5 mm}, 0.3]
camera: {eye: [2, -4, 2], target: [2, 1.5, 1]}
"""
NAME = "tiny-room"  # of the results of the folder `tiny room`


class Project:
    """A copy of the checkout, scene folders and a working folder, below one folder whose path has a space.

    checkout, scene, work : Paths;  a run starts in `work` and writes work/results
    """

    def __init__(self, checkout, scene, work):
        self.checkout, self.scene, self.work = checkout, scene, work

    @property
    def results(self):
        """Where the bake of the tiny room lies."""
        return self.work / "results" / NAME

    def command(self, *options, scene=None, config=(), cores=2):
        """The command line of a run; options may hold targets."""
        shown = [] if scene == "" else [f"scene={scene or self.scene}"]
        command = [sys.executable, "-m", "snakemake", "--snakefile", self.checkout / "Snakefile", *options]
        return [str(word) for word in (*command, "--cores", cores, "--config", *shown, *config)]

    def run(self, *options, **chosen):
        """Run to the end; the CompletedProcess with its texts."""
        command = self.command(*options, **chosen)
        return subprocess.run(command, cwd=self.work, env=environment(), capture_output=True, text=True, timeout=LIMIT)

    def bake(self, *options, **chosen):
        """Run to the end and demand that it ends well."""
        done = self.run(*options, **chosen)
        assert done.returncode == 0, done.stderr[-4000:]
        return done

    def listed(self, *options, **chosen):
        """{rule: number of jobs} a dry run lists, without `all`."""
        return jobs(self.bake("--dry-run", *options, **chosen))

    @contextmanager
    def started(self, *options, **chosen):
        """A run in the background, in a process group of its own that ends with the block."""
        with open(self.work / "terminal.txt", "w", encoding="utf-8") as terminal:
            process = subprocess.Popen(
                self.command(*options, **chosen),
                cwd=self.work, env=environment(), stdout=terminal, stderr=terminal, start_new_session=True,
            )  # fmt: skip
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def environment():
    """The variables of a user's shell: none of an outer run, one thread a job."""
    kept = {name: text for name, text in os.environ.items() if not name.startswith(("BAKE_", "SNAKEMAKE_"))}
    return {**kept, "OPENBLAS_NUM_THREADS": "1"}


def jobs(done):
    """{rule: number of jobs} of a run's `Job stats` table, without `all`; empty when there was nothing to do."""
    text = done.stdout + done.stderr
    if "Nothing to be done" in text:
        return {}
    table = re.search(r"Job stats:\njob +count\n[- ]+\n(.*?)\ntotal ", text, re.DOTALL)
    assert table, text
    counts = {line.split()[0]: int(line.split()[1]) for line in table[1].splitlines()}
    return {rule: n for rule, n in counts.items() if rule != "all"}


def products(results):
    """{file below `results`: SHA-256} of all that is loaded elsewhere; the report tells times and is left out."""
    files = [results / "lods.json", *results.glob("scene*"), *results.glob("maps/*"), *results.glob("textures/*")]
    return {
        str(path.relative_to(results)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(files)
        if path.suffix != ".part"  # what a killed job left
    }


@contextmanager
def edited(path, old, new):
    """`old` replaced by `new` in a file for the length of the block."""
    before = path.read_text(encoding="utf-8")
    assert old in before, f"{path}: no {old!r}"
    path.write_text(before.replace(old, new, 1), encoding="utf-8")
    try:
        yield
    finally:
        path.write_text(before, encoding="utf-8")


def wait_for(process, *patterns, folder):
    """Wait until each glob pattern finds a file below folder, or the process has ended."""
    deadline = time.monotonic() + LIMIT
    while process.poll() is None and not all(any(folder.glob(pattern)) for pattern in patterns):
        assert time.monotonic() < deadline, f"nothing at {patterns}"
        time.sleep(0.01)


def stage_processes(driver):
    """Process ids of the stages that run below a driver."""
    parent = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            parent[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
    below, front = set(), {driver}
    while front:
        front = {pid for pid, its in parent.items() if its in front} - below
        below |= front
    return sorted(pid for pid in below if b"stages." in _command(pid))


def _command(pid):
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""
