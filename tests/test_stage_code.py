"""lib.stage_code: which files a stage depends on, on trees small enough to see through, and on the real one."""

import ast
import time
from pathlib import Path

import pytest

from lib.stage_code import import_statements, imported_modules, stage_code, stage_digests

ROOT = Path(__file__).resolve().parents[1]


def tree(folder, files):
    """Write {path: text} below folder and return the folder as str."""
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    return str(folder)


def reached(root, stage="bake"):
    return [Path(path).relative_to(root).as_posix() for path in stage_code(stage, root)]


def test_follows_every_form_of_import(tmp_path):
    root = tree(
        tmp_path,
        {
            "stages/bake.py": "import os\nimport lib.a\nfrom lib.b import (\n    x,\n)\nfrom lib import c as see\n",
            "lib/a.py": "from .sub import d\nfrom . import e\n",
            "lib/b.py": "def f():\n    from lib.sub import g, \\\n        h\n",
            "lib/c.py": "import numpy as np, lib.i\n",
            "lib/sub/d.py": "from ..j import name\n",
            **{f"lib/{name}.py": "" for name in "eij"},
            **{f"lib/sub/{name}.py": "" for name in "gh"},
            "lib/unused.py": "import lib.a\n",
            "stages/other.py": "",
        },
    )
    expected = ["lib/a.py", "lib/b.py", "lib/c.py", "lib/e.py", "lib/i.py", "lib/j.py"]
    expected += ["lib/sub/d.py", "lib/sub/g.py", "lib/sub/h.py", "stages/bake.py"]
    assert reached(root) == expected


def test_cycles_end_and_empty_packages_do_not_count(tmp_path):
    root = tree(
        tmp_path,
        {
            "stages/bake.py": "from lib.p import a\n",
            "lib/__init__.py": "",
            "lib/p/__init__.py": "SIDE_EFFECT = 1\n",
            "lib/p/a.py": "import lib.p.b\n",
            "lib/p/b.py": "import lib.p.a\n",
        },
    )
    assert reached(root) == ["lib/p/__init__.py", "lib/p/a.py", "lib/p/b.py", "stages/bake.py"]


def test_an_edited_file_is_read_anew(tmp_path):
    root = tree(tmp_path, {"stages/bake.py": "import lib.a\n", "lib/a.py": "", "lib/b.py": ""})
    assert reached(root) == ["lib/a.py", "stages/bake.py"]
    tree(tmp_path, {"stages/bake.py": "import lib.a, lib.b\n"})
    assert reached(root) == ["lib/a.py", "lib/b.py", "stages/bake.py"]


def test_data_files_a_module_mentions_count(tmp_path):
    root = tree(
        tmp_path,
        {
            "stages/bake.py": "from lib.page import viewer\n",
            "lib/page/viewer.py": "TEXT = HERE / 'page.html', HERE / \"static\" / 'a.js'  # not other.html\n",
            "lib/page/page.html": "<p>",
            "lib/page/other.html": "<p>",
            "lib/page/static/a.js": "1",
            "lib/page/static/deep/b.js": "2",
        },
    )
    expected = ["lib/page/page.html", "lib/page/static/a.js", "lib/page/static/deep/b.js"]
    assert reached(root) == [*expected, "lib/page/viewer.py", "stages/bake.py"]


def test_root_dot_gives_relative_paths(tmp_path, monkeypatch):
    tree(tmp_path, {"stages/bake.py": "import lib.a\n", "lib/a.py": ""})
    monkeypatch.chdir(tmp_path)
    assert stage_code("bake") == ["lib/a.py", "stages/bake.py"]


def test_digests_move_with_the_content_alone(tmp_path):
    files = {"stages/bake.py": "import lib.a\n", "lib/a.py": "A = 1\n", "lib/b.py": ""}
    first, second = tree(tmp_path / "here", files), tree(tmp_path / "there", files)
    found = stage_digests("bake", first)
    assert [text.split()[0] for text in found] == ["lib/a.py", "stages/bake.py"]
    assert stage_digests("bake", second) == found  # wherever the checkout lies
    tree(tmp_path / "there", {"lib/b.py": "B = 1\n"})
    assert stage_digests("bake", second) == found
    tree(tmp_path / "there", {"lib/a.py": "A = 2\n"})
    moved = stage_digests("bake", second)
    assert moved[1] == found[1] and moved[0] != found[0]


def test_unknown_stage_and_broken_source_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError):
        stage_code("bake", str(tmp_path))
    root = tree(tmp_path, {"stages/bake.py": "from lib.a import (b,\n", "lib/a.py": ""})
    with pytest.raises(SyntaxError):
        stage_code("bake", root)


def test_a_comment_with_a_bracket_is_no_trap():
    source = "from lib.a import (  # one (of two)\n    b,\n)\nimport lib.c\n"
    assert {"lib.a.b", "lib.c"} <= imported_modules(source, ("stages",))


@pytest.mark.parametrize("path", [*ROOT.glob("lib/**/*.py"), *ROOT.glob("stages/*.py")], ids=lambda path: path.name)
def test_no_import_of_the_real_tree_is_missed(path):
    """The quick cut finds at least what a parse of the whole file finds."""
    source = path.read_text(encoding="utf-8")
    whole = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert {ast.dump(node) for node in whole} <= {ast.dump(node) for node in import_statements(source)}


def test_all_stages_take_less_than_50_ms():
    stages = [path.stem for path in ROOT.glob("stages/*.py") if path.stem != "__init__"]
    best = min(_seconds(stages) for _ in range(5))
    assert best < 0.05


def _seconds(stages):
    start = time.process_time()
    for stage in stages:
        stage_code(stage, str(ROOT))
    return time.process_time() - start
