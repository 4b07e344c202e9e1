"""The frame every stage's `main` hangs in: arguments, log, cost, and plain errors on the terminal.

A stage is `main(argv) = run(__doc__, arguments, body, argv)`: `arguments(parser)` names its files and settings,
`body(args, cost)` loads, calls and saves.  Every stage takes `--log FILE` (messages, beside the result),
`--cost FILE` (seconds, memory, rays as JSON) and `--threads N` (see lib.forks).
"""

import argparse
import json
import os
import resource
import sys
import time
import traceback
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from lib import forks
from lib.formats.artefact import ArtefactError, read_json, write_json
from lib.refusal import Refusal


def cpu_seconds():
    """User and system seconds of this process and its children so far."""
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in usage)


@dataclass
class Cost:
    """What a job spent: rays are counted by the stage, times and memory by the door.

    notes : savings worth a number
    stopped : why the job stopped, empty if it did not
    """

    stage: str
    rays: int = 0
    notes: dict = field(default_factory=dict)
    stopped: str = ""
    started: float = field(default_factory=time.monotonic)
    cpu_before: float = field(default_factory=cpu_seconds)

    def as_dict(self):
        """The JSON record: wall and CPU seconds since this was made (children included), peak memory in MB, rays."""
        peak = _own_peak_kb() or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return {
            "stage": self.stage,
            "seconds": round(time.monotonic() - self.started, 4),
            "cpu_seconds": round(cpu_seconds() - self.cpu_before, 4),
            "peak_mb": round(max(peak, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss) / 1024, 1),
            "rays": int(self.rays),
            "notes": self.notes,
            "run": os.environ.get("BAKE_RUN", ""),
            **({"stopped": self.stopped} if self.stopped else {}),
        }


def _own_peak_kb():
    """Peak memory of this process [kB], 0 where /proc does not tell; getrusage's is that of its parent if larger."""
    try:
        with open("/proc/self/status", encoding="ascii") as file:
            return next((int(line.split()[1]) for line in file if line.startswith("VmHWM:")), 0)
    except OSError:
        return 0


class _Log:
    """Where messages go besides the terminal; one per call of `run`, none outside."""

    def __init__(self, path):
        self.path = path
        if path:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            Path(path).write_text("", encoding="utf-8")

    def add(self, text):
        if self.path:
            with open(self.path, "a", encoding="utf-8") as file:
                file.write(text + "\n")


_open_logs = []


def warn(text, is_told=False):
    """Print a warning to the terminal, unless it is told there already, and the log of the stage that is running."""
    line = f"warning: {text}"
    if not is_told:
        print(line, file=sys.stderr, flush=True)
    for log in _open_logs[-1:]:
        log.add(line)


def json_text(text):
    """The value of an argument that is JSON, or @FILE that holds it: a command line holds 128 kB."""
    if not text.startswith("@"):
        return json.loads(text)
    try:
        return read_json(text[1:])
    except ArtefactError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def run(doc, arguments, body, argv=None):
    """Run a stage; return its exit status: 0, or 1 after one plain line that says why."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments(parser)
    parser.add_argument("--log", metavar="FILE", help="messages, also printed to the terminal")
    parser.add_argument("--cost", metavar="FILE", help="JSON: seconds, memory and rays of this job")
    parser.add_argument(
        "--threads", type=int, default=1, metavar="N", help="cores it may use, where it can use several"
    )
    args = parser.parse_args(argv)
    cost = Cost(stage=Path(sys.modules[body.__module__].__file__ or "stage").stem)
    log = _Log(args.log)
    _open_logs.append(log)
    cores = forks.allow(args.threads)
    try:
        body(args, cost)
    except (Refusal, ArtefactError) as error:
        cost.stopped = _named(error)
        print(cost.stopped, file=sys.stderr, flush=True)
        log.add(cost.stopped)
        return 1
    except KeyboardInterrupt:  # the user knows why
        return 130
    except Exception as error:  # a fault of ours: the whole story goes to the terminal and to the log
        cost.stopped = f"{cost.stage}: {type(error).__name__}: {error}; a fault of this program"
        log.add(traceback.format_exc())
        raise
    finally:
        forks.allow(cores)
        _open_logs.pop()
        if cost.stopped and args.cost:
            with suppress(ArtefactError):  # the disk may be what stopped it
                write_json(args.cost, cost.as_dict())
    if args.cost:
        write_json(args.cost, cost.as_dict())
    log.add(json.dumps(cost.as_dict()))
    return 0


def _named(error):
    """The message, after the scene's file as the user gave it (BAKE_SCENE) where a setting is refused without one."""
    text, file = str(error), os.environ.get("BAKE_SCENE", "")
    return f"{file}: {text}" if file and isinstance(error, Refusal) and not text.startswith(file) else text


def stopped(folder, run):
    """Why jobs below `folder` stopped in this run: a line each, from the records they left."""
    lines = []
    for path in sorted(Path(folder).glob("**/*cost*.json")):
        with suppress(ArtefactError):
            record = read_json(path)
            if record.get("run") == run and record.get("stopped"):
                lines.append(record["stopped"])
    return lines
