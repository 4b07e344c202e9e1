"""scene.npz keeps every bit, has the same bytes each time, and bad scenes stop where they are made."""

from dataclasses import replace

import numpy as np
import pytest

from lib.formats import scene
from lib.formats.artefact import ArtefactError
from lib.nurbs.surface import bezier, bilinear, from_points

RNG = np.random.default_rng(5)


def two():
    wide = from_points(
        2, 1, [-1, 0, 2, 3, 7, 8, 9.5], [0, 0, 1, 1], RNG.uniform(-1, 1, (4, 2, 3)), RNG.uniform(0.5, 3, (4, 2))
    )
    return scene.Scene(
        names=["a/1", "b"],
        files=["000-a-1", "001-b"],
        surfaces=[wide, bilinear([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0])],
        front=np.full(2, -1, dtype=np.int32),
        flip=np.array([True, False]),
        role=["full", "cast_only"],
        E=np.array([[0, 0, 0], [1, 2, 3.5]]),
        group=np.array([0, 1], dtype=np.int32),
        groups=["day", "night"],
        is_black=np.array([False, True]),
        material=["oak", "lamp"],
        up="z",
        warnings=["something was skipped"],
    )


def test_what_is_saved_is_loaded(tmp_path):
    made = two()
    scene.save(tmp_path / "a.npz", made)
    scene.save(tmp_path / "b.npz", made)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    read = scene.load(tmp_path / "a.npz")
    for a, b in zip(made.surfaces, read.surfaces, strict=True):
        assert (a.degree_u, a.degree_v) == (b.degree_u, b.degree_v)
        for field in ("knots_u", "knots_v", "Pw"):
            assert np.array_equal(getattr(a, field), getattr(b, field))
    for field in ("names", "files", "role", "groups", "material", "up", "warnings"):
        assert getattr(read, field) == getattr(made, field)
    for field in ("flip", "E", "group", "is_black"):
        assert np.array_equal(getattr(read, field), getattr(made, field))


@pytest.mark.parametrize(
    "field, value",
    [
        ("names", ["b", "a/1"]),
        ("names", ["b", "b"]),
        ("files", ["x", "x"]),
        ("surfaces", [bezier(np.eye(3)[:2, None] + np.zeros((1, 2, 1)))]),
        ("role", ["full", "black"]),
        ("E", np.array([[0, 0, 0], [1, 2, -1.0]])),
        ("E", np.array([[0, 0, 0], [1, 2, np.nan]])),
        ("E", np.zeros((2, 3), dtype=np.float32)),
        ("group", np.array([0, 2], dtype=np.int32)),
        ("up", "x"),
    ],
)
def test_a_bad_field_is_named(tmp_path, field, value):
    with pytest.raises(ArtefactError, match=f"bad.npz: {field}: expected"):
        scene.save(tmp_path / "bad.npz", replace(two(), **{field: value}))
    assert not list(tmp_path.iterdir())


def test_damaged_files_are_noticed(tmp_path):
    scene.save(tmp_path / "a.npz", two())
    data = bytearray((tmp_path / "a.npz").read_bytes())
    data[data.index(two().E.tobytes())] ^= 1
    (tmp_path / "b.npz").write_bytes(data)
    (tmp_path / "c.npz").write_bytes(data[:-100])
    for name in ("b.npz", "c.npz", "none.npz"):
        with pytest.raises(ArtefactError, match=name):
            scene.load(tmp_path / name)
