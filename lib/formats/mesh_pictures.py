"""Textures that a mesh file names: which of them are there."""

import re
from pathlib import Path, PurePosixPath

from lib.formats.mistakes import listed
from lib.formats.names import is_outside

LFS = b"version https://git-lfs"  # how the text begins that stands for a file where Git LFS is not installed
UNSEEN = 0.5  # reflectance of a material whose texture is not there, times the colour that multiplies the texture


class Pictures:
    """Textures beside a file: `usable(name)` or None, and in the end one sentence about those that are not."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self._faults = {}

    def usable(self, written):
        """The path of a texture relative to the folder, or None (with the reason kept for `notes`)."""
        name = written.strip().strip('"').replace("\\", "/")
        fault = self._fault(name)
        if fault:
            self._faults.setdefault(fault, {})[name] = None
        return None if fault else PurePosixPath(name).as_posix()

    def fault_of(self, name):
        """Why `usable` gave None."""
        return self._fault(name.strip().replace("\\", "/")) or "no fault"

    def fault(self, name, reason):
        """Note that a texture is not used."""
        self._faults.setdefault(reason, {})[name] = None

    def notes(self):
        """One sentence, or none."""
        parts = [f"{listed(names)} ({reason})" for reason, names in self._faults.items()]
        return [f"textures that are not used, a plain colour instead: {'; '.join(parts)}"] if parts else []

    def _fault(self, name):
        path = PurePosixPath(name)
        if not name or any(ord(c) < 32 for c in name) or len(name) > 1000:
            return "no file name"
        if path.is_absolute() or re.match(r"[A-Za-z]:", name) or "://" in name:
            return "not a path beside the file"
        if is_outside(path):
            return "outside the file's folder"
        try:
            target = self.folder / path
            if not target.is_file():
                other = _other_case(self.folder, path)
                return f"no such file, but there is {other}" if other else "no such file"
            with open(target, "rb") as file:
                return pointer(file.read(len(LFS)))
        except OSError as error:
            return str(error.strerror)


def pointer(data):
    """Why bytes are no picture: None, or that they are a Git LFS pointer.

    >>> pointer(b"version https://git-lfs.github.com/spec/v1"), pointer(b"PNG")
    ('a Git LFS pointer: fetch it with git lfs pull', None)
    """
    return "a Git LFS pointer: fetch it with git lfs pull" if data[: len(LFS)] == LFS else None


def _other_case(folder, path):
    """A file that differs from `path` in upper and lower case only, or None."""
    parent = folder / path.parent
    if not parent.is_dir():
        return None
    same = sorted(entry.name for entry in parent.iterdir() if entry.name.lower() == path.name.lower())
    return same[0] if same else None
