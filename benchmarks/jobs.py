"""The jobs of a finished bake as commands, to run them again one at a time, with other settings or with a watch on."""

import json
import os
import shlex
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import measure

ROOT = Path(__file__).resolve().parents[1]
DOOR = str(ROOT / "stages")  # what the rules run, before the name of the stage
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}


@dataclass
class Job:
    """One job: stage, its arguments {option: [values]}; runs in the working folder of its bake."""

    stage: str
    arguments: dict = field(default_factory=dict)

    @property
    def settings(self):
        """Its --settings."""
        return json.loads(self.arguments["--settings"][0])

    def with_settings(self, **changed):
        """The same job with other settings."""
        return Job(self.stage, self.arguments | {"--settings": [json.dumps(self.settings | changed)]})

    def argv(self):
        """Arguments as the stage's main takes them."""
        return [text for option, values in self.arguments.items() for text in (option, *values)]

    def run(self, work, *before):
        """Run it: Spent.  before : what stands between the interpreter and the arguments instead of -m stages.X."""
        command = [sys.executable, *(before or ("-m", f"stages.{self.stage}")), *self.argv()]
        return measure.run(command, cwd=work, env={**os.environ, **ENVIRONMENT}, log=Path(work) / "job.txt")


def snakemake(work, cores=1):
    """The command that bakes in the working folder `work`; options and the scene follow."""
    return [sys.executable, "-m", "snakemake", "--snakefile", ROOT / "Snakefile", "--directory", work, "--cores", cores]


def jobs_of(folder, work, stages):
    """The jobs of some stages of the bake of `folder` in `work`, in an order that can be run."""
    asked = [*snakemake(work), "--dry-run", "--forceall", "--printshellcmds", "--config", f"scene={folder}"]
    said = subprocess.run([str(a) for a in asked], capture_output=True, text=True, check=True)
    found = []
    for line in (said.stdout + said.stderr).splitlines():
        words = shlex.split(line.split("Shell command:")[-1]) if f"{DOOR} " in line else []
        if DOOR in words and (stage := words[words.index(DOOR) + 1]) in stages:
            arguments, rest = {}, words[words.index(DOOR) + 2 :]
            for word in rest:
                if word.startswith("--"):
                    values = arguments.setdefault(word, [])
                else:
                    values.append(word)
            found.append(Job(stage, arguments))

    def order(job):
        half = job.arguments.get("--half", [""])[0]
        return stages.index(job.stage), half == "indirect", int(job.arguments.get("--chunk", ["0"])[0])

    return sorted(found, key=order)
