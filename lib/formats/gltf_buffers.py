"""The container of a glTF file: its JSON, its buffers, and accessors as arrays.

Read are .glb (version 2), .gltf with files beside it, and data URIs.  Every length is checked against the bytes that
are there before anything is made of it.  Source: Khronos, glTF 2.0 specification, sections 3.6, 4.4 and 5.1.
"""

import base64
import binascii
import json
import struct
from urllib.parse import unquote

import numpy as np

from lib.formats.mesh_pictures import Pictures, pointer

TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
MAX_COUNT = 20_000_000
MAX_FILE = 512 << 20


class Broken(Exception):
    """A glTF file that can not be read: what is wrong with it."""


class Container:
    """The JSON of a glTF file (`json`, a dict) and what it points to."""

    def __init__(self, data, folder):
        self.folder = folder
        self.files = Pictures(folder)
        text, self._binary = _chunks(data)
        self.json = _parsed(text)
        self._buffers = {}

    def items(self, key):
        """The list under a key of the JSON, empty if there is none; each item is a dict."""
        return dicts(self.json.get(key, []), key)

    def item(self, key, index):
        """Item `index` of a list of the JSON; Broken if there is none."""
        found = self.items(key)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(found):
            raise Broken(f"{key}[{str(index)[:20]}] is not there; there are {len(found)}")
        return found[index]

    def view(self, index):
        """The bytes of a buffer view."""
        view = self.item("bufferViews", index)
        data = self._buffer(whole(view, "buffer", None))
        start, length = whole(view, "byteOffset", 0), whole(view, "byteLength", None)
        if start + length > len(data):
            raise Broken(f"bufferViews[{index}] ends at byte {start + length} of a buffer of {len(data)}: is cut off?")
        return data[start : start + length]

    def accessor(self, index, width=None):
        """An accessor as an array (count, width) float64, normalised integers as such; or (count,) of integers as they
        are for width 0.
        """
        accessor = self.item("accessors", index)
        count, kind = whole(accessor, "count", None), accessor.get("componentType")
        columns = WIDTHS.get(accessor.get("type"))
        if kind not in TYPES or columns is None or count > MAX_COUNT or columns != (width or 1):
            raise Broken(f"accessors[{index}]: {accessor.get('type')} of type {kind}, count {count}: not expected here")
        dtype = np.dtype(TYPES[kind])
        if "bufferView" in accessor:
            found = self._strided(accessor, dtype, count, columns, index)
        else:
            found = np.zeros((count, columns), dtype=dtype)
        if "sparse" in accessor:
            found = self._sparse(found, accessor["sparse"], dtype, columns, index)
        if width == 0:
            if dtype.kind != "u":
                raise Broken(f"accessors[{index}]: indices of type {kind}; expected whole numbers from 0 on")
            return found[:, 0].astype(np.int64)
        found = found.astype(np.float64)
        if dtype.kind in "ui" and accessor.get("normalized"):
            found = np.maximum(found / np.iinfo(dtype).max, -1.0)
        return found

    def _strided(self, accessor, dtype, count, columns, index):
        view = self.item("bufferViews", accessor["bufferView"])
        data, start = self.view(accessor["bufferView"]), whole(accessor, "byteOffset", 0)
        tight = dtype.itemsize * columns
        stride = whole(view, "byteStride", tight) or tight
        if stride < tight or (count and start + stride * (count - 1) + tight > len(data)):
            raise Broken(f"accessors[{index}] reaches beyond its bufferView of {len(data)} bytes: is cut off?")
        strides = (stride, dtype.itemsize)
        return np.ndarray((count, columns), dtype, data, start, strides) if count else np.zeros((0, columns), dtype)

    def _sparse(self, found, sparse, dtype, columns, index):
        n = whole(sparse, "count", None)
        places, values = sparse.get("indices"), sparse.get("values")
        if n > len(found) or not isinstance(places, dict) or not isinstance(values, dict):
            raise Broken(f"accessors[{index}]: its sparse part is not as expected")
        kind = TYPES.get(places.get("componentType"), "f4")
        at = self._strided(places, np.dtype(kind), n, 1, index)[:, 0].astype(np.int64)
        if kind not in ("u1", "<u2", "<u4") or (n and at.max() >= len(found)):
            raise Broken(f"accessors[{index}]: a sparse index is outside 0 to {len(found) - 1}")
        found = found.copy()
        found[at] = self._strided(values, dtype, n, columns, index)
        return found

    def _buffer(self, index):
        if index not in self._buffers:
            buffer = self.item("buffers", index)
            length = whole(buffer, "byteLength", None)
            data = self._bytes(buffer, index)
            if len(data) < length:
                raise Broken(f"buffers[{index}] holds {len(data)} bytes of {length}: is cut off")
            self._buffers[index] = memoryview(data)[:length]
        return self._buffers[index]

    def _bytes(self, buffer, index):
        uri = buffer.get("uri")
        if uri is None:
            if index or self._binary is None:
                raise Broken(f"buffers[{index}] has no bytes")
            return self._binary
        if not isinstance(uri, str):
            raise Broken(f"buffers[{index}]: its uri is not text")
        if uri.startswith("data:"):
            return data_uri(uri)
        name = unquote(uri)
        path = self.files.usable(name)
        if path is None:
            raise Broken(f"its buffer '{name[:80]}' can not be read ({self.files.fault_of(name)})")
        target = self.folder / path
        size = target.stat().st_size
        if size > MAX_FILE:
            raise Broken(f"its buffer '{name[:80]}' has {size >> 20} MiB; allowed: at most {MAX_FILE >> 20} MiB")
        data = target.read_bytes()
        if pointer(data):
            raise Broken(f"its buffer '{name[:80]}' is {pointer(data)}")
        return data


