"""Artefacts: bytes from the content alone, written whole or not at all, damage noticed wherever it is."""

import os
import resource
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

from lib.formats import artefact
from lib.formats.artefact import ArtefactError

HEADER = {"unit": "W/m^2", "levels": [1, 2]}
ARRAYS = {"B": np.arange(40.0).reshape(8, 5), "none": np.zeros((0, 3), np.int32), "is_hidden": np.array([True, False])}


def write(path, header=HEADER):
    artefact.write(path, "maps", 3, header, ARRAYS)
    return path


def is_whole(found):
    header, arrays = found
    same = arrays.keys() == ARRAYS.keys() and header == {**HEADER, "kind": "maps", "version": 3}
    return same and all(
        np.array_equal(arrays[name], A) and arrays[name].dtype == A.dtype and arrays[name].shape == A.shape
        for name, A in ARRAYS.items()
    )


def test_what_is_written_is_read(tmp_path):
    assert is_whole(artefact.read(write(tmp_path / "a.npz"), "maps", 3))


def test_bytes_depend_on_the_content_alone(tmp_path):
    first = write(tmp_path / "a.npz").read_bytes()
    os.utime(tmp_path / "a.npz", (0, 0))
    turned = {name: np.asfortranarray(ARRAYS[name]) for name in reversed(ARRAYS)}
    artefact.write(tmp_path / "b.npz", "maps", 3, dict(reversed(HEADER.items())), turned)
    assert (tmp_path / "b.npz").read_bytes() == first


def test_every_flipped_bit_is_noticed_or_harmless(tmp_path):
    path = write(tmp_path / "a.npz")
    whole = path.read_bytes()
    noticed = 0
    for at in range(len(whole)):
        damaged = bytearray(whole)
        damaged[at] ^= 1 << at % 8
        path.write_bytes(damaged)
        try:
            assert is_whole(artefact.read(path, "maps", 3)), at
        except ArtefactError as error:
            assert str(error).startswith(str(path))
            noticed += 1
    assert noticed > len(whole) / 2  # what the zip container keeps twice or never reads is harmless


def test_every_cut_is_noticed(tmp_path):
    path = write(tmp_path / "a.npz")
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(ArtefactError, match="damaged.*delete it"):
            artefact.read(path, "maps", 3)


@pytest.mark.parametrize("kind, version", [("maps", 2), ("maps", 4), ("trees", 3)])
def test_another_kind_or_version_is_refused(tmp_path, kind, version):
    with pytest.raises(ArtefactError, match=f"maps version 3, expected {kind} version {version}"):
        artefact.read(write(tmp_path / "a.npz"), kind, version)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ArtefactError, match="a.npz: missing"):
        artefact.read(tmp_path / "a.npz", "maps", 3)
    with pytest.raises(ArtefactError, match="a.json: missing"):
        artefact.read_json(tmp_path / "a.json")


def test_objects_are_neither_written_nor_read(tmp_path):
    with pytest.raises(ValueError):
        artefact.write(tmp_path / "a.npz", "maps", 3, {}, {"B": np.array([{}], dtype=object)})
    assert not list(tmp_path.iterdir())
    np.savez(tmp_path / "b.npz", B=np.array([{}], dtype=object))
    with pytest.raises(ArtefactError):
        artefact.read(tmp_path / "b.npz", "maps", 3)


def test_not_a_number_is_no_header(tmp_path):
    with pytest.raises(ValueError):
        write(tmp_path / "a.npz", {"seconds": float("nan")})
    with pytest.raises(ValueError):
        artefact.write_json(tmp_path / "a.json", {"seconds": float("inf")})
    assert not list(tmp_path.iterdir())


def test_a_fault_in_the_block_leaves_the_file_as_it_was(tmp_path):
    path = tmp_path / "a.json"
    artefact.write_json(path, {"x": 1})
    with pytest.raises(KeyError), artefact.atomic(path) as file:
        file.write(b"half")
        raise KeyError
    assert artefact.read_json(path) == {"x": 1} and list(tmp_path.iterdir()) == [path]


def test_a_folder_that_can_not_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ArtefactError, match="file/a.npz: can not be written: "):
        write(tmp_path / "file" / "a.npz")


def test_a_full_disk_is_named_and_leaves_nothing(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    path = write(tmp_path / "a.npz")
    whole = path.read_bytes()
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        with pytest.raises(ArtefactError, match="a.npz: can not be written: File too large"):
            write(path, {**HEADER, "new": 1})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert path.read_bytes() == whole and list(tmp_path.iterdir()) == [path]


WRITER = """
import sys, numpy as np
from lib.formats import artefact
while True:
    for value in (1.0, 2.0):
        artefact.write(sys.argv[1], "maps", 3, {}, {"B": np.full(200_000, value)})
"""


def test_writers_killed_in_the_middle_leave_one_whole_file(tmp_path):
    """Two writers of one name, killed at some moment: what stands there is of one of them."""
    path = tmp_path / "a.npz"
    writers = [subprocess.Popen([sys.executable, "-c", WRITER, path]) for _ in range(2)]
    try:
        deadline = time.monotonic() + 60
        while not path.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        for _ in range(20):
            B = artefact.read(path, "maps", 3)[1]["B"]
            assert len(B) == 200_000 and len(np.unique(B)) == 1
    finally:
        for writer in writers:
            writer.send_signal(signal.SIGKILL)
            writer.wait()
    B = artefact.read(path, "maps", 3)[1]["B"]
    assert len(B) == 200_000 and len(np.unique(B)) == 1


def test_files_get_the_rights_of_ordinary_files(tmp_path):
    mask = os.umask(0o027)
    try:
        path = write(tmp_path / "a.npz")
    finally:
        os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize(
    "field, value, said",
    [
        ("V", np.zeros((3, 2)), r"x.npz: V: \(3, 2\) float64, expected \(3, 3\) float64"),
        ("F", np.zeros((1, 3)), r"x.npz: F: \(1, 3\) float64, expected \(1, 3\) int32"),
        ("V", np.full((3, 3), np.nan), "x.npz: V: NaN or Inf"),
    ],
)
def test_arrays_that_are_not_what_is_expected_are_named(field, value, said):
    expected = {"V": ((3, 3), np.float64), "F": ((1, 3), np.int32)}
    sound = {"V": np.zeros((3, 3)), "F": np.zeros((1, 3), np.int32)}
    artefact.check_arrays("x.npz", SimpleNamespace(**sound), expected)
    with pytest.raises(ArtefactError, match=said):
        artefact.check_arrays("x.npz", SimpleNamespace(**sound | {field: value}), expected)
