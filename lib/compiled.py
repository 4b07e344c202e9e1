"""Functions over arrays as machine code: numba compiles them once per machine, later processes only load the result.

A kernel is a plain Python function of arrays and numbers.  Its first call ever, or `compile_all` in the set-up,
compiles all kernels of its module and keeps the object file beside the sources' byte code; from then on llvmlite loads
that, 0.05 CPU s with its import.
numba alone would take 0.5 in every job: 0.2 to import, 0.3 to load what it keeps (measured, numba 0.68).

A kernel may not allocate, raise or call what is neither `inlined` nor of `math` and numpy's scalars: nothing of
numba is there when it runs, and `_optimised` refuses what would need it.
"""

import ctypes
import fcntl
import hashlib
import os
import sys
import tempfile
from contextlib import contextmanager, suppress
from functools import cache, update_wrapper
from importlib import import_module
from pathlib import Path

import numpy as np

FROM_C = {"memcpy", "memmove", "memset", "sqrt", "sqrtf", "sin", "sinf", "cos", "cosf", "atan2", "floor", "floorf"}
NUMBERS = {"i8": ctypes.c_int64, "f8": ctypes.c_double, "f4": ctypes.c_float}  # arguments that are no array

_modules, _ready = set(), set()  # names of modules with kernels; those that load_kept is done with


class Kernel:
    """A compiled function; `__wrapped__` is the Python one.  Arrays must have the dtype, number of axes and C order
    of the signature: TypeError if not.  Returns an int.
    """

    def __init__(self, function, signature):
        update_wrapper(self, function)
        self.types = [(text[:2], text.count(":")) for text in signature.replace(" ", "").replace(":,", ":").split(",")]
        self._dtypes = [np.dtype(code.replace("b1", "?")) for code, _ in self.types]
        self._entry = None
        _modules.add(self.__module__)

    def __call__(self, *args):
        if self._entry is None:
            self.load()
        values = []
        for arg, (code, axes), dtype in zip(args, self.types, self._dtypes, strict=True):
            if not axes:
                values.append(arg)
                continue
            if arg.dtype != dtype or arg.ndim != axes or not arg.flags.c_contiguous:
                found = f"{arg.dtype} {arg.shape}"
                raise TypeError(f"{self.__name__}: {found}, expected {code} with {axes} axes in C order")
            values += (arg.__array_interface__["data"][0], *arg.shape)
        return self._entry(*values)

    def load(self):
        """Make it ready, which else its first call does."""
        argtypes = []
        for code, axes in self.types:
            argtypes += [ctypes.c_void_p, *[ctypes.c_int64] * axes] if axes else [NUMBERS[code]]
        self._engine = _engine(self.__module__)  # as long as it lives, so does the code
        address = self._engine.get_function_address(self.__name__)
        if not address:
            raise AttributeError(f"{self.__name__} is no kernel of {self.__module__} any more")
        self._entry = ctypes.CFUNCTYPE(ctypes.c_int64, *argtypes)(address)


def compiled(signature):
    """Make a function a Kernel.

    signature : a type for each argument, "f4[:, :], b1[:], i8": dtype, axes; an int, i8, is what all return
    """
    return lambda function: Kernel(function, signature)


def load_kept():
    """Load the kernels of all modules imported so far, of which there is machine code: forks of this process then need
    not.
    """
    for name in sorted(_modules - _ready):
        module = sys.modules.get(name)
        if module is not None and _kept(*_places(module)) is not None:
            _ready.add(name)
            for kernel in _kernels(module):
                kernel.load()


def compile_all():
    """Compile the kernels of all modules of lib of which there is no machine code, on all cores."""
    from concurrent.futures import ProcessPoolExecutor  # here: jobs need it not

    root = Path(__file__).resolve().parents[1]
    paths = sorted(p for p in (root / "lib").rglob("*.py") if "\n@compiled(" in p.read_text(encoding="utf-8"))
    with ProcessPoolExecutor() as pool:
        list(pool.map(_compile_one, (".".join(p.relative_to(root).with_suffix("").parts) for p in paths)))


def _compile_one(name):
    import_module(name)
    _engine(name)


def inlined(function):
    """A Python function that kernels may call."""
    function.is_inlined = True
    return function


def _llvm():
    """Loaded with the first call of a kernel: who calls none, such as the reader of the Snakefile, needs it not."""
    import llvmlite.binding

    return llvmlite.binding


@cache
def _engine(name):
    """The loaded kernels of a module.  It owns their memory."""
    llvm = _llvm()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    module = sys.modules[name]
    target = _target()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
    engine.add_object_file(llvm.ObjectFileRef.from_data(_object_code(module, target)))
    engine.finalize_object()
    return engine


def _target():
    cpu, features = _host()
    return _llvm().Target.from_default_triple().create_target_machine(cpu=cpu, features=features, opt=3, jit=True)


