"""Emission pictures: the parts direct light sees, and their means."""

import numpy as np
import pytest

from lib.maps import base_texture, emission
from tests.maps.test_maps_mesh_texture import square_mesh
from tests.shapes import rectangle, sphere
from tests.surfaces.trimmed_shapes import SQUARE, circle, cut_out

FLAT = rectangle([0, 0, 0], [2, 0, 0], [0, 1, 0])


def picture(text, pixels=512):
    """Squares of single letters (rgbw, . black), a line of text a row, each `pixels` wide."""
    colour = {"r": (1, 0, 0), "g": (0, 1, 0), "b": (0, 0, 1), "w": (1, 1, 1), ".": (0, 0, 0)}
    rows = np.array([[colour[c] for c in row] for row in text.split()], dtype=np.float32)
    return rows.repeat(pixels, axis=0).repeat(pixels, axis=1)


def parts(surface, text, repeat=(1, 1)):
    """{box: colour} of a surface's glow."""
    found = emission.glow(surface, picture(text), repeat)
    return {tuple(box): tuple(colour) for box, colour in zip(found.box.tolist(), found.colour.tolist(), strict=True)}


@pytest.mark.parametrize("surface", [FLAT, square_mesh()])
def test_four_squares_are_four_parts_upright(surface):
    """The first line of the picture is its top, v = 1; colours relative to the mean (1/2, 1/4, 1/4)."""
    assert parts(surface, "rg bw") == {
        (0.0, 0.5, 0.5, 1.0): pytest.approx((2, 0, 0), abs=0.02),
        (0.5, 1.0, 0.5, 1.0): pytest.approx((0, 2, 0), abs=0.02),
        (0.0, 0.5, 0.0, 0.5): pytest.approx((0, 0, 2), abs=0.02),
        (0.5, 1.0, 0.0, 0.5): pytest.approx((2, 2, 2), abs=0.02),
    }


def test_repeated_and_uneven_leaves():
    """Two copies along u; below a quarter that shines in one corner is cut again."""
    assert parts(FLAT, "w.", (2, 1)).keys() == {
        *((k / 4, k / 4 + 0.25, j / 4, j / 4 + 0.25) for k in range(4) for j in range(4))
    }
    found = parts(FLAT, "w... .... .... ....")
    assert len(found) == 7 and found[0.0, 0.25, 0.75, 1.0] == pytest.approx((16, 16, 16), rel=1e-6)
    assert sorted(found.values())[:-1] == [(0, 0, 0)] * 6


@pytest.mark.parametrize("value", [1.0, 0.25, 700.0])
@pytest.mark.parametrize("surface", [FLAT, sphere(), square_mesh()])
def test_an_even_picture_has_no_parts_and_its_own_value(surface, value):
    even = np.full((3, 5, 3), value, np.float32)
    assert emission.glow(surface, even) is None
    assert emission.average(surface, even).tolist() == [value] * 3
    assert emission.on_map(surface, even, (1, 1), 9, 9)[0] == pytest.approx(value, rel=1e-6)


def test_a_black_picture():
    black = np.zeros((4, 4, 3), np.float32)
    assert emission.glow(FLAT, black) is None and not emission.average(FLAT, black).any()


def test_noise_has_at_most_64_parts_whose_mean_is_one():
    noise = np.random.default_rng(3).random((300, 300, 3)).astype(np.float32) ** 8
    hole = cut_out(FLAT, [SQUARE, circle([0.5, 0.5], 0.3, 64, is_hole=True)])
    for surface in (FLAT, sphere(), hole):
        glow = emission.glow(surface, noise)
        assert 8 < len(glow.box) <= emission.SIDE**2
        _, area = base_texture.means_over(surface, noise, (1, 1), emission.SIDE)
        u0, u1, v0, v1 = (glow.box.T * emission.SIDE).astype(int)
        own = [area[a:b, c:d].sum() for a, b, c, d in zip(v0, v1, u0, u1, strict=True)]
        assert np.average(glow.colour, axis=0, weights=own) == pytest.approx(np.ones(3), rel=1e-9)
    assert emission.average(sphere(), noise) == pytest.approx(base_texture.rho_average(sphere(), noise), rel=1e-9)


def test_the_parts_of_a_sphere_weigh_by_area():
    """White from the equator up on half of it: a part has its own mean, 1 or 0."""
    found = parts(sphere(), "w w . .")
    assert sorted(found.values())[-1] == pytest.approx((2, 2, 2), rel=1e-3)
