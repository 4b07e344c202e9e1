"""lib.compiled: kernels compute what their Python says, are compiled once, and are refused where they can not run."""

import gc
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lib import compiled

ROOT = Path(__file__).resolve().parents[1]
SOURCE = '''
import math
import numpy as np
from lib.compiled import compiled, inlined

FACTOR = 3.0

@inlined
def scaled(x):
    return FACTOR * x

@compiled("f4[:,:], b1[:], f8, i8, f8[:]")
def sums(a, counts, angle, least, out):
    """Sums of rows that count, times the cosine; returns how many rows are longer than `least`."""
    for i in range(len(a)):
        out[i] = 0
        if counts[i]:
            for j in range(a.shape[1]):
                out[i] += scaled(a[i, j]) * math.cos(angle)
    return len(a) if a.shape[1] > least else 0
'''


def module_of(folder, source=SOURCE, name="kernels_of_a_test"):
    """A module of this source, in a folder of its own."""
    path = folder / f"{name}.py"
    path.write_text(source, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    compiled._engine.cache_clear()
    return module


@pytest.fixture(autouse=True)
def no_cache_of_the_user(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    yield
    for name in ("kernels_of_a_test", "other_kernels_of_a_test"):
        sys.modules.pop(name, None)


def arguments():
    return np.arange(12, dtype=np.float32).reshape(3, 4), np.array([True, False, True]), np.pi / 3, 3, np.ones(3)


def kept(folder):
    return sorted(path.name for path in folder.glob("*.o"))


def test_a_kernel_computes_what_its_python_says(tmp_path):
    module = module_of(tmp_path)
    args, plain = arguments(), arguments()
    assert module.sums(*args) == module.sums.__wrapped__(*plain) == 3
    assert args[-1] == pytest.approx([0.5 * 3 * 6, 0, 0.5 * 3 * 38]) and args[-1] == pytest.approx(plain[-1])


@pytest.mark.parametrize(
    "place, wrong",
    [
        (0, np.ones((3, 4))),  # float64
        (0, np.ones(12, dtype=np.float32)),  # one axis
        (0, np.ones((4, 3), dtype=np.float32).T),  # not in C order
        (1, np.ones(3, dtype=np.uint8)),
    ],
)
def test_arrays_must_be_those_of_the_signature(tmp_path, place, wrong):
    args = list(arguments())
    args[place] = wrong
    with pytest.raises(TypeError, match="sums: .* expected"):
        module_of(tmp_path).sums(*args)
    with pytest.raises(ValueError):
        module_of(tmp_path).sums(*arguments()[:3])


@pytest.mark.parametrize(
    "line",
    ["a[0] = np.zeros(len(a))[0]", "if a[0] > 9: raise ValueError", "print(len(a))"],
    ids=["allocates", "raises", "calls"],
)
def test_what_needs_more_than_arithmetic_is_refused(tmp_path, line):
    head = "import numpy as np\nfrom lib.compiled import compiled\n@compiled('f8[:]')"
    source = f"{head}\ndef f(a):\n    {line}\n    return 0\n"
    with pytest.raises(ValueError, match="f allocates, raises or calls what is not there"):
        module_of(tmp_path, source).f(np.ones(3))


def test_machine_code_is_kept_and_serves_without_numba(tmp_path):
    module_of(tmp_path).sums(*arguments())
    assert len(kept(tmp_path / "__pycache__")) == 1
    lines = "import sys, numpy as np, kernels_of_a_test as k; a = np.ones((2, 2), 'f4'); out = np.ones(2)"
    lines += "; k.sums(a, np.ones(2, bool), 0.0, 0, out); print(out[1], 'numba' in sys.modules)"
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}:{tmp_path}"}
    said = subprocess.run([sys.executable, "-c", lines], env=environment, capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["6.0", "False"]


def test_of_processes_that_start_together_one_compiles(tmp_path):
    module_of(tmp_path)
    lines = f"""
import sys, time
sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]
import kernels_of_a_test, numpy
from lib import compiled
made = []
def slowly(*args, compile=compiled._compile):
    time.sleep(1)
    made.append(args)
    return compile(*args)
compiled._compile = slowly
print("ready", flush=True)
input()
kernels_of_a_test.sums(numpy.ones((1, 2), "f4"), numpy.ones(1, bool), 0.0, 1, numpy.ones(1))
print(len(made))
"""
    pipe = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    both = [subprocess.Popen([sys.executable, "-c", lines], **pipe) for _ in range(2)]
    for process in both:
        assert process.stdout.readline() == "ready\n"
    for process in both:
        process.stdin.write("\n")
        process.stdin.flush()
    assert sorted(process.communicate()[0] for process in both) == ["0\n", "1\n"]
    assert len(kept(tmp_path / "__pycache__")) == 1


def test_what_is_kept_can_be_loaded_ahead_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled, "_ready", set(compiled._modules))
    module = module_of(tmp_path)
    compiled._ready.discard(module.__name__)
    compiled.load_kept()
    assert module.sums._entry is None and not kept(tmp_path / "__pycache__")
    module.sums(*arguments())
    again = module_of(tmp_path)
    compiled.load_kept()
    assert again.sums._entry is not None and again.sums(*arguments()) == 3


def test_the_set_up_compiles_all_there_is():
    users = [p for p in (ROOT / "lib").rglob("*.py") if "import compiled" in p.read_text(encoding="utf-8")]
    modules = [importlib.import_module(".".join(p.relative_to(ROOT).with_suffix("").parts)) for p in users]
    having = [module for module in modules if compiled._kernels(module)]
    assert len(having) > 10
    folders, file = compiled._places(having[0])
    for folder in folders:
        (folder / file).unlink(missing_ok=True)
    compiled.compile_all()
    assert not [module.__name__ for module in having if compiled._kept(*compiled._places(module)) is None]


def test_a_damaged_file_is_made_anew(tmp_path):
    module_of(tmp_path).sums(*arguments())
    (path,) = (tmp_path / "__pycache__").glob("*.o")
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    args = arguments()
    assert module_of(tmp_path).sums(*args) == 3 and args[-1][0] == pytest.approx(9)
    assert len(path.read_bytes()) > len(whole) - 100


def test_other_numbers_are_other_code(tmp_path):
    """Also those a kernel takes from another module, whose text is not looked at."""
    module = module_of(tmp_path)
    module.sums(*arguments())
    module = module_of(tmp_path, SOURCE.replace("FACTOR = 3.0", "FACTOR = float(np.sqrt(4))"))
    args = arguments()
    module.sums(*args)
    assert args[-1][0] == pytest.approx(0.5 * 2 * 6)
    before = compiled._digest(module)
    module.FACTOR = 5.0
    assert compiled._digest(module) != before
    assert len(kept(tmp_path / "__pycache__")) == 2


def test_where_sources_are_read_only_the_users_cache_serves(tmp_path):
    (tmp_path / "__pycache__").write_text("a file, where the folder would be")
    module_of(tmp_path).sums(*arguments())
    assert len(kept(tmp_path / "cache" / "patchlight")) == 1
    (tmp_path / "cache" / "patchlight").rename(tmp_path / "elsewhere")
    (tmp_path / "cache").rmdir()
    (tmp_path / "cache").write_text("nor there")
    args = arguments()
    assert module_of(tmp_path).sums(*args) == 3 and args[-1][0] == pytest.approx(9)


def test_a_kernel_outlives_the_list_of_engines(tmp_path):
    """Its machine code belongs to the engine: without that, the process would end here."""
    (other := tmp_path / "other").mkdir()
    kernels = module_of(tmp_path)
    given = arguments()
    kernels.sums(*given)
    first = given[-1].copy()
    compiled._engine.cache_clear()
    gc.collect()
    module_of(other, name="other_kernels_of_a_test").sums(*arguments())  # may take the freed memory
    given[-1][:] = 0
    kernels.sums(*given)
    assert (given[-1] == first).all()
