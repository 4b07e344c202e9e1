"""The ladder file: what is read is what was written, and nothing damaged passes."""

from dataclasses import replace

import numpy as np
import pytest

from lib.formats import mesh_ladder
from lib.formats.artefact import ArtefactError
from lib.lod.collapse import History
from lib.lod.mesh_levels import Known

# A square of two triangles whose corner 3 goes into corner 2, with it the second one, and a lone triangle that stays.
SQUARE = Known(
    np.array([0, 2]),
    History(4, np.array([[2, 3]]), np.array([[0.5, 1.0, 0.0]]), np.array([1, 0])),
    np.array([0, 1]),
    np.arange(16.0).reshape(2, 2, 4),
)
ALONE = Known(
    np.array([1]),
    History(3, np.zeros((0, 2), int), np.zeros((0, 3)), np.zeros(1, int)),
    np.array([0]),
    np.zeros((1, 1, 4)),
)


@pytest.fixture
def path(tmp_path):
    mesh_ladder.save(tmp_path / "ladder.npz", [SQUARE, ALONE])
    return tmp_path / "ladder.npz"


def test_what_is_read_is_what_was_written(path):
    for known, read in zip([SQUARE, ALONE], mesh_ladder.load(path), strict=True):
        assert read.history.n == known.history.n
        for name in ("index", "steps", "measured"):
            assert np.array_equal(getattr(read, name), getattr(known, name))
        for name in ("pair", "at", "death"):
            assert np.array_equal(getattr(read.history, name), getattr(known.history, name))
            assert getattr(read.history, name).dtype == getattr(known.history, name).dtype


def test_a_damaged_file_is_named(path):
    whole = path.read_bytes()
    at = whole.index(np.array([0.5, 1.0]).tobytes())
    for data in (whole[: len(whole) // 2], whole[:at] + b"\x01" + whole[at + 1 :], b""):
        path.write_bytes(data)
        with pytest.raises(ArtefactError, match=r"ladder\.npz: damaged .* delete it"):
            mesh_ladder.load(path)
    path.unlink()
    with pytest.raises(ArtefactError, match="missing"):
        mesh_ladder.load(path)


@pytest.mark.parametrize(
    "field, value",
    [
        ("index", np.array([2, 0])),
        ("steps", np.array([0, 2])),
        ("measured", -SQUARE.measured),
        ("measured", SQUARE.measured * np.nan),
        ("pair", np.array([[2, 4]])),
        ("pair", np.array([[2, 2]])),
        ("death", np.array([1, 2])),
        ("at", np.array([[np.inf, 0, 0]])),
    ],
)
def test_what_can_not_be_is_refused(tmp_path, field, value):
    if hasattr(SQUARE, field):
        bad = replace(SQUARE, **{field: value})
    else:
        bad = replace(SQUARE, history=replace(SQUARE.history, **{field: value}))
    with pytest.raises(ArtefactError, match=field):
        mesh_ladder.save(tmp_path / "bad.npz", [bad])
    assert not (tmp_path / "bad.npz").exists()


def test_arrays_that_do_not_fit_together_are_refused(path):
    _, arrays = mesh_ladder.artefact.read(path, mesh_ladder.KIND, mesh_ladder.VERSION)
    for name in ("pair", "measured", "death"):
        short = {**arrays, name: arrays[name][:-1]}
        mesh_ladder.artefact.write(path, mesh_ladder.KIND, mesh_ladder.VERSION, {}, short)
        with pytest.raises(ArtefactError, match=f"damaged .*{name}"):
            mesh_ladder.load(path)
