"""Files that stages exchange: written whole or not at all, and checked when read.

An artefact is an uncompressed .npz: a JSON header (kind, version, what the stage adds) and named arrays.  The bytes
depend on the content alone.  The zip container's CRC-32 of every member is checked on reading, and so are kind,
version and the member list.
"""

import io
import json
import os
import tempfile
import zipfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np

EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest date a zip file can hold: no clock in the bytes


class ArtefactError(Exception):
    """An intermediate file is missing, damaged, of another kind or version; the message names it."""


@contextmanager
def atomic(path):
    """Open a binary file that becomes `path` at the end of the block: unique name beside it, flushed, synced, renamed.

    Raises ArtefactError naming the path when it can not be written or the disk is full; `path` is as before then.
    """
    path = Path(path)
    name = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name[:60]}.", suffix=".part", dir=path.parent)
        os.close(handle)
        with open(name, "wb") as file:  # by name: a library that writes by itself needs file.name
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
        name = None
    except OSError as error:
        raise ArtefactError(f"{path}: can not be written: {error.strerror or error}") from error
    finally:
        if name is not None:
            Path(name).unlink(missing_ok=True)


def _umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write(path, kind, version, header, arrays):
    """Write header (JSON-able dict) and arrays (dict of numpy arrays, no objects) as artefact `kind`, `version`."""
    header = {**header, "kind": kind, "version": version, "arrays": sorted(arrays)}
    text = json.dumps(header, sort_keys=True, allow_nan=False).encode()
    with atomic(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo("header.json", EPOCH), text)
        for name in sorted(arrays):
            with archive.open(zipfile.ZipInfo(f"{name}.npy", EPOCH), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(arrays[name]), allow_pickle=False)


def read(path, kind, version):
    """Read an artefact: (header dict, dict of arrays).

    Raises ArtefactError when the file is missing, cut, damaged, or not of this kind and version.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            header = json.loads(archive.read("header.json"))
            if (header.get("kind"), header.get("version")) != (kind, version):
                found = f"{header.get('kind')} version {header.get('version')}, expected {kind} version {version}"
                raise ArtefactError(f"{path}: {found}; delete it to have it made again")
            arrays = {}
            for name in header.pop("arrays"):
                data = archive.read(f"{name}.npy")  # reading to the end checks the CRC
                arrays[name] = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except ArtefactError:
        raise
    except FileNotFoundError as error:
        raise ArtefactError(f"{path}: missing") from error
    except PermissionError as error:
        raise ArtefactError(f"{path}: can not be read: {error.strerror}") from error
    except Exception as error:  # zipfile has a dozen ways to say that it does not understand a damaged file
        raise ArtefactError(f"{path}: damaged ({error}); delete it to have it made again") from error
    return header, arrays


def check_arrays(path, x, expected):
    """Raise ArtefactError if fields of x are not the arrays of `expected`, {name: (shape, dtype)}, or not finite."""
    for name, (shape, dtype) in expected.items():
        array = getattr(x, name)
        if array.shape != shape or array.dtype != dtype:
            raise ArtefactError(f"{path}: {name}: {array.shape} {array.dtype}, expected {shape} {np.dtype(dtype).name}")
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise ArtefactError(f"{path}: {name}: NaN or Inf, expected finite numbers")


def write_json(path, value):
    """Write a JSON file atomically, keys sorted, NaN refused."""
    with atomic(path) as file:
        file.write((json.dumps(value, indent=1, sort_keys=True, allow_nan=False) + "\n").encode())


def read_json(path):
    """Read a JSON file; ArtefactError names it when it is missing or not JSON."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ArtefactError(f"{path}: missing") from error
    except PermissionError as error:
        raise ArtefactError(f"{path}: can not be read: {error.strerror}") from error
    except (OSError, ValueError) as error:
        raise ArtefactError(f"{path}: damaged ({error}); delete it to have it made again") from error