def dicts(value, what):
    """A value that has to be a list of objects, else Broken."""
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise Broken(f"{what} is not a list of objects")
    return value


def whole(item, key, default):
    """A whole number from 0 on under a key, else Broken; `default` if the key is not there and it is not None."""
    value = item.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 53:
        raise Broken(f"{key}: expected a whole number from 0 on, found {str(value)[:30]}")
    return value


def numbers(item, key, count, default):
    """A list of finite numbers under a key, as float64, else Broken; `default` if the key is not there."""
    value = item.get(key, default)
    good = isinstance(value, list | tuple) and len(value) == count
    if not good or not all(isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < 1e30 for x in value):
        raise Broken(f"{key}: expected {count} finite numbers, found {str(value)[:40]}")
    return np.array(value, dtype=np.float64)


def data_uri(uri):
    """The bytes of a data URI.

    >>> data_uri("data:;base64,AAE=")
    b'\\x00\\x01'
    """
    head, comma, body = uri.partition(",")
    if not comma or not head.endswith(";base64"):
        raise Broken("a data URI is not in base64")
    try:
        return base64.b64decode(unquote(body), validate=True)
    except (binascii.Error, ValueError):
        raise Broken("a data URI is not in base64") from None


def _chunks(data):
    """JSON text and binary chunk (or None) of a file."""
    if data[:4] != b"glTF":
        return data, None
    if len(data) < 20:
        raise Broken("is cut off in its header")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise Broken(f"is of version {version}; only version 2 is read")
    if length > len(data):
        raise Broken(f"is cut off: {len(data)} bytes of {length}")
    found, at = {}, 12
    while at + 8 <= length and len(found) < 2:
        size, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + size > length:
            raise Broken("is cut off inside a chunk")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in found:
        raise Broken("has no JSON chunk")
    return found[b"JSON"], found.get(b"BIN\0")


def _parsed(text):
    def constant(word):
        raise Broken(f"{word} is not a finite number")

    try:
        content = json.loads(text.decode("utf-8-sig"), parse_constant=constant)
    except (RecursionError, ValueError):
        raise Broken("is not JSON, or nested too deep") from None
    asset = content.get("asset") if isinstance(content, dict) else None
    if not isinstance(asset, dict) or not str(asset.get("version", "")).startswith("2."):
        raise Broken("is no glTF 2 file: no asset.version 2.x")
    return content
