"""Radiosity maps: rho times direct light and that of the elements, on the lattice of the direct tree."""

from types import SimpleNamespace

import numpy as np
import pytest

from lib.elements.lattice import Lattice
from lib.elements.quadtree import Quadtree
from lib.radiosity.radiosity_maps import offsets, on_lattice, radiosity_maps
from tests.tolerances import FLOAT32

OPEN = (False, False)


def tree(lattice, value, hidden=()):
    """A Quadtree at its base, level 1: value (h, w, C), hidden crossings (j, i)."""
    out = Quadtree(lattice, 1, value.shape[2])
    at = out.wanted()
    mask = np.zeros(value.shape[:2], dtype=bool)
    for place in hidden:
        mask[place] = True
    out.put(at, value[at], mask[at], 0.0, np.inf)
    return out


def world(lattices, reflects):
    return SimpleNamespace(lattices=lattices, reflects=np.array(reflects), n_groups=2)


def solution(grids, H, rho):
    """Elements of surfaces with grids [(n_u, n_v)]; H (elements, 2, 3), rho (surfaces, 3)."""
    n_u, n_v = np.array(grids).T
    n = len(H)
    return SimpleNamespace(
        n_u=n_u,
        n_v=n_v,
        first=np.concatenate([[0], np.cumsum(n_u * n_v)]),
        H_indirect=H.astype(np.float32),
        is_hidden=np.zeros((n, 16), dtype=bool),
        is_alone=np.zeros(n, dtype=bool),
        rho=np.array(rho, dtype=float),
    )


def test_direct_light_and_that_of_elements_are_added_and_reflected():
    """Two surfaces of even light, one without a map between them; a hidden crossing has no weight."""
    lattices = [Lattice((1, 1)), Lattice((1, 1)), Lattice((2, 1))]
    grids, rho = [(2, 2), (0, 0), (1, 2)], [[0.5, 0.25, 1], [1, 1, 1], [0.1, 0.2, 0.3]]
    H = np.arange(1, 7.0).reshape(1, 2, 3) * np.repeat([1, 10], [4, 2])[:, None, None]
    direct = {
        2: tree(lattices[2], np.full((3, 5, 6), 4.0, np.float32)),
        0: tree(lattices[0], np.tile(np.arange(6, dtype=np.float32), (3, 3, 1)), hidden=[(0, 2)]),
        1: tree(lattices[1], np.ones((3, 3, 6), np.float32)),
    }
    x = radiosity_maps(world(lattices, [True, True, True]), direct, solution(grids, H, rho))
    assert x.surface.tolist() == [0, 2] and x.shape.tolist() == [[3, 3], [3, 5]]
    assert offsets(x.shape).tolist() == [0, 9, 24]
    channels = [0, 1, 2, 4, 5, 6]
    first = np.tile(rho[0], 2)
    assert x.direct[0, channels] == pytest.approx(first * np.arange(6), abs=FLOAT32)
    assert x.value[0, channels] == pytest.approx(first * (np.arange(6) + np.arange(1, 7)), rel=FLOAT32)
    assert x.value[9, channels] == pytest.approx(np.tile(rho[2], 2) * (4 + 10 * np.arange(1, 7)), rel=FLOAT32)
    assert not x.value[2].any() and not x.direct[2].any()  # row 0, column 2
    weights = np.delete(x.value[:, [3, 7]], 2, axis=0)
    assert (weights == 1).all() and (x.direct[:, [3, 7]] == x.value[:, [3, 7]]).all()


def test_what_reflects_nothing_has_no_map():
    lattices = [Lattice((1, 1))]
    direct = {0: tree(lattices[0], np.ones((3, 3, 6), np.float32))}
    x = radiosity_maps(world(lattices, [False]), direct, solution([(2, 2)], np.ones((4, 2, 3)), [[1, 1, 1]]))
    assert len(x.surface) == 0 and x.shape.shape == (0, 2) and x.value.shape == x.direct.shape == (0, 8)


def test_elements_alone_keep_their_own_light():
    """Of two elements side by side one is alone: a step between them instead of a ramp, and 0 at its hidden points."""
    H = np.array([1.0, 3.0]).reshape(2, 1, 1) * np.ones(3)
    hidden, alone = np.zeros((2, 16), dtype=bool), np.array([False, False])
    ramp = on_lattice(H, hidden, alone, (2, 1), (2, 9), OPEN)[0, :, 0, 0]
    assert ramp == pytest.approx(np.clip(1 + 2 * (np.linspace(0, 1, 9) * 2 - 0.5), 1, 3))
    alone[1], hidden[1, [3, 7, 11, 15]] = True, True  # the points along its right side
    step = on_lattice(H, hidden, alone, (2, 1), (2, 9), OPEN)[0, :, 0, 0]
    assert step.tolist() == [1, 1, 1, 1, 3, 3, 3, 0, 0]
