"""Squares seen straight on: exact colours at known pixels."""

import numpy as np
import pytest

from lib.maps.colour import srgb_to_linear
from lib.report.camera import Camera, automatic, closer
from lib.report.picture import Part, Texture, join, lookup, render, render_with_edges

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
UPRIGHT = np.array([[0.0, 1], [1, 1], [1, 0], [0, 0]])  # lower left corner of the square is the picture's lower left
CODES = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [200, 150, 100]]], np.uint8)  # upper row first
STRAIGHT = Camera((0.5, 0.5, 0.5 / np.tan(np.radians(30))), (0.5, 0.5, 0), 60)  # the square fills the picture


def texture(codes=CODES, wrap=("clamp", "clamp")):
    return Texture(srgb_to_linear(codes / 255).astype(np.float32), wrap)


def test_a_two_by_two_picture_shows_its_texel_colours_at_the_texel_centres():
    model = join([Part(SQUARE, TRIANGLES, UPRIGHT, texture=0)])
    image = render(model, [texture()], STRAIGHT, 10, 10, samples=1)
    # Pixel 2 of 10 has its centre at 0.25 of the side: the first texel's centre; pixel 7 the second's.
    assert image[2, 2].tolist() == [255, 0, 0]
    assert image[2, 7].tolist() == [0, 255, 0]
    assert image[7, 2].tolist() == [0, 0, 255]
    assert image[7, 7].tolist() == [200, 150, 100]


def test_filtering_is_linear_in_light():
    half = lookup(texture(np.array([[[0, 0, 0], [255, 255, 255]]], np.uint8)), np.array([[0.5, 0.5], [0.25, 0.5]]))
    assert half == pytest.approx(np.array([[0.5] * 3, [0.0] * 3]))


@pytest.mark.parametrize("wrap, expected", [("clamp", 1.0), ("repeat", 0.5), ("mirror", 1.0)])
def test_wrap_at_the_right_border(wrap, expected):
    row = texture(np.array([[[0, 0, 0], [255, 255, 255]]], np.uint8), (wrap, "clamp"))
    assert lookup(row, np.array([[1.0, 0.5]]))[0] == pytest.approx([expected] * 3)


def test_supersampling_averages_light_at_the_edge_of_the_square():
    model = join([Part(SQUARE, TRIANGLES, factor=(1, 1, 1))])
    aside = Camera((1.0, 0.5, 0.5), (1.0, 0.5, 0), 90)  # the right edge runs down the middle of an odd picture
    image = render(model, [], aside, 5, 5, samples=2, background=(0, 0, 0))
    assert image[2, 1].tolist() == [255] * 3 and image[2, 3].tolist() == [0] * 3
    assert image[2, 2].tolist() == [188] * 3  # sRGB of 0.5


def test_vertex_colours_are_interpolated_in_linear_light():
    colour = np.array([[0.0] * 3, [1.0] * 3, [1.0] * 3, [0.0] * 3])
    model = join([Part(SQUARE, TRIANGLES, colour=colour)])
    image = render(model, [], STRAIGHT, 10, 10, samples=1)
    assert image[5, 2].tolist() == [137] * 3  # sRGB of 0.25


def test_a_back_face_is_seen_through_and_a_two_sided_one_is_not():
    behind = SQUARE - [0, 0, 1]
    wall = Part(behind, TRIANGLES, factor=(0, 1, 0))
    away = Part(SQUARE, TRIANGLES[:, ::-1], factor=(1, 0, 0))
    assert render(join([wall, away]), [], STRAIGHT, 9, 9, samples=1)[4, 4].tolist() == [0, 255, 0]
    both = Part(SQUARE, TRIANGLES[:, ::-1], factor=(1, 0, 0), is_two_sided=True)
    assert render(join([wall, both]), [], STRAIGHT, 9, 9, samples=1)[4, 4].tolist() == [255, 0, 0]


def test_edges_darken_where_triangles_meet():
    model = join([Part(SQUARE, TRIANGLES)])
    plain, image = render_with_edges(model, [], STRAIGHT, 20, 20, samples=1, edges=0.5)
    assert plain.min() == 255
    assert image[10, 5].tolist() == [255] * 3
    assert (image[:, :, 0] == 188).sum() >= 19  # the diagonal


