"""The same bytes whatever the number of cores and chunks, and whatever was killed, cut off or damaged on the way."""

import os
import random
import signal
import subprocess
import time
from contextlib import ExitStack, suppress

import pytest

from tests.pipeline.runs import jobs, products, stage_processes, wait_for

pytestmark = pytest.mark.slow

FINAL = "results/tiny-room/lods.json"  # and with it maps, textures, levels and GLB; the report is not compared


def test_what_is_compared_is_there(baked):
    found = products(baked.results)
    assert {name.split("/")[0] for name in found} >= {"maps", "textures", "scene.glb", "scene_LOD1.gltf", "lods.json"}
    assert sum(name.startswith("maps/") for name in found) == 4  # the lamp reflects nothing


def test_one_core_one_chunk_and_a_second_run_beside_it(baked, fresh):
    """A run that finds another in its folder refuses, and does that one no harm."""
    with fresh.started(FINAL, cores=1, config=["bake={chunks: 1}"]) as first:
        wait_for(first, "results/*/stages/import_scene/scene.npz", folder=fresh.work)
        first.send_signal(signal.SIGSTOP)  # so that it is there for as long as the second one looks
        assert first.poll() is None
        second = fresh.run(FINAL, "--rerun-incomplete", config=["bake={chunks: 1}"])
        first.send_signal(signal.SIGCONT)
        assert second.returncode != 0 and "cannot be locked" in second.stderr
        assert "Traceback" not in second.stderr
        assert first.wait() == 0
    assert jobs_of_terminal(fresh)["sample"] == 1
    assert products(fresh.results) == products(baked.results)


def jobs_of_terminal(project):
    text = (project.work / "terminal.txt").read_text(encoding="utf-8")
    return jobs(subprocess.CompletedProcess([], 0, text, ""))


def test_killed_at_random_moments(baked, fresh):
    """Driver or jobs die by SIGKILL, jobs of a dead driver work on beside the next; the bake is as if nothing was."""
    rng = random.Random(7)
    stages = fresh.results / "stages"
    moments = [
        ("driver", f"sample/chunk_{rng.randrange(3)}.npz"),
        ("jobs", f"refine/direct_{rng.randrange(3)}.npz"),
        ("driver", "balance_resample/chunk_0.npz"),
    ]
    with ExitStack() as started:
        for victim, pattern in moments:
            process = started.enter_context(fresh.started(FINAL, "--rerun-incomplete"))
            wait_for(process, pattern, folder=stages)
            time.sleep(rng.uniform(0, 0.1))
            pids = [process.pid] if victim == "driver" else stage_processes(process.pid)
            for pid in pids:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            process.wait()
            if victim == "driver":
                fresh.bake("--unlock")
        fresh.bake(FINAL, "--rerun-incomplete")
    assert products(fresh.results) == products(baked.results)
    assert fresh.listed(FINAL) == {}


def test_a_full_disk_is_named_and_the_bake_goes_on_after_it(baked, copied):
    """Files may not grow beyond 20 kB: the stage that wants more says which; without the limit the rest is made."""
    for name in ("stages/budget_reduce/textures.npz", "lods.json"):
        (copied.results / name).unlink()
    command = ["bash", "-c", 'ulimit -f 20; exec "$@"', "run", *copied.command(FINAL)]
    done = subprocess.run(command, cwd=copied.work, capture_output=True, text=True)
    assert done.returncode != 0 and "Traceback" not in done.stderr
    path = "results/tiny-room/stages/budget_reduce/textures.npz"
    assert f"{path}: can not be written: File too large" in done.stderr.splitlines()
    assert set(jobs(copied.bake(FINAL))) == {"budget_reduce", "package"}
    assert products(copied.results) == products(baked.results)


def test_damage_under_an_old_time_stamp_is_noticed(copied):
    """A flipped and a cut file, time stamps as before: the stages that read them name them, and say what to do."""
    flipped, cut = (copied.results / "stages" / "sample" / f"chunk_{c}.npz" for c in (0, 1))
    for path in (flipped, cut):
        status = path.stat()
        data = bytearray(path.read_bytes())
        if path is flipped:
            data[len(data) // 2] ^= 1
        else:
            del data[len(data) * 2 // 3 :]
        path.write_bytes(data)
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert copied.listed() == {}  # the workflow engine alone does not see it
    done = copied.run("--keep-going", config=["bake={tolerance: 0.07}"])
    assert done.returncode != 0 and "Traceback" not in done.stderr
    for path in (flipped, cut):
        name = path.relative_to(copied.work)
        assert any(line.startswith(f"{name}: damaged") and "delete it" in line for line in done.stderr.splitlines())
        path.unlink()
    assert copied.listed()["sample"] == 2


def test_leftovers_of_a_failed_job_are_not_taken_for_finished(copied):
    """--keep-incomplete after a fault between the maps and the file that is written after them."""
    path = copied.checkout / "lib/formats/textured_maps.py"
    before = path.read_text(encoding="utf-8")
    try:
        path.write_text(before + '\n\ndef save(path, x):\n    raise ValueError("cut off")\n', encoding="utf-8")
        done = copied.run("--keep-incomplete", "--until", "apply_base_texture")
    finally:
        path.write_text(before, encoding="utf-8")
    assert done.returncode != 0
    assert "Traceback" in done.stderr and "ValueError: cut off" in done.stderr  # a fault of the program, told in full
    last = [line for line in done.stderr.splitlines() if line.startswith("apply_base_texture: ")]
    assert last == ["apply_base_texture: ValueError: cut off; a fault of this program"]
    left = products(copied.results)
    assert any(name.startswith("maps/") for name in left)
    assert "apply_base_texture" in copied.listed("--rerun-incomplete")
