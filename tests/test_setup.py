"""The files of the set-up agree with each other: pyproject, lock, Makefile, README, and what the code imports."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")

REQUIRED = [Requirement(text) for text in PROJECT["dependencies"]]
EXTRAS = {name: [Requirement(text) for text in texts] for name, texts in PROJECT["optional-dependencies"].items()}
PINS = {canonicalize_name(name): version for name, version in re.findall(r"^([\w.-]+)==(\S+)", LOCK, re.MULTILINE)}
IMPORT_NAMES = {  # others: - is _
    "open3d-cpu": "open3d", "pyyaml": "yaml", "openimageio": "OpenImageIO", "cadquery-ocp-novtk": "OCP",
}  # fmt: skip
COMMANDS = {"snakemake", "pytest"}  # run rather than imported

needs_make = pytest.mark.skipif(not shutil.which("make"), reason="no make here")


def imported():
    """First parts of all names that Python files of the repository import, by file."""
    names = {}
    for folder in ("lib", "stages", "tests", "benchmarks", "data"):
        for path in (ROOT / folder).rglob("*.py"):
            nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
            found = {alias.name.split(".")[0] for n in nodes if isinstance(n, ast.Import) for alias in n.names}
            froms = [n for n in nodes if isinstance(n, ast.ImportFrom) and n.module and not n.level]
            found |= {n.module.split(".")[0] for n in froms}
            names[path.relative_to(ROOT).as_posix()] = found
    return names


def import_name(requirement):
    name = canonicalize_name(requirement.name)
    return IMPORT_NAMES.get(name, name.replace("-", "_"))


@pytest.mark.parametrize("requirement", [*REQUIRED, *EXTRAS["dev"]], ids=lambda r: r.name)
def test_the_lock_pins_every_direct_dependency_within_its_range(requirement):
    assert PINS[canonicalize_name(requirement.name)] in requirement.specifier


def test_every_pin_has_a_hash_and_nothing_else_is_in_the_lock():
    entries = re.split(r"^(?=[\w.-]+==)", LOCK, flags=re.MULTILINE)[1:]
    assert len(entries) == len(PINS)
    assert not [entry for entry in entries if "--hash=sha256:" not in entry]
    lines = [line for line in LOCK.splitlines() if line and not re.match(r"\s*(#|--hash=sha256:[0-9a-f]{64})", line)]
    # No index, path, address or marker.
    assert not [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.]+ \\", line)]


def test_the_running_python_is_a_supported_one():
    assert sys.version_info[:2] in [(3, 11), (3, 12), (3, 13)]
    assert PROJECT["requires-python"] == ">=3.11,<3.14"


def test_what_is_imported_is_declared():
    known = {import_name(r) for r in [*REQUIRED, *EXTRAS["step"]]}
    beside = {import_name(r) for r in [*EXTRAS["bench"], *EXTRAS["dev"]]} | {"packaging"}  # in tests and benchmarks
    ours = {"lib", "stages", "tests", "benchmarks"} | {path.stem for path in (ROOT / "benchmarks").glob("*.py")}
    foreign = {
        (path, name)
        for path, names in imported().items()
        for name in names - known - ours - set(sys.stdlib_module_names)
        if name not in beside or path.startswith(("lib/", "stages/"))
        if not (ROOT / path).with_name(f"{name}.py").exists()  # a neighbour, in a script
    }
    assert not foreign


def test_what_is_declared_is_used():
    used = set().union(*imported().values()) | COMMANDS
    source = " ".join(path.read_text(encoding="utf-8") for path in (ROOT / "lib").rglob("*.py"))
    unused = {r.name for r in REQUIRED if import_name(r) not in used and f'"{import_name(r)}' not in source}
    assert not unused


def test_readme_and_makefile_name_the_same_system_packages():
    packages = re.search(r"^SYSTEM_PACKAGES := (.*)$", MAKEFILE, re.MULTILINE)[1]
    assert packages in README


def test_readme_tells_of_every_direct_dependency():
    table = README[README.index("## Dependencies") :]
    assert not [r.name for r in REQUIRED if f"`{r.name}`" not in table]


def test_every_make_target_has_a_line_of_help():
    phony = re.search(r"^\.PHONY: (.*)$", MAKEFILE, re.MULTILINE)[1].split()
    assert sorted(phony) == sorted(re.findall(r"^([a-z-]+):.*## ", MAKEFILE, re.MULTILINE))


def test_ci_script_runs_by_itself():
    assert os.access(ROOT / ".ci" / "run", os.X_OK)


@pytest.fixture
def checkout(tmp_path):
    """The set-up's files alone, in a folder whose path has a space."""
    folder = tmp_path / "fresh clone"
    folder.mkdir()
    for name in ("Makefile", "requirements.lock"):
        shutil.copy(ROOT / name, folder)
    return folder


def setup(folder, *arguments):
    """Run `make setup` away from the caller's make."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    command = ["make", "setup", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=60)


def stamp(folder, where=None):
    """A .venv as the set-up leaves it, with a stand-in for Python."""
    (folder / ".venv" / "bin").mkdir(parents=True)
    (folder / ".venv" / "bin" / "python").symlink_to(sys.executable)
    checksum = subprocess.run(["cksum"], input=LOCK, capture_output=True, text=True, check=True).stdout
    (folder / ".venv" / "packages.stamp").write_text(f"{where or folder.resolve()} {checksum}", encoding="utf-8")
    (folder / ".venv" / "system.stamp").touch()


@needs_make
def test_no_suitable_python_is_told(checkout):
    done = setup(checkout, "PYTHON=no-such-python")
    assert done.returncode and not (checkout / ".venv").exists()
    assert "no suitable Python" in done.stderr and "tried: no-such-python" in done.stderr


@needs_make
def test_a_finished_environment_is_left_alone(checkout):
    stamp(checkout)
    done = setup(checkout, "PYTHON=no-such-python")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@needs_make
@pytest.mark.parametrize("harm", ["half made", "moved", "lock changed", "python gone"])
def test_an_environment_that_does_not_fit_is_not_used(checkout, harm):
    """It would be made anew; with no Python to make it from, that is refused."""
    stamp(checkout, where="/elsewhere" if harm == "moved" else None)
    if harm == "half made":
        (checkout / ".venv" / "packages.stamp").unlink()
    elif harm == "lock changed":
        (checkout / "requirements.lock").write_text(LOCK + "# more\n", encoding="utf-8")
    elif harm == "python gone":
        (checkout / ".venv" / "bin" / "python").unlink()
    done = setup(checkout, "PYTHON=no-such-python")
    assert done.returncode and "no suitable Python" in done.stderr
