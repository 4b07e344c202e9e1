"""Element rows of a cube: everything is met, shares are the published form factors, both ways alike."""

import numpy as np
import pytest

from lib.nurbs.shape import transformed
from lib.radiosity.rows import ABSORBED, NO_RAY, NOTHING
from lib.radiosity.sampling import base_lattice, elements_of
from tests.rooms import cube, world_of
from tests.shapes import rectangle, sphere
from tests.tolerances import STANDARD_ERRORS

FACING, BESIDE = 0.19982, 0.20004


def rows_of(world, R=256, n_elements=96, seed=1):
    """{surface: Elements} and the grids."""
    grids = world.grids(n_elements)
    base = base_lattice(world, range(world.n), seed, 2, (4, 4))[0]
    lit = [s for s in range(world.n) if grids.n_u[s]]
    return dict(zip(lit, elements_of(world, lit, seed, grids, R, base), strict=True)), grids


@pytest.fixture(scope="module")
def box_rows():
    world = world_of(cube())
    elements, grids = rows_of(world)
    return elements, grids


def test_a_closed_cube_loses_no_ray(box_rows):
    elements, grids = box_rows
    for e in elements.values():
        assert (e.rows.entries >= 0).all() and e.rows.entries.max() < grids.total
        assert not e.rows.is_hidden.any()
        assert e.area.sum() == pytest.approx(1, rel=1e-9)  # the frame's unit is the side


def test_walls_see_each_other_by_published_factors(box_rows):
    """No ray ends on its own wall; 0.19982 on the wall across, 0.20004 on each other one."""
    elements, grids = box_rows
    across = {0: 1, 1: 0, 2: 3, 3: 2, 4: 5, 5: 4}
    for s, e in elements.items():
        met = np.searchsorted(grids.first, e.rows.entries.ravel(), side="right") - 1
        share = np.bincount(met, minlength=6) / met.size
        assert share[s] == 0
        for other in set(range(6)) - {s}:
            expected = FACING if other == across[s] else BESIDE
            assert abs(share[other] - expected) < STANDARD_ERRORS * np.sqrt(expected * (1 - expected) / met.size)


def test_reciprocity(box_rows):
    """area_i F_ij = area_j F_ji within 4 standard errors of the two counts, over blocks of a quarter of a wall."""
    elements, grids = box_rows
    n = int(grids.n_u[0])
    j, i = np.divmod(np.arange(n * n), n)
    block = (4 * np.arange(6)[:, None] + 2 * (2 * j // n) + 2 * i // n).ravel()
    counts = np.zeros((24, 24))
    for s, e in elements.items():
        origin = np.repeat(block[grids.first[s] : grids.first[s + 1]], e.rows.entries.shape[1])
        np.add.at(counts, (origin, block[e.rows.entries.ravel()]), 1)
    error = STANDARD_ERRORS * np.sqrt(np.maximum(counts + counts.T, 1))
    assert (np.abs(counts - counts.T) <= error).all() and (counts > 0).sum() == 24 * 20


def test_what_is_met_says_where():
    """A floor alone: everything leaves.  Below a caster without elements, a lamp's back and a black one: absorbed."""
    floor = {"floor": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {})}
    lid = rectangle([-50, -50, 0.1], [101, 0, 0], [0, 101, 0])  # its back to the floor
    entries = {}
    for name, facts in {"none": None, "back": {}, "caster": {"role": "cast_only", "flip": True}}.items():
        world = world_of(floor | ({"lid": (lid, facts)} if facts is not None else {}))
        entries[name] = rows_of(world, n_elements=16)[0][0].rows
    assert (entries["none"].entries == NOTHING).all()
    assert (entries["caster"].entries == ABSORBED).mean() > 0.99
    assert entries["back"].is_hidden.all() and (entries["back"].entries == NO_RAY).all()


def test_buried_points_cast_no_ray_and_have_no_area():
    """A ball in the middle of the floor: the points below it, a circle of radius r, are inside a closed shell."""
    r = 0.25
    half_sunk = np.diag([r, r, r, 1.0])
    half_sunk[:2, 3] = 0.5
    surfaces = {
        "ball": (transformed(sphere(), half_sunk), {}),
        "floor": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {}),
    }
    world = world_of(surfaces)
    elements, grids = rows_of(world, n_elements=2000)
    floor = elements[1]
    assert (floor.rows.entries[floor.rows.is_hidden.all(axis=1)] == NO_RAY).all()
    assert 1 - floor.area.sum() / world.casters.area[1] == pytest.approx(np.pi * r * r, rel=0.05)
    assert floor.rows.is_hidden.mean() == pytest.approx(np.pi * r * r, rel=0.05)


@pytest.mark.parametrize("R", [16, 64, 256])
def test_points_below_a_sheet_are_not_buried_by_chance(R):
    """A table top over 80 % of the floor's sky: a single ray, or four, may all meet its back."""
    top = rectangle([0, 0, 0.25], [1, 0, 0], [0, 1, 0])
    surfaces = {"floor": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {}), "top": (top, {})}
    floor = rows_of(world_of(surfaces), R=R)[0][0]
    assert floor.rows.is_hidden.mean() < 0.02
    assert ((floor.rows.entries == ABSORBED).mean() > 0.4) and floor.area.sum() > 0.98
