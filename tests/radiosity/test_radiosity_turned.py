"""Surfaces turned inside out are told by name; what is merely dark, or lit on both sides, is not."""

import numpy as np
import pytest

from lib.radiosity.turned import lit_behind
from lib.surfaces.measure import transformed
from tests.rooms import baked, cube, world_of
from tests.shapes import rectangle, sphere

LAMP = rectangle([0.4, 0.4, 0.99], [0, 0.2, 0], [0.2, 0, 0]), {"E": 10.0}  # looks down
SHEET = rectangle([0.4, 0.4, 0.5], [0.2, 0, 0], [0, 0.2, 0])  # looks up, at the lamp


def ball(radius, x, y, z):
    place = np.diag([radius, radius, radius, 1.0])
    place[:3, 3] = x, y, z
    return transformed(sphere(), place)


@pytest.mark.parametrize("flip, found", [(True, ["sheet"]), (False, [])])
def test_light_behind_a_sheet(flip, found):
    world = world_of({**cube(), "lamp": LAMP, "sheet": (SHEET, {"flip": flip})})
    own = [world.scene.names.index("sheet")]
    assert [world.scene.names[s] for s in lit_behind(world, own, 1, (4, 8))] == found


def test_a_sheet_with_both_sides_lit_is_left_out():
    both = {"sheet": (SHEET, {"flip": True}), "sheet/back": (SHEET, {"front": "sheet"})}
    world = world_of({**cube(), "lamp": LAMP, **both})
    assert lit_behind(world, range(world.n), 1, (4, 8)) == []


@pytest.mark.parametrize("flip", [True, False])
def test_a_ball_lit_inside_is_told_by_name(tmp_path, capsys, flip):
    """A small ball within it is dark, and nothing is behind it."""
    things = {"ball": (ball(0.2, 0.5, 0.5, 0.3), {"flip": flip}), "core": (ball(0.05, 0.5, 0.5, 0.3), {})}
    maps = baked(tmp_path, {**cube(), "lamp": LAMP, **things}, 0.5, tolerance=0.1)
    assert maps["ball"][0].any() != flip and not maps["core"][0].any()
    told = "warning: no light reaches ball, but their backs are lit: turned inside out? `flip: true` turns them\n"
    assert (told in capsys.readouterr().err) == flip