def test_nothing_to_draw_is_background():
    assert render(join([]), [], Camera((0, 0, 1), (0, 0, 0)), 3, 2, background=(0, 0, 0)).max() == 0


def test_camera_refuses_to_look_at_itself():
    with pytest.raises(ValueError, match="same point"):
        Camera((1, 2, 3), (1, 2, 3)).rays(2, 2)


def room():
    """A closed box 4 x 3 x 5 whose faces look inwards, as six parts."""
    corner = np.array([[x, y, z] for x in (0, 4) for y in (0, 3) for z in (0, 5)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    parts, centre = [], np.array([2, 1.5, 2.5])
    for q in quads:
        V, F = corner[list(q)], TRIANGLES
        inward = np.dot(np.cross(V[1] - V[0], V[2] - V[0]), centre - V[0]) > 0
        parts.append(Part(V, F if inward else F[:, ::-1]))
    return parts


def test_automatic_camera_stands_inside_a_room_and_outside_an_object():
    inside = automatic(join(room()))
    assert (np.array(inside.eye) > 0).all() and (np.array(inside.eye) < [4, 3, 5]).all()
    outside = automatic(join([Part(p.V, p.F[:, ::-1]) for p in room()]))
    assert (np.array(outside.eye) < 0).any() or (np.array(outside.eye) > [4, 3, 5]).any()


def test_a_closer_look_goes_to_the_finely_divided_part():
    n = 12
    t = np.arange(n + 1) / n
    V = np.stack([0.8 + 0.1 * np.tile(t, n + 1), 0.8 + 0.1 * np.repeat(t, n + 1), np.full((n + 1) ** 2, 0.01)], axis=1)
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    F = np.concatenate([np.stack([i, i + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + n + 1], 1)])
    near = closer(join([Part(SQUARE, TRIANGLES), Part(V, F)]), STRAIGHT, 100, 100)
    assert near.eye == STRAIGHT.eye and near.fov < 30
    direction = np.subtract(near.target, near.eye)
    at = np.array(near.eye) - direction * near.eye[2] / direction[2]
    assert at[:2] == pytest.approx([0.8, 0.8], abs=0.15)
    assert closer(join([Part(SQUARE, TRIANGLES)]), STRAIGHT, 100, 100) == STRAIGHT


def test_two_faces_back_to_back_show_each_its_own_side():
    """One square wound both ways, as both sides of a sheet: from the front the one texture, from behind the other."""
    blue = texture(np.array([[[0, 0, 255]]], np.uint8))
    front = Part(SQUARE, TRIANGLES, UPRIGHT, texture=0)
    back = Part(SQUARE[[2, 3, 0, 1]], TRIANGLES[:, ::-1], UPRIGHT[[2, 3, 0, 1]], texture=1)
    model = join([front, back])
    image = render(model, [texture(), blue], STRAIGHT, 10, 10, samples=1)
    assert image[2, 2].tolist() == [255, 0, 0] and image[7, 7].tolist() == [200, 150, 100]
    assert image[7, 2].tolist() == [0, 0, 255] and image[2, 7].tolist() == [0, 255, 0]
    behind = Camera((0.5, 0.5, -STRAIGHT.eye[2]), (0.5, 0.5, 0), 60)
    assert (render(model, [texture(), blue], behind, 10, 10, samples=1) == [0, 0, 255]).all()


@pytest.mark.parametrize("wrap", [("clamp", "mirror"), ("repeat", "clamp"), ("mirror", "repeat")])
def test_codes_and_their_light_show_what_a_picture_in_linear_light_shows(wrap):
    codes = np.random.default_rng(4).integers(0, 256, (5, 7, 3), np.uint8)
    light = srgb_to_linear(np.arange(256) / 255).astype(np.float32)
    model = join([Part(SQUARE, TRIANGLES, 3 * UPRIGHT - 1, factor=(0.5, 1, 0.7), texture=0)])
    pictures = [render(model, [one], STRAIGHT, 40, 40) for one in (texture(codes, wrap), Texture(codes, wrap, light))]
    assert np.array_equal(*pictures) and len(np.unique(pictures[0])) > 50
