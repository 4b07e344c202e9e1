"""A first look: light that is known before, colours, sides, and that it hangs on nothing but the scene."""

from dataclasses import replace

import numpy as np
import pytest

from lib import forks
from lib.maps.base_texture import coordinates
from lib.maps.colour import srgb_to_linear
from lib.maps.mesh_texture import Pyramid
from lib.report import first_look, picture
from lib.report.camera import Camera
from lib.report.first_look import Side, Thing, draw
from lib.report.painting import Painting
from lib.report.smoothing_kernels import smooth
from lib.surfaces.coarse import coarse
from tests.shapes import box, rectangle, sphere

DARK = Side(np.zeros(3), np.zeros(3))
ABOVE = Camera((0.0, 3.0, 0.001), (0.0, 0.0, 0.0), 60.0)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(first_look, "SIZE", (96, 60))


def thing(surface, E=0.0, rho=0.0, **more):
    """A Thing of a NURBS surface, its front along S_u x S_v."""
    return Thing(*coarse(surface)[:2], Side(np.ones(3) * E, np.ones(3) * rho), **more)


def floor(rho=0.5, side=2.0):
    """In y = 0, lit above."""
    return thing(rectangle([-side / 2, 0, -side / 2], [0, 0, side], [side, 0, 0]), rho=rho)


FLOOR = rectangle([-1, 0, -1], [0, 0, 2], [2, 0, 0])


def lamp(y, side=0.1, E=100.0, x=0.0, **more):
    """A square in the height y over x, shining down."""
    return thing(rectangle([x - side / 2, y, -side / 2], [side, 0, 0], [0, 0, side]), E=E, **more)


def light_of(image):
    return srgb_to_linear(image / 255.0)