@cache
def _host():
    return _llvm().get_host_cpu_name(), _llvm().get_host_cpu_features().flatten()


def _object_code(module, target):
    """Object file of a module's kernels: the one kept, or made anew, by one of all who ask at a time."""
    folders, file = _places(module)
    code = _kept(folders, file)
    if code is not None:
        return code
    with _turn(module):
        code = _kept(folders, file)
        if code is None:
            code = _compile(module, target)
            for folder in folders:
                with suppress(OSError):
                    _keep(folder / file, hashlib.sha256(code).digest() + code)
                    break
    return code


def _places(module):
    """Folders where the object file of a module's kernels may lie, and its name."""
    file = f"{Path(module.__file__).stem}.{_digest(module)}.o"
    return [Path(module.__file__).parent / "__pycache__", _user_cache()], file


def _kept(folders, file):
    for folder in folders:
        with suppress(OSError):
            text = (folder / file).read_bytes()
            if hashlib.sha256(text[32:]).digest() == text[:32]:
                return text[32:]
    return None


@contextmanager
def _turn(module):
    """Wait until nobody else compiles this module: jobs that start together need the same code, which takes seconds.
    Where the file system has no locks, each makes its own.
    """
    with open(module.__file__, "rb") as file:
        with suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _user_cache():
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "patchlight"


def _keep(path, text):
    """Write a file that other processes may read or write at the same time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(text)
        os.replace(name, path)
    except OSError:
        os.unlink(name)
        raise


def _digest(module):
    """Of all that the machine code depends on: the sources, the numbers they take from elsewhere, and the machine."""
    parts = [sys.version, str(_llvm().llvm_version_info), *_host(), Path(__file__).read_text(encoding="utf-8")]
    functions = [kernel.__wrapped__ for kernel in _kernels(module)]
    functions += _inlined(functions)
    files = {sys.modules[f.__module__].__file__ for f in functions}
    parts += [Path(file).read_text(encoding="utf-8") for file in sorted(files)]
    parts += [f"{name} {value!r}" for f in functions for name, value in _globals(f) if np.isscalar(value)]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def _kernels(module):
    return [x for x in vars(module).values() if isinstance(x, Kernel) and x.__module__ == module.__name__]


def _globals(function):
    """(name, value) of what a function mentions of its module's names."""
    known = function.__globals__
    return [(name, known[name]) for name in function.__code__.co_names if name in known]


def _inlined(functions):
    """The inlined functions that some functions call, and those call."""
    found, front = [], list(functions)
    while front:
        for _, value in _globals(front.pop()):
            if getattr(value, "is_inlined", False) and value not in found:
                found.append(value)
                front.append(value)
    return found


def _compile(module, target):
    """Object code of all kernels of a module."""
    import numba
    from numba.extending import register_jitable

    kernels, whole = _kernels(module), None
    for function in _inlined([kernel.__wrapped__ for kernel in kernels]):
        register_jitable(error_model="numpy")(function)
    for kernel in kernels:
        part = _optimised(kernel, numba, target)
        whole = part if whole is None else whole.link_in(part) or whole
    return target.emit_object(whole)


def _optimised(kernel, numba, target):
    """A kernel as an LLVM module with one function of its name: numba's, without the ways out that it never takes."""
    pointers, names, actual = [], [], []
    for k, (code, axes) in enumerate(kernel.types):
        number = getattr(numba.types, {"b1": "boolean"}.get(code, str(np.dtype(code))))
        shape = [f"n{k}_{axis}" for axis in range(axes)]
        pointers += [numba.types.CPointer(number), *[numba.int64] * axes] if axes else [number]
        names += [f"x{k}", *shape]
        actual.append(f"carray(x{k}, ({', '.join(shape)},))" if axes else f"x{k}")
    space = {"kernel": numba.njit(error_model="numpy")(kernel.__wrapped__), "carray": numba.carray}
    exec(f"def entry({', '.join(names)}):\n    return kernel({', '.join(actual)})\n", space)
    entry = numba.cfunc(numba.int64(*pointers), error_model="numpy")(space["entry"])
    llvm = _llvm()
    ir = llvm.parse_assembly(entry.inspect_llvm())
    for function in ir.functions:
        if function.name == entry.native_name:
            function.name = kernel.__name__
        elif not function.is_declaration:
            function.linkage = "internal"
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    for _ in range(2):  # what the first round inlines is all that the error paths hang on
        builder = llvm.create_pass_builder(target, options)
        builder.getModulePassManager().run(ir, builder)
    missing = {f.name for f in ir.functions if f.is_declaration and not f.name.startswith("llvm.")} - FROM_C
    if missing:
        why = "allocates, raises or calls what is not there"
        raise ValueError(f"{kernel.__name__} {why}: {', '.join(sorted(missing))}")
    return ir
