"""The lines the tree is built along, read from the sources: who imports whom, and what a file owes its reader."""

import ast
import re
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIB = sorted((ROOT / "lib").rglob("*.py"))
STAGES = sorted((ROOT / "stages").glob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))
MODULES = [path for path in LIB + STAGES if path.name != "__init__.py"]

TOPICS = ("nurbs", "surfaces", "elements", "visibility", "radiosity", "maps", "lod", "report")  # arrays in, arrays out
FREE = {"numpy", "scipy"}
OWNERS = {  # the one importer of each other library: start-up cost per job, and one place to change
    "geomdl": ("lib/nurbs/model.py",),
    "open3d": ("lib/visibility/closest.py",),
    "embreex": ("lib/visibility/tracer.py",),
    "numba": ("lib/compiled.py",),
    "llvmlite": ("lib/compiled.py",),
    "OpenImageIO": ("lib/formats/pictures.py",),
    "rhino3dm": ("lib/formats/threedm.py",),
    "pygltflib": ("lib/formats/gltf.py",),
    "jsonschema": ("lib/formats/scene_schema.py",),
    "yaml": ("lib/formats/strict_yaml.py",),
    "pythoncdt": ("lib/surfaces/trim_mesh.py",),
    "OCP": ("lib/formats/step_faces.py",),
    "fast_simplification": ("lib/lod/thinned.py",),
    "xatlas": ("lib/surfaces/charts.py",),
}
DRAWERS = {"util", "utils", "helper", "helpers", "common", "misc", "tools", "shared", "base"}
MAX_LINES = 400
AT_RUN_TIME = ("import_module", "find_spec", "__import__")


def name_of(path):
    """File as a reader of a failure wants it: relative to the root."""
    return path.relative_to(ROOT).as_posix()


def dotted(path):
    """Module name of a file: lib/maps/colour.py is lib.maps.colour."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


@cache
def parsed(path):
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imports(path):
    """Dotted names a file imports, wherever the import stands; import_module("name") and find_spec count."""
    package = path.relative_to(ROOT).parts[:-1]
    names = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*above, *filter(None, [node.module])])
            names.update({base, *(f"{base}.{alias.name}" for alias in node.names)})
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in AT_RUN_TIME:
            names.update(arg.value for arg in node.args if isinstance(arg, ast.Constant) and isinstance(arg.value, str))
    return names


def own_modules(path):
    """Modules of this tree a file imports."""
    known = {dotted(other): other for other in MODULES}
    return {known[name] for name in imports(path) if name in known}


def outside(path):
    """Libraries a file imports that are neither Python's nor ours."""
    first = {name.split(".")[0] for name in imports(path)}
    return first - set(sys.stdlib_module_names) - {"lib", "stages", "tests", "__future__", ""}


def test_there_is_something_to_hold():
    assert len(LIB) > 20 and len(STAGES) > 5


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_each_heavy_library_has_one_importer(path):
    for library in outside(path) - FREE:
        assert library in OWNERS, f"{library}: not a library of this project"
        assert name_of(path).startswith(OWNERS[library]), f"{library} is imported by {' '.join(OWNERS[library])} alone"


@pytest.mark.parametrize("path", [p for p in LIB if p.parent.name in TOPICS], ids=name_of)
def test_topics_know_nothing_of_files_and_stages(path):
    foreign = (["lib", "formats"], ["lib", "door"], ["stages"])
    assert not {name for name in imports(path) if name.split(".")[:2] in foreign or name.split(".")[:1] in foreign}


@pytest.mark.parametrize("path", LIB, ids=name_of)
def test_lib_knows_nothing_of_stages_and_the_workflow(path):
    assert not {name for name in imports(path) if name.split(".")[0] in ("stages", "snakemake", "tests")}


@pytest.mark.parametrize("path", STAGES, ids=name_of)
def test_no_stage_imports_a_stage(path):
    assert not {name for name in imports(path) if name.split(".")[0] == "stages"}


def test_topics_are_the_folders_of_lib():
    folders = {path.parent.name for path in LIB if path.parent.parent == ROOT / "lib"}
    assert folders == {*TOPICS, "formats"}


def test_no_cycles():
    """Remove modules that import none of those left, or that none of them imports: what stays are the cycles."""
    left = {path: own_modules(path) for path in MODULES}
    while ends := [p for p in left if not left[p] & left.keys() or not any(p in others for others in left.values())]:
        for path in ends:
            del left[path]
    assert not {name_of(path): sorted(map(name_of, others & left.keys())) for path, others in left.items()}


@pytest.mark.parametrize("path", [p for p in LIB + STAGES + TESTS if p.name == "__init__.py"], ids=name_of)
def test_init_files_are_empty(path):
    assert not path.read_bytes().strip()


def test_test_folders_are_no_packages():
    """Test files are found by name, so names are unique."""
    assert not [name_of(path) for path in TESTS if path.name == "__init__.py"]
    names = [path.name for path in TESTS if path.name != "conftest.py"]
    assert sorted(names) == sorted(set(names))


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_public_names_have_a_docstring(path):
    tree = parsed(path)
    assert ast.get_docstring(tree), "the module has none"
    nodes = [node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    # A stage's doors are told by its module's docstring, which is its --help.
    exempt = ("_", "main", "arguments", "body") if path in STAGES else ("_",)
    silent = [node for node in nodes if not node.name.startswith(exempt) and not ast.get_docstring(node)]
    assert not [f"{node.name}, line {node.lineno}" for node in silent]


@pytest.mark.parametrize("path", [p for p in STAGES if p.name != "__init__.py"], ids=name_of)
def test_a_stage_is_a_door(path):
    assert "main" in {node.name for node in parsed(path).body if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("path", LIB + STAGES + TESTS, ids=name_of)
def test_a_file_is_one_room(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MAX_LINES
    assert path.stem not in DRAWERS, "name the topic instead"


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_no_module_draws_random_numbers_without_a_generator(path):
    """np.random.default_rng(seed) and its types; never the global state."""
    allowed = {"default_rng", "Generator", "SeedSequence", "Philox", "PCG64"}
    used = {
        node.attr
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) in ("np.random", "numpy.random")
    }
    assert used <= allowed
    assert "random" not in imports(path)


def test_every_source_is_in_the_list_of_references():
    """`Cohen et al. 1988` in a docstring or comment is cohen1988 there, and stands there once."""
    keys = re.findall(r"^@\w+\{(\w+),", (ROOT / "lib" / "references.bib").read_text(encoding="utf-8"), re.MULTILINE)
    text = "\n".join(path.read_text(encoding="utf-8") for path in LIB)
    cited = re.findall(r"\b([A-Z][a-z]+)(?:, [A-Z][a-z]+)*(?:\s+et\s+al\.)?,?\s+((?:19|20)\d\d)\b", text)
    assert len(cited) > 15
    assert {name.lower() + year for name, year in cited} <= set(keys)
    assert len(keys) == len(set(keys))
