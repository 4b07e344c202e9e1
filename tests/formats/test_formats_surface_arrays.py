"""Surfaces in flat arrays: of every kind, each made alone and as it was."""

import dataclasses

import numpy as np
import pytest

from lib.formats import surface_arrays
from lib.nurbs.surface import bilinear
from lib.surfaces.mesh import Mesh
from lib.surfaces.trimmed import TrimmedSurface
from tests.rooms import cube_mesh
from tests.shapes import cylinder

RNG = np.random.default_rng(8)


def trimmed(loops):
    """A square with loops of so many points, that need not be loops here."""
    k = sum(loops)
    start = np.concatenate([[0], np.cumsum(loops)])
    square = bilinear([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0])
    return TrimmedSurface(square, RNG.random(4), RNG.random((k, 2)), start, RNG.random((k, 3)), RNG.random(k))


def mixed():
    """(surfaces, front): every kind twice, other kinds between; the third is the back of the sixth."""
    atlas = cube_mesh()
    bare = dataclasses.replace(atlas, uv=None, chart=None, level=None)
    with_T = dataclasses.replace(atlas, T=RNG.random((len(atlas.F), 3, 2)))
    tube = cylinder(0.1, 0.3)
    surfaces = [trimmed([3, 4]), bare, tube, with_T, cylinder(1, 2), tube, trimmed([5]), atlas]
    return surfaces, np.array([-1, -1, 5, -1, -1, -1, -1, -1])


def assert_same(a, b):
    assert type(a) is type(b)
    for field in dataclasses.fields(a):
        one, other = getattr(a, field.name), getattr(b, field.name)
        if dataclasses.is_dataclass(one):
            assert_same(one, other)
        else:
            assert (one is None and other is None) or np.array_equal(one, other), field.name


def test_each_is_made_alone_and_as_it_was():
    surfaces, front = mixed()
    for order in (range(8), reversed(range(8)), [3], [6], [2]):
        read = surface_arrays.Surfaces(surface_arrays.packed(surfaces, front), front)
        assert len(read) == 8
        for s in order:
            assert_same(surfaces[s], read[s])
    assert read[2] is read[5]
    assert [type(surface) for surface in read] == [type(surface) for surface in surfaces]
    with pytest.raises(IndexError):
        read[8]


def test_only_what_is_asked_for_is_made(monkeypatch):
    surfaces, front = mixed()
    arrays, made = surface_arrays.packed(surfaces, front), []
    monkeypatch.setattr(surface_arrays, "Mesh", lambda *args: made.append(args) or Mesh(*args))
    read = surface_arrays.Surfaces(arrays, front)
    assert not made
    assert read[7] is read[7] and len(made) == 1


@pytest.mark.parametrize("name", ["degree", "size", "knots", "Pw", "trim_size", "loop_size", "trim_uv", "mesh_T"])
def test_arrays_that_do_not_fit_their_sizes_are_refused(name):
    surfaces, front = mixed()
    arrays = surface_arrays.packed(surfaces, front)
    with pytest.raises(ValueError, match="than|broadcast"):
        surface_arrays.Surfaces({**arrays, name: arrays[name][:-1]}, front)


def test_a_kind_that_is_none_is_refused():
    surfaces, front = mixed()
    arrays = surface_arrays.packed(surfaces, front)
    for kind in (arrays["kind"][:-1], np.full(8, 4, np.int8), np.full(8, surface_arrays.MESH, np.int8)):
        with pytest.raises(ValueError, match="kind"):
            surface_arrays.Surfaces({**arrays, "kind": kind}, front)
