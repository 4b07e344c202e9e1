"""What a command costs: CPU seconds of all its processes, wall seconds, and the memory they hold together at most."""

import os
import subprocess
import threading
import time
from dataclasses import dataclass

PAGE = os.sysconf("SC_PAGE_SIZE")
EVERY = 0.05  # seconds between two looks at the memory


@dataclass(frozen=True)
class Spent:
    """cpu : user + system seconds of the command and of every process it started and waited for; wall : seconds;
    peak_mb : largest sum of the resident memory of all of them, looked at every 50 ms (shared pages count for each)."""

    cpu: float
    wall: float
    peak_mb: float


def run(command, cwd=None, env=None, log=None):
    """Run a command to its end: Spent.  Its output goes to the file `log`; RuntimeError with its end if it fails."""
    with open(log or os.devnull, "w", encoding="utf-8") as out:
        begin = time.monotonic()
        process = subprocess.Popen([str(c) for c in command], cwd=cwd, env=env, stdout=out, stderr=subprocess.STDOUT)
        done, peak = threading.Event(), [0]
        watch = threading.Thread(target=_watch, args=(process.pid, done, peak), daemon=True)
        watch.start()
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.monotonic() - begin
        process.returncode = os.waitstatus_to_exitcode(status)
        done.set()
        watch.join()
    if process.returncode:
        said = open(log, encoding="utf-8", errors="replace").read()[-3000:] if log else ""
        raise RuntimeError(f"{' '.join(map(str, command))}: exit status {process.returncode}\n{said}")
    return Spent(usage.ru_utime + usage.ru_stime, wall, peak[0] / 2**20)


def _watch(pid, done, peak):
    while not done.wait(EVERY):
        peak[0] = max(peak[0], sum(_resident(p) for p in _family(pid)))


def _family(pid):
    found = [pid]
    for parent in found:
        try:
            for task in os.listdir(f"/proc/{parent}/task"):
                with open(f"/proc/{parent}/task/{task}/children", encoding="ascii") as file:
                    found += [int(child) for child in file.read().split()]
        except OSError:
            pass
    return found


def _resident(pid):
    try:
        with open(f"/proc/{pid}/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * PAGE
    except OSError:
        return 0


def least_of(command, times=3, **options):
    """CPU seconds of the cheapest of a few runs of a short command: its start-up, less the machine's noise."""
    return min(run(command, **options).cpu for _ in range(times))
