"""Names: which a user may give, those of patches and copies, and the file names made from them."""

import re
import unicodedata

MAX_LENGTH = 200
STEM_LENGTH = 60


def complaint(name):
    """Why a name is not allowed, or None.

    >>> complaint("left wall/01"), complaint("../x")
    (None, "a part '..' is not allowed in a name")
    """
    if not isinstance(name, str) or not name.strip():
        return "the name is empty"
    if len(name) > MAX_LENGTH:
        return f"a name of {len(name)} characters; allowed: at most {MAX_LENGTH}"
    if any(unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp") for c in name):
        return "a name holds a control character, such as a line break"
    parts = re.split(r"[/\\]", name)
    if not parts[0] or re.match(r"[A-Za-z]:[/\\]", name):
        return "a name may not look like an absolute path"
    if ".." in parts or "." in parts:
        return f"a part '{'..' if '..' in parts else '.'}' is not allowed in a name"
    if any(not part.strip() for part in parts):
        return "a name has an empty part between slashes"
    return None


def canonical(name):
    """The name in one Unicode spelling (NFC), without outer blanks."""
    return unicodedata.normalize("NFC", name).strip()


def patch(name, number, total):
    """Name of patch `number` (from 1) of `total`, padded with zeros so that names sort as numbers.

    >>> patch("teapot", 3, 32), patch("duck", 3, 3)
    ('teapot/03', 'duck/3')
    """
    return f"{name}/{padded(number, total)}"


def padded(number, total):
    """A number as text, with as many digits as `total` has.

    >>> padded(3, 32)
    '03'
    """
    return f"{number:0{len(str(total))}d}"


def copy(name, number, total):
    """Name of copy `number` (from 1) of an entry that is placed `total` times; the plain name if it is placed once.

    >>> copy("chair", 2, 12), copy("chair", 1, 1)
    ('chair.02', 'chair')
    """
    return name if total == 1 else f"{name}.{padded(number, total)}"


def cleaned(name):
    """Letters a-z A-Z, digits, `_`, `.` and `-` only: safe in any file system and shell.

    >>> cleaned("Tisch mit Öl $(rm)/01"), cleaned("日本"), cleaned("-x")
    ('Tisch-mit-Ol-rm-01', 'unnamed', 'x')
    """
    ascii_only = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    text = re.sub(r"[^A-Za-z0-9_.]+", "-", ascii_only)
    return re.sub(r"\.{2,}", ".", text).strip("-._")[:STEM_LENGTH].rstrip("-._") or "unnamed"


def numbered_stems(names):
    """File stems of surfaces in their order: the index from 0 makes them differ where cleaned names do not.

    >>> numbered_stems(["Wall", "wall", "wall/01"])
    ['000-Wall', '001-wall', '002-wall-01']
    """
    width = max(3, len(str(len(names) - 1)))
    return [f"{index:0{width}d}-{cleaned(name)}" for index, name in enumerate(names)]


def add(known, name, value):
    """Put a value into a dict under a name, or `name (2)` and so on where that stands for another value: the key.

    >>> known = {"oak": 1}
    >>> add(known, "oak", 1), add(known, "oak", 2), add(known, "oak", 2), add(known, "oak", 3)
    ('oak', 'oak (2)', 'oak (2)', 'oak (3)')
    """
    key, number = name, 1
    while known.get(key, value) != value:
        number += 1
        key = f"{name} ({number})"
    known[key] = value
    return key


def is_outside(path):
    """Does a relative PurePosixPath lead out of the folder it starts in, if only on its way?"""
    depth = 0
    for part in path.parts:
        depth += -1 if part == ".." else 1
        if depth < 0:
            return True
    return False
