"""The source files a stage's result depends on: the stage and every module of lib that it reaches.

Snakemake re-runs a rule for an edit in its code only if the code is among its inputs. `stage_code` follows the imports
by reading the sources, so an edit re-runs the stages that reach the edited module and no others; nothing is imported.
"""

import ast
import functools
import hashlib
import os
import re

PACKAGES = ("lib", "stages")

# Import statements are cut out of the text and parsed one by one: 20 times faster than parsing whole files (measured:
# 4 against 80 ms for 4,000 lines). A docstring line that reads like an import can only add a file.
_STATEMENT = re.compile(
    r"^[ \t]*(from[ \t]+[.\w]+[ \t]+import[ \t]*(?:\([^)]*\)|(?:[^\n(\\]|\\\r?\n)+)|import[ \t]+(?:[^\n\\]|\\\r?\n)+)",
    re.MULTILINE,
)


def import_statements(source):
    """Import nodes of a Python text, inside functions too; the whole text is parsed if a cut piece does not parse."""
    try:
        nodes = [node for piece in _STATEMENT.findall(source) for node in ast.parse(piece).body]
    except SyntaxError:  # a comment with a bracket inside the brackets, say
        nodes = list(ast.walk(ast.parse(source)))
    return [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]


def imported_modules(source, package):
    """Dotted names a Python text may import: `from a.b import c` gives a.b and a.b.c.

    package : tuple of str, the package the text lies in, which relative imports start from.
    """
    names = set()
    for node in import_statements(source):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
            continue
        base = (package[: len(package) - node.level + 1] if node.level else ()) + tuple((node.module or "").split("."))
        base = ".".join(part for part in base if part)
        names.add(base)
        names.update(f"{base}.{alias.name}" for alias in node.names)
    return names


@functools.cache
def _read(root, path, stamp):
    """Text of a file and the names it imports; stamp is (mtime, size), so that an edited file is read anew."""
    with open(os.path.join(root, path), encoding="utf-8") as file:
        source = file.read()
    return source, imported_modules(source, tuple(path.split("/")[:-1]))


def listing(root):
    """{path relative to root: (mtime, size)} of every file in lib and stages, caches and hidden ones left out."""
    files, folders = {}, list(PACKAGES)
    while folders:
        folder = folders.pop()
        with os.scandir(os.path.join(root, folder)) as entries:
            for entry in entries:
                if entry.name.startswith((".", "__pycache__")):
                    continue
                if entry.is_dir():
                    folders.append(f"{folder}/{entry.name}")
                else:
                    status = entry.stat()
                    files[f"{folder}/{entry.name}"] = (status.st_mtime_ns, status.st_size)
    return files


def _data_files(path, source, data):
    """Files that are not Python, beside a module or in a folder beside it, whose name stands quoted in its source."""
    start = path.rindex("/") + 1
    for other in data:
        if other.startswith(path[:start]):
            name = other[start:].split("/")[0]  # the file, or the folder beside the module that it lies in
            if f'"{name}"' in source or f"'{name}'" in source:
                yield other


def stage_code(stage, root=".", files=None):
    """Files whose edit must re-run a stage.

    Parameters
    ----------
    stage : str
        Name of the stage, its file is stages/<stage>.py.
    root : str
        Folder of the checkout.
    files : dict
        `listing` of root, where it is at hand.

    Returns
    -------
    list of str, sorted: stages/<stage>.py, every module of lib it reaches and the data files those mention, as
    paths joined to root (relative paths for root ".").

    Raises FileNotFoundError if there is no such stage, SyntaxError if a file is not Python.
    Modules named only at run time (importlib) are not seen. `__init__.py` counts where it is not empty.
    """
    root = os.fspath(root)
    start = f"stages/{stage}.py"
    if not os.path.isfile(os.path.join(root, start)):
        raise FileNotFoundError(f"{start}: no such stage")
    files = listing(root) if files is None else files
    data = [path for path in files if not path.endswith(".py")]
    packages = {path.removesuffix("/__init__.py") for path in files if path.endswith("/__init__.py") and files[path][1]}

    reached, front = set(), {start}
    while front:
        path = front.pop()
        reached.add(path)
        if not path.endswith(".py"):
            continue
        source, names = _read(root, path, files[path])
        paths = {name.replace(".", "/") for name in names if name.startswith(PACKAGES)}
        found = {f"{name}.py" for name in paths} & files.keys()
        found |= {f"{p}/__init__.py" for p in packages if any(f"{name}/".startswith(f"{p}/") for name in paths)}
        front |= (found | set(_data_files(path, source, data))) - reached
    return sorted(path if root == "." else os.path.join(root, path) for path in reached)


def stage_digests(stage, root=".", files=None):
    """The files of `stage_code`, each as "path digest": its path below root and 12 hex digits of its SHA-256.

    As params of a rule they re-run it for an edit, and for nothing else: not for a time stamp or another place of root.
    """
    files = listing(os.fspath(root)) if files is None else files
    reached = [os.path.relpath(path, root) for path in stage_code(stage, root, files)]
    return [f"{path} {_digest(os.path.join(root, path), files[path])}" for path in reached]


@functools.cache
def _digest(path, stamp):
    """Stamp is (mtime, size), so that an edited file is read anew."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:12]
