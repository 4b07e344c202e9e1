"""Hostile and ambiguous YAML is refused quickly; plain YAML is read with its lines."""

import resource
import subprocess
import sys
import time

import pytest

from lib.formats import strict_yaml
from lib.refusal import Refusal

BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 30)
)


def refused(text):
    with pytest.raises(Refusal) as caught:
        strict_yaml.parse(text, "scene.yaml")
    return str(caught.value)


def test_plain_values_and_their_lines():
    tree = strict_yaml.parse("a: 1\nb:\n  c: [1.5, -2, .5, 1.0e-3]\n  d: 'no'\ne: true\nf: 5 mm\ng:\n", "f")
    assert tree == {"a": 1, "b": {"c": [1.5, -2, 0.5, 0.001], "d": "no"}, "e": True, "f": "5 mm", "g": None}
    assert [strict_yaml.line_at(tree, path) for path in (("a",), ("b", "c", 1), ("e",), ("missing",))] == [
        1,
        3,
        5,
        None,
    ]


@pytest.mark.parametrize(
    "written, said",
    [
        ("1e-3", "write 0.001"),
        ("1e5", "write 100000.0"),
        ("1.0e3", "write 1000.0"),
        ("010", "different number"),
        ("0x10", "different number"),
        ("0o17", "different number"),
        ("1_000", "different number"),
        ("1:30", "different number"),
        ("no", "write false"),
        ("On", "write true"),
        (".nan", "not a finite number"),
        ("-.inf", "not a finite number"),
        ("nan", "not a finite number"),
        ("1e400", "not a finite number"),
        ("1.0e+400", "not a finite number"),
        ("9" * 5000, "too long"),
        ("!!python/object/apply:os.system [ls]", "tag"),
        ("!!float 3", "tag"),
    ],
)
def test_a_value_that_readers_disagree_on_is_refused(written, said):
    message = refused(f"ok: 1\nvalue: {written}\n")
    assert message.startswith("scene.yaml: ") and said in message and message.endswith("(line 2)")


def test_words_that_only_look_odd_are_texts():
    tree = strict_yaml.parse("a: y\nb: 1 mm\nc: -x\nd: '010'\ne: .\nf: infinity_wall", "f")
    assert list(tree.values()) == ["y", "1 mm", "-x", "010", ".", "infinity_wall"]


def test_all_mistakes_are_listed_at_once_with_their_lines():
    message = refused("a: no\nb: 1\nb: 2\nc: .nan\n")
    assert [line.split("(")[-1] for line in message.splitlines()] == ["line 1)", "line 3)", "line 4)"]
    assert "key 'b' stands twice, first in line 2" in message


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "is empty"),
        ("# nothing\n", "is empty"),
        ("- a\n- b\n", "no `key: value`"),
        ("text", "no `key: value`"),
        ("a: [1, 2", "not YAML"),
        ("a:\n\tb: 1\n", "not YAML"),
        ("a: *nothing\n", "alias"),
        ("a: 1\n---\nb: 2\n", "second document"),
        ("? [x]\n: 1\n", "key is not a text"),
        ("a: " + "[" * 200_000, "nested"),
        ("a: " + "[" * 200_000 + "]" * 200_000, "nested"),
        ("{a: " * 200_000, "nested"),
        ("- " * 200_000, "nested"),
        (BOMB, "more than"),
        ("a:\n" + "- [1.0, 2.0, 3.0]\n" * 100_000, "more than"),
    ],
)
def test_files_that_are_no_settings_are_refused_at_once(text, said):
    start = time.monotonic()
    assert said in refused(text)
    assert time.monotonic() - start < 2


@pytest.mark.parametrize(
    "data, said",
    [
        ("a: 1\n".encode("utf-16"), "UTF-16"),
        ("a: 1\n".encode("utf-16-le"), "not text"),
        (b"a: \xff\xfe\n", "not UTF-8 text (line 1)"),
        (bytes(range(256)) * 100, "not text"),
        (b"a: \x01\n", "not YAML"),
        (b"a: 1\n" * (2 << 20), "larger than"),
    ],
)
def test_bytes_that_are_no_text_are_refused(tmp_path, data, said):
    (tmp_path / "scene.yaml").write_bytes(data)
    with pytest.raises(Refusal, match="scene.yaml: ") as caught:
        strict_yaml.read(tmp_path / "scene.yaml")
    assert said in str(caught.value)


def test_missing_file_and_folder_are_refused(tmp_path):
    with pytest.raises(Refusal, match="no such file"):
        strict_yaml.read(tmp_path / "scene.yaml")
    with pytest.raises(Refusal, match="not a file"):
        strict_yaml.read(tmp_path)


def test_a_byte_order_mark_of_utf8_is_no_part_of_the_first_key(tmp_path):
    (tmp_path / "a.yaml").write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert strict_yaml.read(tmp_path / "a.yaml") == {"a": 1}


def test_hostile_text_stays_below_one_gigabyte():
    code = (
        "from lib.formats import strict_yaml\n"
        f"for text in ({BOMB!r}, 'a: ' + '[' * 200000):\n"
        "    try: strict_yaml.parse(text, 'f')\n"
        "    except Exception as error: assert 'f: ' in str(error)\n"
    )
    limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))  # noqa: E731
    subprocess.run([sys.executable, "-c", code], check=True, preexec_fn=limit)