def middle(image):
    """Mean light around the middle of the picture (3,)."""
    h, w = image.shape[:2]
    return light_of(image[h // 2 - 2 : h // 2 + 2, w // 2 - 2 : w // 2 + 2]).mean(axis=(0, 1))


def test_a_small_lamp_over_a_floor():
    """E A / (pi h^2) below it; the camera stands above the lamp, whose back is culled."""
    B = 0.5 * 100 * 0.1**2 / np.pi
    image = draw([floor(), lamp(1.0)], replace(ABOVE, fov=6.0), exposure=0.5 * np.pi / B, reflections=False)
    assert middle(image) == pytest.approx([0.5] * 3, rel=0.03)


def test_a_closed_box_that_shines_and_reflects():
    """H = E (1 + rho + ... ) at every point inside, by as many reflections as there are: 1.9375 E for rho = 0.5."""
    walls = [thing(surface, E=1.0, rho=0.5) for surface in box(2.0)]
    turned = [replace(one, F=one.F[:, ::-1]) for one in walls]
    image = draw(turned, Camera((0.6, 0.7, 0.5), (1.8, 1.1, 1.6), 70.0), exposure=np.pi / 4)
    assert light_of(image).mean() * 4 == pytest.approx(1 + 0.5 * 1.9375, rel=0.04)
    assert light_of(image).std() * 4 < 0.1


def test_what_no_lamp_sees_is_black_without_reflections():
    """A table's shadow on the floor, and its light by a ceiling, unless that only casts shadows."""
    table = thing(rectangle([-0.5, 0.5, -0.5], [0, 0, 1.0], [1.0, 0, 0]), rho=0.0)
    ceiling = thing(rectangle([-4, 2, -4], [8, 0, 0], [0, 0, 8]), rho=0.9)
    things = [floor(side=8.0), table, lamp(1.0), ceiling]
    low = Camera((0.0, 0.25, 1.2), (0.0, 0.0, 0.0), 20.0)
    assert not middle(draw(things, low, exposure=1.0, reflections=False)).any()
    assert (middle(draw(things, low, exposure=1.0)) > 0).all()
    things[-1] = replace(ceiling, front=replace(ceiling.front, reflects=False))
    assert not middle(draw(things, low, exposure=1.0)).any()


def test_colours_of_lamp_and_floor():
    things = [thing(FLOOR, rho=np.array([0.5, 0.5, 0.0])), lamp(1.0, E=np.array([100.0, 50.0, 100.0]))]
    red, green, blue = middle(draw(things, ABOVE, exposure=1.0, reflections=False))
    assert green == pytest.approx(red / 2, rel=0.02) and blue == 0


def test_a_lamp_shows_its_own_light_and_the_brightest_floor_is_white():
    image = draw([lamp(0.0, 2.0, E=3.0, back=Side(np.array([1.5, 0, 0]), np.zeros(3)))], ABOVE, exposure=np.pi / 3)
    assert middle(image) == pytest.approx([0.5, 0, 0], abs=0.01)
    assert middle(draw([floor(), lamp(1.0)], ABOVE, reflections=False)) == pytest.approx([1, 1, 1], rel=0.03)


def test_a_back_shines_down():
    """What a lamp that faces upwards emits from its back lights the floor."""
    up = replace(lamp(1.0), front=DARK, back=lamp(1.0).front)
    turned = replace(up, F=up.F[:, ::-1])
    image = draw([floor(), turned], Camera((0.8, 0.8, 0.8), (0, 0, 0), 10.0), exposure=np.pi * 0.5, reflections=False)
    assert middle(image) == pytest.approx([0.25 * 100 * 0.1**2 / np.pi] * 3, rel=0.05)


def test_backs_are_seen_through_unless_they_are_surfaces():
    below = Camera((0.0, -3.0, 0.001), (0.0, 0.0, 0.0), 30.0)
    background = np.rint(255 * np.array(picture.BACKGROUND)).astype(np.uint8)
    assert (draw([floor()], below) == background).all()
    both = draw([replace(floor(), back=Side(np.zeros(3), np.ones(3))), lamp(1.0)], below, exposure=1.0)
    assert not middle(both).any()  # no light comes there


def test_roles():
    """What receives alone casts no shadow (what casts alone gives nothing back: above)."""
    lid = thing(rectangle([-0.5, 0.5, -0.5], [0, 0, 1.0], [1.0, 0, 0]), rho=0.9)
    low = Camera((0.0, 0.25, 1.2), (0.0, 0.0, 0.0), 20.0)
    shadow, none = (draw([floor(), replace(lid, blocks=b), lamp(1.0)], low, exposure=1.0) for b in (True, False))
    assert not middle(shadow).any() and (middle(none) > 0.04).all()


@pytest.mark.parametrize("rest", [[], ["a sphere that blocks nothing"]])
def test_no_lamp_and_nothing_that_blocks(rest):
    """Black, and no fault."""
    things = [thing(sphere(0.5), rho=0.5, blocks=False) for _ in rest] or [floor()]
    assert not middle(draw(things, ABOVE)).any()


def test_what_only_receives_is_lit_where_nothing_blocks():
    image = draw([replace(one, blocks=False) for one in (floor(), lamp(1.0))], replace(ABOVE, fov=6.0), exposure=1.0)
    assert middle(image) == pytest.approx([0.5 * 100 * 0.1**2 / np.pi / np.pi] * 3, rel=0.03)


def test_a_large_lamp_of_two_triangles_close_to_the_floor():
    """Below the middle of a square of side 1 in a height h, by the form factor of its quarter in closed form."""
    V, F = np.array([[-0.5, 0.4, -0.5], [0.5, 0.4, -0.5], [0.5, 0.4, 0.5], [-0.5, 0.4, 0.5]]), [[0, 1, 2], [0, 2, 3]]
    square = Thing(V, np.array(F), Side(np.full(3, 1.0), np.zeros(3)))
    a = 0.5 / 0.4
    share = 4 * (2 * a / np.sqrt(1 + a * a) * np.arctan(a / np.sqrt(1 + a * a))) / (2 * np.pi)
    low = Camera((0.0, 0.2, 0.0001), (0.0, 0.0, 0.0), 20.0)
    image = draw([floor(1.0), square], low, exposure=np.pi / 2, reflections=False)
    assert middle(image) == pytest.approx([share / 2] * 3, rel=0.02)


def test_a_back_has_its_own_reflectance():
    """A sheet over the floor's lamp, red below: red light on the floor, and none where it only casts shadows."""
    sheet = thing(rectangle([-1, 1, -1], [0, 0, 2], [2, 0, 0]), rho=0.8, back=Side(np.zeros(3), np.array([0.8, 0, 0])))
    up = thing(rectangle([-0.3, 0.1, -0.3], [0, 0, 0.6], [0.6, 0, 0]), E=100.0)
    view = Camera((1.5, 0.5, 1.5), (0.7, 0.0, 0.7), 5.0)
    red, green, blue = middle(draw([floor(), sheet, up], view, exposure=1.0))
    assert red > 0.1 and green == blue == 0
    turned_off = replace(sheet, back=replace(sheet.back, reflects=False))
    assert not middle(draw([floor(), turned_off, up], view, exposure=1.0)).any()


@pytest.mark.parametrize("view", [ABOVE, None])
def test_the_same_for_any_number_of_processes(view):
    things = [floor(), lamp(1.0), thing(sphere(0.3), rho=0.7)]
    one = draw(things, view)
    before = forks.allow(3)
    try:
        assert np.array_equal(draw(things, view), one)
    finally:
        forks.allow(before)
    assert not np.array_equal(draw(things, view, seed=1), one)


def plane(h, w, normal, offset=0.0):
    """Normals and places of pixels that look at one plane along z from afar."""
    j, i = np.meshgrid(np.arange(h), np.arange(w), indexing="ij")
    place = np.stack([i, j, np.full((h, w), offset)], axis=2).astype(np.float32) / w
    return np.broadcast_to(np.float32(normal), (h, w, 3)).copy(), place


def smoothed(light, known, normal, place):
    out, out_known = np.empty_like(light), np.empty_like(known)
    smooth(light, known, normal, place, 1, 0.02, out, out_known)
    return out, out_known


def test_smoothing_of_a_plane_is_by_the_weights_of_what_is_known():
    light, known = np.zeros((9, 9, 3), np.float32), np.ones((9, 9), np.float32)
    light[4, 4] = [256, 128, 0]
    out, out_known = smoothed(light, known, *plane(9, 9, [0, 0, 1]))
    assert np.allclose(out[4, 2:7, 0], np.array([1, 4, 6, 4, 1]) * 6) and np.allclose(out[..., 1] * 2, out[..., 0])
    assert out_known.all()
    known[:] = 0
    known[4, 4] = 1
    out, out_known = smoothed(light, known, *plane(9, 9, [0, 0, 1]))
    inside = np.zeros((9, 9), bool)
    inside[2:7, 2:7] = True
    assert np.array_equal(out_known > 0, inside) and np.allclose(out[inside], [256, 128, 0]) and not out[~inside].any()


@pytest.mark.parametrize(
    "normal, lift", [([1, 0, 0], 0.0), ([0.866, 0, 0.5], 0.0), ([0, 0, 1], 5.0), ([0, 0, -1], 0.0), ([0, 0, 0], 0.0)]
)
def test_smoothing_stops_at_another_plane(normal, lift):
    """Round a corner, down a step, on the other side, and where nothing is seen."""
    left, right = plane(8, 8, [0, 0, 1]), plane(8, 8, normal, lift)
    N, place = (np.concatenate(pair, axis=1) for pair in zip(left, right, strict=True))
    place[:, 8:, 0] += 1
    light = np.zeros((8, 16, 3), np.float32)
    light[:, :8] = 1
    out, _ = smoothed(light, np.ones((8, 16), np.float32), N, place)
    assert out[:, :8].min() > 0.97 and out[:, 8:].max() < 0.03


def quarters(n=32):
    """A picture of four colours: red and green above, blue and white below."""
    colour = np.array([[[0.8, 0, 0], [0, 0.8, 0]], [[0, 0, 0.8], [0.8, 0.8, 0.8]]], np.float32)
    return Painting(Pyramid(colour.repeat(n, axis=0).repeat(n, axis=1)), np.ones(2), np.ones(3))


def painted(painting):
    """The floor with a picture, u along z and v along x, and a lamp far above."""
    V, triangles, UV = coarse(FLOOR)
    T = coordinates(FLOOR, triangles, UV)
    side = Side(np.zeros(3), np.full(3, 0.4), rho_picture=painting)
    things = [Thing(V, triangles, side, T=T), lamp(9.0, E=2e5)]
    return light_of(draw(things, ABOVE, exposure=0.5 / np.pi, reflections=False))


def corners_seen(light):
    """Light near the corners of what ABOVE sees: (u, v) = (1, 1), (1, 0), (0, 1) and (0, 0)."""
    h, w = light.shape[:2]
    at = [(h // 2 + a * h // 6, w // 2 + b * h // 6) for a in (-1, 1) for b in (-1, 1)]
    return [light[j - 2 : j + 3, i - 2 : i + 3].mean(axis=(0, 1)) for j, i in at]


def test_a_picture_lies_as_the_bake_lays_it():
    """Its upper left where u is 0 and v is 1; as bright as a plain floor of its colours."""
    plain = corners_seen(painted(None))
    factor = np.array([g[0] for g in plain])[:, None] * 2  # of 0.8 over 0.4
    green, white, red, blue = corners_seen(painted(quarters())) / factor
    for found, colour in ((green, [0, 1, 0]), (white, [1, 1, 1]), (red, [1, 0, 0]), (blue, [0, 0, 1])):
        assert found == pytest.approx(colour, abs=0.02)


def test_a_picture_repeats_and_has_a_factor():
    """Two tiles along u: the colours of its left and of its right alternate in each half."""
    one = quarters()
    two = replace(one, repeat=np.array([2.0, 1.0]), factor=np.array([0.5, 1, 1]))
    light = painted(two)
    w, h = light.shape[1], light.shape[0]
    column = light[:, w // 2 + h // 6]  # v = 0.2 or so: blue, white, blue, white from the bottom up
    seen = column[np.abs(np.arange(h) + 0.5 - h / 2) < h * 0.5 / (3 * np.tan(np.radians(30))) * 0.95]
    quarter = len(seen) // 4
    white, blue, white_below, blue_below = (
        seen[k * quarter + 2 : (k + 1) * quarter - 2].mean(axis=0) for k in range(4)
    )
    for found in (white, white_below):
        assert found[0] == pytest.approx(found[2] / 2, rel=0.02) and found[1] == pytest.approx(found[2], rel=0.02)
    for found in (blue, blue_below):
        assert found[2] > 0.02 and found[0] == found[1] == 0


def test_a_lamp_shines_by_its_picture_where_it_is_seen():
    V, F, UV = coarse(FLOOR)
    side = Side(np.full(3, 1.0), np.zeros(3), E_picture=replace(quarters(), factor=np.full(3, 5.0)))
    image = draw([Thing(V, F, side, T=coordinates(FLOOR, F, UV))], ABOVE, exposure=np.pi / 5)
    green, white, red, blue = corners_seen(light_of(image))
    assert green == pytest.approx([0, 0.8, 0], abs=0.01) and white == pytest.approx([0.8] * 3, abs=0.01)
    assert red == pytest.approx([0.8, 0, 0], abs=0.01) and blue == pytest.approx([0, 0, 0.8], abs=0.01)


def test_a_back_has_its_own_picture_on_the_same_place():
    V, F, UV = coarse(FLOOR)
    T = coordinates(FLOOR, F, UV)[:, ::-1]
    back = Side(np.zeros(3), np.full(3, 0.4), rho_picture=quarters())
    sheet = Thing(V, F[:, ::-1], Side(np.zeros(3), np.zeros(3)), back, T=T)  # turned: its back lies above
    light = light_of(draw([sheet, lamp(9.0, E=2e5)], ABOVE, exposure=0.5 / np.pi, reflections=False))
    green, white, red, blue = corners_seen(light)
    assert green[1] > 0.05 and green[0] == green[2] == 0 and red[0] > 0.05 and blue[2] > 0.05
    assert white[0] == pytest.approx(white[1], rel=0.02)


def test_pixels_show_the_mean_of_what_they_hold():
    """A chess board of single texels: its colours from near, their mean from afar, more of it the flatter the view."""
    board = (np.indices((64, 64)).sum(axis=0) % 2)[..., None] * np.ones(3, np.float32)
    painting = Painting(Pyramid(board.astype(np.float32)), np.ones(2), np.ones(3))
    corner, T = np.array([[[0, 0, 0], [6.4, 0, 0], [0, 6.4, 0]]]), np.array([[[0, 0], [1, 0], [0, 1.0]]])
    weight = np.array([[1 - 2 * 20.5 / 64, 20.5 / 64, 20.5 / 64]])  # the middle of a texel

    def at(width, cosine=1.0):
        return float(painting.seen(corner, T, weight, np.array([width]), np.array([cosine]))[0, 0])

    assert at(0.01) == at(0.1) == board[63 - 20, 20, 0] == 1
    assert at(0.2) == at(1.0) == pytest.approx(0.5)
    assert at(0.1, cosine=0.2) == pytest.approx(0.5)
