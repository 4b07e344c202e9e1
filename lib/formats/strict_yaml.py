"""YAML read strictly: plain mappings, lists, texts, numbers and true/false, each with its line.

Values that YAML 1.1 and 1.2 read differently (`1e-3`, `010`, `no`) are refused with the unambiguous spelling, as are
duplicate keys, tags, NaN and infinity.  The tree is built from parser events without recursion, so that nested brackets
and alias bombs end after a bounded amount of work.  The one importer of yaml.
"""

import os
import re

import yaml

from lib.formats.mistakes import Mistakes, shown
from lib.refusal import refusal

MAX_BYTES = 8 << 20
MAX_NODES = 50_000  # mappings, lists and scalars, counted after aliases are expanded
MAX_DEPTH = 24
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INT = re.compile(r"[-+]?(0|[1-9][0-9]*)")
_FLOAT = re.compile(r"[-+]?([1-9][0-9]*|0)?\.[0-9]*([eE][-+][0-9]+)?|[-+]?(0|[1-9][0-9]*)\.")
_NUMBER_12 = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_OTHER_BASE = re.compile(
    r"[-+]?(0[xX][0-9a-fA-F_]+|0o?[0-7_]+|0b[01_]+|[0-9][0-9_]*(\.[0-9_]*)?|[0-9]+(:[0-5]?[0-9])+(\.[0-9_]*)?)"
)
_NOT_FINITE = re.compile(r"[-+]?\.?(inf|nan)", re.IGNORECASE)
_YES_NO = {"yes": "true", "on": "true", "no": "false", "off": "false"}


class Map(dict):
    """A mapping that knows the line of each of its keys: `lines[key]`."""

    def __init__(self, *args):
        super().__init__(*args)
        self.lines = {}


class Seq(list):
    """A list that knows the line of each of its items: `lines[index]`."""

    def __init__(self, *args):
        super().__init__(*args)
        self.lines = []


def line_at(tree, path):
    """Line of the node at `path` (keys and indices), or of the nearest node above it; None if there is none."""
    line = None
    for step in path:
        try:
            line = tree.lines[step]
            tree = tree[step]
        except (AttributeError, KeyError, IndexError, TypeError):
            break
    return line


def scalar(text):
    """The value of a plain scalar, and a complaint where it has none that all readers agree on.

    >>> scalar("1.5"), scalar("-3"), scalar("true"), scalar("oak"), scalar("~")
    ((1.5, None), (-3, None), (True, None), ('oak', None), (None, None))
    >>> scalar("1e-3")[1]
    "'1e-3' is a number to some YAML readers and text to others; write 0.001"
    """
    if text in ("", "~", "null", "Null", "NULL"):
        return None, None
    if text in ("true", "True", "TRUE", "false", "False", "FALSE"):
        return text.lower() == "true", None
    if text.lower() in _YES_NO:
        fix = _YES_NO[text.lower()]
        return text, f'{shown(text)} is {fix} to some YAML readers and text to others; write {fix}, or "{text}" quoted'
    if _NOT_FINITE.fullmatch(text):
        return text, f"{shown(text)} is not a finite number"
    if text[0] not in "+-.0123456789":
        return text, None
    if len(text) > 60 and (_NUMBER_12.fullmatch(text) or _OTHER_BASE.fullmatch(text)):
        return text, f"{shown(text, 20)} is too long for a number"
    if _INT.fullmatch(text):
        return int(text), None
    if _FLOAT.fullmatch(text) and any(c.isdigit() for c in text):
        value = float(text)
        return (value, None) if abs(value) < float("inf") else (text, f"{shown(text)} is not a finite number")
    if _NUMBER_12.fullmatch(text) and not re.fullmatch(r"[-+]?0[0-9]+", text):
        if abs(float(text)) == float("inf"):
            return text, f"{shown(text)} is not a finite number"
        return (
            text,
            f"{shown(text)} is a number to some YAML readers and text to others; write {_plain(text)}",
        )
    if _OTHER_BASE.fullmatch(text):
        return (
            text,
            f"{shown(text)} is a different number to different YAML readers; write a plain decimal",
        )
    return text, None


def _plain(text):
    """The number in a spelling that all readers agree on: 1e-07 becomes 1.0e-07."""
    number = repr(float(text))
    return number if "." in number or "e" not in number else number.replace("e", ".0e")


def read(path, shown_as=None):
    """Read a YAML file into a Map.  `shown_as` names the file in messages (default: `path`).

    Raises Refusal for a file that is missing, too large, empty, not UTF-8 text or not YAML, and, all at once, for the
    faults named above.
    """
    name = shown_as or str(path)
    return parse(_text(path, name), name)


