"""Less effort on meshes: fewer rays there, nothing changed elsewhere, and light that stays right where it is even."""

import numpy as np
import pytest

from lib.radiosity.refine import efforts, full, refine_direct
from lib.radiosity.sampling import base_lattice
from tests.rooms import cube_mesh, world_of
from tests.shapes import rectangle

LAMP, ROOM, TABLE = 0, 1, 2
FIRST, MOST = 16, 64


@pytest.fixture(scope="module")
def world():
    """A room that is one mesh, a table in it that is none, and a lamp above it; by name in this order."""
    return world_of(
        {
            "lamp": (rectangle([0.4, 0.4, 0.9], [0, 0.2, 0], [0.2, 0, 0]), {"E": 10.0, "is_black": True}),
            "room": (cube_mesh(), {}),
            "table": (rectangle([0.3, 0.3, 0.4], [0.4, 0, 0], [0, 0.4, 0]), {}),
        }
    )


def refined(world, effort, tau=0.05):
    """Direct trees of room and table, and the rays they took."""
    mine = [ROOM, TABLE]
    base, _ = base_lattice(world, mine, 1, 3, (FIRST, MOST))
    before = world.tracer.rays
    trees, _ = refine_direct(world, base, 1, dict.fromkeys(mine, tau), 5, (FIRST, MOST), effort=effort)
    return trees, world.tracer.rays - before


def test_only_meshes_are_worth_less_and_not_where_a_finer_tolerance_is_asked(world):
    assert efforts(world, range(3), np.ones(3), 0.5).share.tolist() == [1, 0.5, 1]
    assert efforts(world, range(3), np.array([1, 2.0, 2]), 0.5).share.tolist() == [1, 0.5, 1]
    assert efforts(world, range(3), np.array([1, 0.5, 0.5]), 0.5).share.tolist() == [1, 1, 1]
    assert efforts(world, range(3), np.ones(3), 1.0).share.tolist() == [1, 1, 1]
    assert efforts(world, range(3), np.ones(3), 0.5, 2).coarser.tolist() == [0, 2, 0]
    assert efforts(world, range(3), np.array([1, 0.5, 1]), 0.5, 2).coarser.tolist() == [0, 0, 0]


def test_less_effort_takes_half_the_rays_on_the_mesh_and_changes_nothing_else(world):
    usual, all_rays = refined(world, None)
    less, rays = refined(world, efforts(world, range(3), np.ones(3), 0.5))
    assert rays < 0.7 * all_rays
    for field in ("value", "known", "hidden", "noise"):
        assert getattr(less[TABLE], field).tobytes() == getattr(usual[TABLE], field).tobytes(), field
    a, b = usual[ROOM], less[ROOM]
    assert a.level == b.level == 5
    both = a.known & b.known & ~a.hidden & ~b.hidden
    assert both.sum() > 0.95 * (a.known & ~a.hidden).sum()
    # Where 64 rays see the whole lamp, so do 8.
    even = both & (a.noise == 0) & (b.noise == 0)
    assert (np.abs(a.value - b.value).max(axis=2)[even] < 1e-6).mean() > 0.98
    error = np.sqrt(((a.value - b.value)[both] ** 2).mean())
    assert error < 0.02 * a.value[both].mean()


def test_full_effort_is_what_no_effort_named_is(world):
    usual, all_rays = refined(world, None)
    same, rays = refined(world, full(3))
    assert rays == all_rays
    for s in (ROOM, TABLE):
        assert same[s].value.tobytes() == usual[s].value.tobytes()


def test_a_mesh_ends_as_many_levels_above_its_atlas_and_nothing_else_does(world):
    usual, _ = refined(world, None)
    assert usual[ROOM].level == world.finest(ROOM) == 5
    coarse, _ = refined(world, efforts(world, range(3), np.ones(3), 1.0, 1))
    assert coarse[ROOM].level == 4 and coarse[TABLE].level == usual[TABLE].level
    # Its samples are those that the finer one has there, but where these lie on the cells of other charts.
    a, b = usual[ROOM].value[::2, ::2], coarse[ROOM].value
    both = usual[ROOM].known[::2, ::2] & coarse[ROOM].known
    assert (np.abs(a - b).max(axis=2)[both] < 1e-6).mean() > 0.9


def test_a_level_above_the_base_is_the_coarsest_there_is(world):
    assert refined(world, efforts(world, range(3), np.ones(3), 1.0, 9))[0][ROOM].level == 3
