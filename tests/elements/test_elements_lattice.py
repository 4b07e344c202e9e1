"""Where samples lie on a surface: roots, borders a little inside, seams and poles as copies."""

from itertools import product

import numpy as np
import pytest

from lib.elements.lattice import INSIDE, OFFSET, Lattice, receivers, roots_of
from lib.nurbs.evaluate import point
from lib.nurbs.shape import collapsed_sides, is_closed
from tests.shapes import CIRCLE, CIRCLE_KNOTS, CIRCLE_WEIGHTS, cylinder, disc, rectangle, revolved, sphere, triangle
from tests.tolerances import EXACT

SURFACES = {
    "rectangle": rectangle([1, 2, 3], [2, 0, 0], [0, 1, 0]),
    "triangle": triangle([0, 0, 0], [1, 0, 0], [0, 1, 0]),
    "disc": disc(),
    "cylinder": cylinder(),
    "sphere": sphere(),
    "cone": revolved([[1, 0], [0, 2]], [1, 1], 1, [0, 0, 1, 1]),
    "torus": revolved(np.array([2, 0]) + 0.5 * CIRCLE, CIRCLE_WEIGHTS, 2, CIRCLE_KNOTS),
}


def lattice_of(surface, roots=(1, 1)):
    return Lattice(roots, is_closed(surface), tuple(collapsed_sides(surface)))


def everywhere(lattice, level):
    return (a.ravel() for a in np.indices(lattice.shape(level)))


@pytest.mark.parametrize(
    "extent, roots",
    [
        ((1, 1), (1, 1)),
        ((6, 5), (1, 1)),
        ((3, 2), (2, 1)),
        ((2, 7), (1, 4)),
        ((100, 1), (8, 1)),
        ((1, 1e9), (1, 8)),
        ((0, 1), (1, 8)),
        ((1, 0), (8, 1)),
        ((1e-6, 3e-6), (1, 3)),
    ],
)
def test_roots_follow_the_aspect_ratio(extent, roots):
    assert roots_of(extent) == roots


def test_shapes():
    lattice = Lattice((3, 1))
    assert lattice.shape(0) == (2, 4) and lattice.cells(0) == (1, 3)
    assert lattice.shape(3) == (9, 25) and lattice.cells(3) == (8, 24)


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
@pytest.mark.parametrize("roots", [(1, 1), (3, 1), (1, 2)])
def test_copies_are_the_same_point(surface, roots):
    lattice = lattice_of(surface, roots)
    h, w = lattice.shape(2)
    j, i = everywhere(lattice, 2)
    S = point(surface, i / (w - 1), j / (h - 1)).reshape(h, w, 3)
    copied = np.where(lattice.is_own(2)[..., None], S, np.nan)
    assert np.abs(lattice.copy_own(copied) - S).max() < 1e-9


@pytest.mark.parametrize(
    "closed, collapsed", list(product(product([False, True], repeat=2), product([False, True], repeat=4)))
)
def test_every_crossing_is_its_own_sample_or_a_copy_of_one(closed, collapsed):
    lattice = Lattice((2, 1), closed, collapsed)
    own = lattice.is_own(2)
    number = np.where(own, np.arange(own.size).reshape(own.shape), -1)
    copied = lattice.copy_own(number.copy())
    assert (copied >= 0).all()
    assert (copied[own] == number[own]).all()
    assert set(np.unique(copied)) == set(number[own])
    if closed[0]:
        assert (copied[:, 0] == copied[:, -1]).all()
    if closed[1]:
        assert (copied[0] == copied[-1]).all()
    for side, line in zip(collapsed, (copied[:, 0], copied[:, -1], copied[0], copied[-1]), strict=True):
        assert not side or len(set(line)) == 1


def test_what_is_copied():
    """A sphere at level 1: the seam's last column and all of both polar rows but their first."""
    own = Lattice((2, 1), (True, False), (False, False, True, True)).is_own(1)
    assert own.astype(int).tolist() == [[1, 0, 0, 0, 0], [1, 1, 1, 1, 0], [1, 0, 0, 0, 0]]


def test_border_samples_are_looked_at_from_inside():
    surface = SURFACES["rectangle"]  # origin 1 2 3, 2 along x, 1 along y
    lattice = lattice_of(surface, (2, 1))
    j, i = everywhere(lattice, 1)
    x, N = receivers(surface, False, 0.25, lattice, 1, j, i)
    assert np.abs(N - [0, 0, 1]).max() < EXACT
    u, v = np.clip(i / 4, INSIDE, 1 - INSIDE), np.clip(j / 2, INSIDE, 1 - INSIDE)
    expected = np.stack([1 + 2 * u, 2 + v, np.full(len(u), 3 + 0.25 + OFFSET)], axis=1)
    assert np.abs(x - expected).max() < EXACT


def test_flipped_surfaces_look_the_other_way():
    surface = SURFACES["rectangle"]
    x, N = receivers(surface, True, 0.0, lattice_of(surface), 1, np.array([1]), np.array([1]))
    assert np.abs(N - [0, 0, -1]).max() < EXACT
    assert np.abs(x - [2, 2.5, 3 - OFFSET]).max() < EXACT


def test_seams_are_not_moved_and_poles_look_along_the_axis():
    surface = SURFACES["sphere"]
    lattice = lattice_of(surface)
    j, i = np.array([0, 2, 4, 2]), np.array([0, 0, 0, 4])
    x, N = receivers(surface, False, 0.01, lattice, 2, j, i)
    expected = np.array([[0, 0, -1], [1, 0, 0], [0, 0, 1], [1, 0, 0]])
    assert np.abs(N - expected).max() < 1e-9
    assert np.abs(x - expected * (1 + 0.01 + OFFSET)).max() < 1e-9


def test_tip_of_a_cone_looks_along_its_axis():
    x, N = receivers(SURFACES["cone"], False, 0.0, lattice_of(SURFACES["cone"]), 1, np.array([2]), np.array([0]))
    assert np.abs(N - [0, 0, 1]).max() < 1e-6
    assert np.abs(x - [0, 0, 2 + OFFSET]).max() < 1e-6


def test_corner_of_a_triangle_is_seen_from_the_middle_of_its_side():
    """Corner C = (0, 1, 0) at v = 1; a little inside lies above the middle of AB."""
    surface = SURFACES["triangle"]
    x, N = receivers(surface, False, 0.0, lattice_of(surface), 1, np.array([2, 2]), np.array([0, 2]))
    assert np.abs(x - [0.5 * INSIDE, 1 - INSIDE, OFFSET]).max() < EXACT
    assert np.abs(N - [0, 0, 1]).max() < 1e-9


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
def test_few_samples_and_the_whole_lattice_agree(surface):
    """The whole lattice is evaluated as a grid, a few samples one by one; chunks and re-runs must not see which."""
    lattice = lattice_of(surface, (2, 1))
    j, i = everywhere(lattice, 3)
    whole = receivers(surface, False, 0.001, lattice, 3, j, i)
    for k in (0, 5, len(j) // 2, len(j) - 1):
        few = receivers(surface, False, 0.001, lattice, 3, j[k : k + 1], i[k : k + 1])
        for a, b in zip(whole, few, strict=True):
            assert np.abs(a[k] - b[0]).max() < 1e-9


def test_no_samples():
    none = np.zeros(0, dtype=int)
    x, N = receivers(SURFACES["sphere"], False, 0.0, lattice_of(SURFACES["sphere"]), 2, none, none)
    assert x.shape == N.shape == (0, 3)