def _text(path, name):
    try:
        if os.path.exists(path) and not os.path.isfile(path):
            raise refusal("is not a file", file=name)
        with open(path, "rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise refusal("no such file", file=name) from None
    except OSError as error:
        raise refusal(f"cannot be read: {error.strerror}", file=name) from None
    if len(data) > MAX_BYTES:
        raise refusal(f"larger than {MAX_BYTES >> 20} MiB; put large geometry in a file of its own", file=name)
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise refusal("is UTF-16 text; save it as UTF-8", file=name)
    if b"\0" in data:
        raise refusal("is not text (it holds zero bytes); a YAML file in UTF-8 is wanted", file=name)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise refusal(f"is not UTF-8 text (line {line}); save it as UTF-8", file=name) from None


def parse(text, name):
    """Read YAML text into a Map; see `read`."""
    mistakes = Mistakes()
    try:
        value = _Builder(name, mistakes).build(yaml.parse(text, Loader=_LOADER))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        what = getattr(error, "problem", None) or "holds characters that YAML does not allow"
        mistakes.add(f"is not YAML: {what}", file=name, line=mark.line + 1 if mark else None)
        mistakes.stop()
    mistakes.stop()
    if value is None:
        raise refusal("is empty", file=name)
    if not isinstance(value, Map):
        raise refusal("holds no `key: value` lines", file=name)
    return value


class _Builder:
    """Builds the tree from events; `open` is the stack of unfinished collections, so depth costs no recursion."""

    def __init__(self, name, mistakes):
        self.name, self.mistakes = name, mistakes
        self.anchors = {}  # name -> (value, nodes in it)
        self.open = []  # [collection, key waiting for its value, nodes inside, anchor, line]
        self.root, self.nodes, self.documents = None, 0, 0

    def build(self, events):
        for event in events:
            line = event.start_mark.line + 1
            if isinstance(event, yaml.DocumentStartEvent):
                self.documents += 1
                if self.documents > 1:
                    raise self.fault("a second document begins; one is wanted", line)
            elif isinstance(event, yaml.AliasEvent):
                if event.anchor not in self.anchors:
                    raise self.fault(f"alias *{event.anchor} names nothing above it", line)
                self.place(*self.anchors[event.anchor], line)
            elif isinstance(event, yaml.ScalarEvent):
                self.scalar(event, line)
            elif isinstance(event, (yaml.MappingStartEvent, yaml.SequenceStartEvent)):
                self.check_tag(event, line)
                if len(self.open) >= MAX_DEPTH:
                    raise self.fault(f"nested more than {MAX_DEPTH} deep", line)
                collection = Map() if isinstance(event, yaml.MappingStartEvent) else Seq()
                self.open.append([collection, None, 1, event.anchor, line])
            elif isinstance(event, (yaml.MappingEndEvent, yaml.SequenceEndEvent)):
                collection, _, nodes, anchor, start = self.open.pop()
                if anchor:
                    self.anchors[anchor] = (collection, nodes)
                self.place(collection, nodes, start)
        return self.root

    def fault(self, what, line):
        return refusal(f"{what} (line {line})", file=self.name)

    def check_tag(self, event, line):
        if event.tag is not None:
            self.mistakes.add(f"tag {shown(event.tag)} is not read; remove it", file=self.name, line=line)

    def scalar(self, event, line):
        self.check_tag(event, line)
        is_key = self.open and isinstance(self.open[-1][0], Map) and self.open[-1][1] is None
        if event.style or is_key:
            value, complaint = event.value, None
        else:
            value, complaint = scalar(event.value)
        if complaint:
            self.mistakes.add(complaint, file=self.name, line=line)
        if event.anchor:
            self.anchors[event.anchor] = (value, 1)
        self.place(value, 1, line)

    def place(self, value, nodes, line):
        """Put a finished value where it belongs: the root, a list's next item, a mapping's next key or its value."""
        self.nodes += 1
        if not self.open:
            self.root = value
            return
        top = self.open[-1]
        top[2] += nodes
        if top[2] > MAX_NODES or self.nodes > MAX_NODES:
            raise self.fault(
                f"more than {MAX_NODES} values (aliases counted each time); put large geometry in a file of its own",
                line,
            )
        collection = top[0]
        if isinstance(collection, Seq):
            collection.append(value)
            collection.lines.append(line)
        elif top[1] is None:
            if not isinstance(value, str):
                raise self.fault("a key is not a text", line)
            if value in collection.lines:
                first = collection.lines[value]
                self.mistakes.add(f"key {shown(value)} stands twice, first in line {first}", self.name, line=line)
            top[1] = (value,)
            collection.lines[value] = line
        else:
            collection[top[1][0]] = value
            top[1] = None
