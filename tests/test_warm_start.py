"""Jobs in forks of one process: what they get, what comes back, and how they end."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOOR = [sys.executable, "-I", "-S", ROOT / "stages" / "__main__.py"]
KEEPER = """
import os
from lib import warm_start
warm_start.start()
print(os.environ[warm_start.VARIABLE], flush=True)
input()
"""
TELLS = """
import json, os, sys
loaded = os.getpid()
def main(argv):
    print(json.dumps({"argv": argv, "name": sys.argv[0], "folder": os.getcwd(), "said": os.environ.get("SAID"),
                      "own": loaded == os.getpid(), "parent": os.getppid(), "read": sys.stdin.read()}))
    print("told", file=sys.stderr)
    return 3
if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
"""
STAGES = {
    "tells": TELLS,
    "breaks": "def main(argv):\n    raise ValueError('too dark')\n",
    "crashes": "import os\ndef main(argv):\n    os.kill(os.getpid(), 9)\n",
    "refuses": "import argparse\ndef main(argv):\n    argparse.ArgumentParser().parse_args(argv)\n",
    "loads": "import sys\ndef main(argv):\n    print('lately' in sys.modules)\n    import lately\n",
    "waits": "import os, time\ndef main(argv):\n    open(argv[0], 'w').write(str(os.getpid()))\n    time.sleep(60)\n",
}


def is_alive(pid):
    """A process that has ended but was not waited for counts as ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def wait_until(condition):
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end, "it does not come"
        time.sleep(0.01)


@pytest.fixture
def home(tmp_path):
    (tmp_path / "stages").mkdir()
    for name, text in {"__init__": "", **STAGES}.items():
        (tmp_path / "stages" / f"{name}.py").write_text(text)
    return tmp_path


def environment(home, **more):
    return {**os.environ, "PYTHONPATH": f"{home}:{ROOT}", **more}


@pytest.fixture
def keeper(home):
    """A process that keeps the warm one: (its Popen, the address)."""
    process = subprocess.Popen(
        [sys.executable, "-c", KEEPER],
        env=environment(home),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    yield process, process.stdout.readline().strip()
    process.stdin.close()
    process.stdout.close()
    process.wait()


def asked(home, address, *words, **more):
    """A finished job."""
    env = environment(home, BAKE_WARM=address, SAID="a = b\nc")
    return subprocess.run([*DOOR, *words], env=env, cwd=home, capture_output=True, text=True, timeout=60, **more)


def test_a_job_has_the_arguments_folder_environment_and_streams_of_who_asked(home, keeper):
    done = asked(home, keeper[1], "tells", "--a", "x y", "", "ü", input="in\n")
    told = json.loads(done.stdout)
    assert told.pop("parent") not in (os.getpid(), keeper[0].pid)
    assert told == {
        "argv": ["--a", "x y", "", "ü"],
        "name": "stages.tells",
        "folder": str(home),
        "said": "a = b\nc",
        "own": False,  # loaded before the fork
        "read": "in\n",
    }
    assert (done.returncode, done.stderr) == (3, "told\n")


def test_a_request_may_be_longer_than_a_socket_holds(home, keeper):
    words = [f"{k:0100d}" for k in range(10000)]
    assert json.loads(asked(home, keeper[1], "tells", *words, input="").stdout)["argv"] == words


def test_jobs_run_side_by_side_in_forks_of_one_process(home, keeper):
    told = [json.loads(asked(home, keeper[1], "tells", input="").stdout) for _ in range(2)]
    assert told[0]["parent"] == told[1]["parent"]
    env = environment(home, BAKE_WARM=keeper[1])
    jobs = [subprocess.Popen([*DOOR, "waits", home / name], env=env) for name in ("one", "two")]
    wait_until(lambda: all((home / name).exists() for name in ("one", "two")))
    for job in jobs:
        job.kill()
        job.wait()


def test_what_two_jobs_had_to_load_is_there_for_the_next(home, keeper):
    (home / "lately.py").write_text("")
    (home / "stages" / "other.py").write_text(STAGES["loads"])
    told = [asked(home, keeper[1], stage).stdout for stage in ("loads", "other", "loads", "other")]
    assert told == ["False\n", "False\n", "True\n", "True\n"]


@pytest.mark.parametrize("address", ["", "/nowhere/jobs", "stale"])
def test_without_the_process_a_stage_runs_by_itself(home, address):
    if address == "stale":
        address = str(home / "stale")
        Path(address).write_text("")
    done = asked(home, address, "tells", "x", input="in")
    told = json.loads(done.stdout)
    assert (done.returncode, told["argv"], told["own"], told["parent"]) == (3, ["x"], True, os.getpid())


@pytest.mark.parametrize("where", ["too long a path", "nowhere"])
def test_without_a_place_for_its_socket_no_process_is_started(home, where):
    place = home / ("x" * 110 if where == "too long a path" else "missing")
    if where == "too long a path":
        place.mkdir()
    code = f"import tempfile\ntempfile.tempdir = {str(place)!r}\n" + KEEPER.replace(
        "[warm_start.VARIABLE]", ".get('BAKE_WARM')"
    )
    env = environment(home, BAKE_WARM="/of/another/run")
    done = subprocess.run([sys.executable, "-c", code], env=env, input="\n", capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "None\n"), done.stderr
    assert not place.exists() or not list(place.iterdir())


def test_the_door_without_a_stage_says_what_it_wants():
    done = subprocess.run(DOOR, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (1, "python stages STAGE ARGUMENTS\n")


@pytest.mark.parametrize(
    ("stage", "status", "told"),
    [
        ("breaks", 1, "ValueError: too dark"),
        ("crashes", 128 + signal.SIGKILL, ""),
        ("refuses", 2, "unrecognized arguments"),
        ("misses", 1, "No module named 'stages.misses'"),
    ],
)
def test_a_job_that_fails_says_so_and_the_next_one_runs(home, keeper, stage, status, told):
    done = asked(home, keeper[1], stage, "x")
    assert done.returncode == status
    assert told in done.stderr
    assert asked(home, keeper[1], "tells", input="").returncode == 3


def test_a_job_ends_when_who_asked_is_stopped(home, keeper):
    asking = subprocess.Popen([*DOOR, "waits", home / "pid"], env=environment(home, BAKE_WARM=keeper[1]))
    wait_until(lambda: (home / "pid").exists() and (home / "pid").read_text())
    pid = int((home / "pid").read_text())
    assert is_alive(pid)
    asking.kill()
    asking.wait()
    wait_until(lambda: not is_alive(pid))
    assert asked(home, keeper[1], "tells", input="").returncode == 3


@pytest.mark.parametrize("how", ["it ends", "it is killed"])
def test_the_jobs_and_their_process_end_with_who_started_it(home, keeper, how):
    process, address = keeper
    env = environment(home, BAKE_WARM=address)
    asking = subprocess.Popen([*DOOR, "waits", home / "pid"], env=env, stderr=subprocess.PIPE)
    wait_until(lambda: (home / "pid").exists() and (home / "pid").read_text())
    pid = int((home / "pid").read_text())
    parent = int(Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[1])
    if how == "it ends":
        process.stdin.write("\n")
        process.stdin.flush()
    else:
        process.kill()
    assert "has gone" in asking.communicate(timeout=60)[1].decode()
    assert asking.returncode == 1
    wait_until(lambda: not is_alive(pid) and not is_alive(parent))
    assert process.wait(timeout=60) == (0 if how == "it ends" else -signal.SIGKILL)
    assert os.path.exists(address) == (how == "it is killed")
