"""Base textures: averages by area, crossings against pixel centres, light times texture."""

from dataclasses import replace

import numpy as np
import pytest

from lib.maps import base_texture as bt
from lib.maps.pixels import box_means
from lib.nurbs.evaluate import evaluate_grid
from lib.nurbs.shape import collapsed_sides
from lib.nurbs.surface import bilinear, from_points
from lib.surfaces.trimmed import TrimmedSurface
from tests.rooms import cube_mesh

ROUND = 1e-6  # float32 maps
QUADRATURE = 2e-4  # midpoint rule on 128 cells of a quarter period each: (pi/2/128)^2 and the picture's own pixels
ENERGY = 1e-3  # relative, of the area mean after scaling


def unit_square():
    return bilinear([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0])


def sphere():
    """The exact rational unit sphere: closed in u, poles at v = 0 and v = 1, uneven speed."""
    s = np.sqrt(0.5)
    circle = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], float)
    circle_w = np.array([1, s, 1, s, 1, s, 1, s, 1])
    half = np.array([[0, -1], [1, -1], [1, 0], [1, 1], [0, 1]], float)  # radius, height
    half_w = np.array([1, s, 1, s, 1])
    P = np.stack(
        [
            np.broadcast_to(half[None, :, 0], (9, 5)) * circle[:, None, 0],
            np.broadcast_to(half[None, :, 0], (9, 5)) * circle[:, None, 1],
            np.broadcast_to(half[None, :, 1], (9, 5)),
        ],
        axis=2,
    )
    knots_u = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]) / 4
    knots_v = np.array([0, 0, 0, 1, 1, 2, 2, 2]) / 2
    return from_points(2, 2, knots_u, knots_v, P, circle_w[:, None] * half_w)


def random_picture(H, W, seed=0):
    return np.random.default_rng(seed).random((H, W, 3)).astype(np.float32)


def grey(values):
    """(H, W) to (H, W, 3) float32."""
    return np.repeat(np.asarray(values, np.float32)[..., None], 3, axis=2)


# ---- average reflectance


@pytest.mark.parametrize("shape", [(1, 1), (5, 3), (300, 400)])
@pytest.mark.parametrize("repeat", [(1, 1), (4, 3)])
def test_average_of_a_constant_picture_is_exact_on_any_surface(shape, repeat):
    picture = np.broadcast_to(np.float32([0.1, 0.7, 1]), (*shape, 3))
    for surface in (unit_square(), sphere()):
        assert bt.rho_average(surface, picture, repeat).tolist() == np.float32([0.1, 0.7, 1]).astype(float).tolist()


@pytest.mark.parametrize("shape", [(1, 1), (5, 3), (100, 256), (257, 90), (300, 400)])
@pytest.mark.parametrize("repeat", [(1, 1), (4, 3)])
def test_average_over_an_even_rectangle_is_the_mean_of_the_pixels(shape, repeat):
    picture = random_picture(*shape)
    assert np.allclose(bt.rho_average(unit_square(), picture, repeat), picture.astype(float).mean((0, 1)), atol=1e-12)


def test_average_is_weighted_by_area_on_the_exact_sphere():
    v = 1 - (np.arange(400) + 0.5) / 400  # of the pixel rows, top first
    z = evaluate_grid(sphere(), np.array([0.3]), v)[0][:, 0, 2]
    picture = grey(np.repeat(z[:, None] ** 2, 7, axis=1))
    assert abs(picture.mean() - 0.5) < 0.01  # the plain uv mean, the mistake to be made
    assert np.allclose(bt.rho_average(sphere(), picture), 1 / 3, atol=QUADRATURE)
    small = grey(np.repeat(z[::10][:, None] ** 2, 3, axis=1))
    assert np.allclose(bt.rho_average(sphere(), small), 1 / 3, atol=0.01)


def test_average_on_a_trapezium():
    # x = u (2 - v), y = v: area element 2 - v, so rho = v has the mean (1 - 1/3) / (2 - 1/2) = 4/9
    trapezium = bilinear([0, 0, 0], [2, 0, 0], [1, 1, 0], [0, 1, 0])
    rows = 1 - (np.arange(500) + 0.5) / 500
    assert np.allclose(bt.rho_average(trapezium, grey(rows[:, None])), 4 / 9, atol=QUADRATURE / 4)


def test_average_does_not_depend_on_scale_place_or_knots():
    picture = random_picture(20, 30)
    one = bt.rho_average(sphere(), picture)
    ball = sphere()
    big = from_points(2, 2, ball.knots_u * 7 - 3, ball.knots_v * 0.01, ball.P * 1e6 + 1e8, ball.w * 55)
    assert np.allclose(bt.rho_average(big, picture), one, rtol=1e-7)


def test_pure_red_averages_to_zero_in_the_other_channels():
    picture = np.zeros((4, 4, 3), np.float32)
    picture[..., 0] = random_picture(4, 4)[..., 0]
    assert bt.rho_average(sphere(), picture)[1:].tolist() == [0, 0]


# ---- pictures at crossings


def test_a_row_of_four_pixels_at_five_crossings():
    picture = grey([[0, 1, 0.5, 0.25]])
    rho = bt.evaluate_picture(picture, (1, 1), 5, 2)
    assert np.allclose(rho[0, :, 0], [0, 0.5, 0.75, 0.375, 0.25])  # border pixels repeat; a resize would give others
    assert np.array_equal(rho[0], rho[1])


def test_pictures_stand_upright():
    picture = grey([[1, 0], [0.25, 0.5]])  # top left is white
    rho = bt.evaluate_picture(picture, (1, 1), 9, 9)[..., 0]
    assert (rho[-1, 0], rho[-1, -1], rho[0, 0], rho[0, -1]) == (1, 0, 0.25, 0.5)


@pytest.mark.parametrize("W", [16, 1024])  # coarser and finer than the map
def test_a_ramp_over_pixel_centres_is_the_same_ramp_at_crossings(W):
    ramp = 0.2 + 0.6 * (np.arange(W) + 0.5) / W
    rho = bt.evaluate_picture(grey(ramp[None]), (1, 1), 65, 3)[1, :, 0]
    u = np.arange(65) / 64
    inside = (u > 0.5 / W + 1e-9) & (u < 1 - 0.5 / W - 1e-9) & (np.arange(65) > 0) & (np.arange(65) < 64)
    assert np.allclose(rho[inside], (0.2 + 0.6 * u)[inside], atol=ROUND)
    assert abs(rho[0] - 0.2) < 0.6 * max(0.5 / W, 0.25 / 64) + ROUND  # half a pixel, or a quarter of a spacing


def test_tiles_repeat_and_go_round_at_the_border():
    picture = grey([[0, 1, 0.5, 0.25]])
    rho = bt.evaluate_picture(picture, (2, 1), 17, 2, wrap=(True, False))[0, :, 0]
    assert np.allclose(rho[[0, 8, 16]], 0.125) and np.array_equal(rho[:8], rho[8:16])
    assert np.allclose(rho[[1, 2, 3]], [0, 0.5, 1])
    fine = bt.evaluate_picture(random_picture(64, 64), (3, 2), 25, 17, wrap=(True, True))
    assert np.allclose(fine[:, 0], fine[:, -1], atol=ROUND) and np.allclose(fine[:, :9], fine[:, 8:17], atol=ROUND)
    assert np.allclose(fine[0], fine[-1], atol=ROUND)


def test_v_tiles_start_at_the_bottom():
    picture = grey([[1], [0]])  # top white
    rho = bt.evaluate_picture(picture, (1, 2), 2, 9, wrap=(False, True))[:, 0, 0]
    assert np.allclose(rho[[1, 3, 5, 7]], [0, 1, 0, 1])


@pytest.mark.parametrize("shape", [(1, 1), (5, 3), (37, 200)])
def test_evaluation_commutes_with_mirroring_and_transposing(shape):
    picture = random_picture(*shape)
    rho = bt.evaluate_picture(picture, (1, 1), 33, 17)
    assert np.allclose(bt.evaluate_picture(picture[:, ::-1], (1, 1), 33, 17), rho[:, ::-1], atol=ROUND)
    assert np.allclose(bt.evaluate_picture(picture[::-1], (1, 1), 33, 17), rho[::-1], atol=ROUND)
    turned = picture[::-1].transpose(1, 0, 2)[::-1]  # u and v exchanged, in the picture's own row order
    assert np.allclose(bt.evaluate_picture(turned, (1, 1), 17, 33), rho.transpose(1, 0, 2), atol=ROUND)


@pytest.mark.parametrize("width", [0.3, 1, 2.7, 15, 40, 333])
def test_box_means_are_those_of_a_picture_drawn_out_in_tiny_squares(width):
    row = random_picture(1, 37)
    centre = np.linspace(0, 74, 9)
    means = box_means(row, centre - width / 2, centre + width / 2, axis=1)[0]
    fine = (np.arange(4000) + 0.5) / 4000
    for k, c in enumerate(centre):
        at = np.floor(c - width / 2 + width * fine).astype(int) % 37
        assert np.allclose(means[k], row[0, at].astype(float).mean(axis=0), atol=2e-3)


def test_constant_pictures_stay_constant_to_the_bit():
    for shape in [(1, 1), (5, 3), (200, 300)]:
        rho = bt.evaluate_picture(np.full((*shape, 3), 0.7, np.float32), (1, 1), 33, 9)
        assert np.abs(rho - np.float32(0.7)).max() <= 6e-8


def test_the_row_of_a_pole_is_one_colour():
    collapsed = collapsed_sides(sphere())
    assert collapsed.tolist() == [False, False, True, True]
    rho = bt.evaluate_picture(random_picture(20, 30), (1, 1), 33, 17, bt.wraps(sphere(), (1, 1)), collapsed)
    assert np.ptp(rho[0], axis=0).max() == 0 and np.ptp(rho[-1], axis=0).max() == 0
    assert np.ptp(rho[8], axis=0).min() > 0.1


def test_a_closed_surface_has_no_step_at_its_seam():
    assert bt.wraps(sphere(), (1, 1)) == (True, False) and bt.wraps(unit_square(), (1, 2)) == (False, True)
    rho = bt.evaluate_picture(random_picture(20, 30), (1, 1), 65, 33, bt.wraps(sphere(), (1, 1)))
    assert np.array_equal(rho[:, 0], rho[:, -1])
    assert np.abs(rho[:, 0] - (rho[:, 1] + rho[:, -2]) / 2).max() < 0.3  # between its neighbours on both sides


# ---- energy


@pytest.mark.parametrize("surface", [unit_square(), sphere()], ids=["square", "sphere"])
@pytest.mark.parametrize("repeat", [(1, 1), (3, 2)])
@pytest.mark.parametrize("shape", [(5, 3), (120, 80), (700, 500)])
def test_even_light_keeps_its_mean_under_a_texture(surface, repeat, shape):
    picture = random_picture(*shape)
    rho_avg = bt.rho_average(surface, picture, repeat)

    rho, weight = bt.rho_cells(surface, picture, repeat)  # the grid of the average
    B = np.full((*weight.shape, 3), 2.5)
    assert np.allclose(np.einsum("ji,jic->c", weight, bt.apply(B, rho, rho_avg)) / weight.sum(), 2.5, rtol=1e-6)

    w, h = 513, 257  # the grid of a map
    rho = bt.evaluate_picture(picture, repeat, w, h, bt.wraps(surface, repeat), collapsed_sides(surface))
    _, S_u, S_v = evaluate_grid(surface, np.linspace(0, 1, w), np.linspace(0, 1, h))
    weight = np.linalg.norm(np.cross(S_u, S_v), axis=2) * bt._trapezoid(w) * bt._trapezoid(h)[:, None]
    final = bt.apply(np.full((h, w, 3), 2.5, np.float32), rho, rho_avg)
    mean = np.einsum("ji,jic->c", weight, final.astype(float)) / weight.sum()
    assert np.allclose(mean, 2.5, rtol=ENERGY), np.abs(mean / 2.5 - 1).max()


# ---- light times texture


def test_both_forms_of_equation_one_agree():
    rng = np.random.default_rng(1)
    H, rho = rng.random((9, 9, 3)).astype(np.float32) * 50, rng.random((9, 9, 3)).astype(np.float32)
    rho_avg = np.array([0.2, 0.5, 0.9])
    assert np.allclose(bt.apply(bt.reflected(H, rho_avg), rho, rho_avg), H * rho, rtol=ROUND)


def test_a_channel_without_reflectance_gives_zero():
    rho_avg, rho = np.array([0.4, 0, 0]), np.zeros((3, 3, 3), np.float32)
    rho[..., 0] = 0.4
    final = bt.apply(bt.reflected(np.full((3, 3, 3), 7.0), rho_avg), rho, rho_avg)
    assert np.allclose(final[..., 0], 2.8) and not final[..., 1:].any()


@pytest.mark.parametrize(
    "roots, level, size, repeat, cap, expected",
    [
        ((1, 1), 4, (1, 1), (1, 1), 10, 4),  # the light decides
        ((1, 1), 2, (512, 512), (1, 1), 10, 9),  # 513 crossings
        ((1, 1), 2, (513, 1), (1, 1), 10, 9),
        ((1, 1), 2, (514, 1), (1, 1), 10, 10),
        ((2, 1), 3, (1600, 1052), (1, 1), 12, 11),
        ((2, 1), 3, (1600, 1052), (1, 1), 10, 10),  # the cap decides
        ((1, 1), 0, (100, 100), (4, 3), 10, 9),  # all tiles
        ((1, 1), 7, (2000, 2000), (1, 1), 5, 7),  # light is never thrown away
    ],
)
def test_common_level(roots, level, size, repeat, cap, expected):
    assert bt.common_level(roots, level, size, repeat, cap) == expected


def test_upsampling_reproduces_bilinear_light_and_keeps_shared_samples():
    v, u = np.meshgrid(np.arange(3) / 2, np.arange(5) / 4, indexing="ij")
    field = grey(1 + 2 * u - 3 * v + 4 * u * v)
    fine, hidden = bt.upsample(field, np.zeros((3, 5), bool), 3)
    v, u = np.meshgrid(np.arange(17) / 16, np.arange(33) / 32, indexing="ij")
    assert np.allclose(fine, grey(1 + 2 * u - 3 * v + 4 * u * v), atol=ROUND) and not hidden.any()
    noisy = random_picture(3, 5)
    assert np.array_equal(bt.upsample(noisy, np.zeros((3, 5), bool), 3)[0][::8, ::8], noisy)


def test_hidden_samples_take_no_part_in_upsampling():
    value, hidden = grey([[1, 99, 99], [3, 99, 99]]), np.array([[0, 1, 1], [0, 1, 1]], bool)
    fine, fine_hidden = bt.upsample(value, hidden, 1)
    assert fine_hidden.tolist() == [[0, 0, 1, 1, 1]] * 3
    assert fine[..., 0].tolist() == [[1, 1, 0, 0, 0], [2, 2, 0, 0, 0], [3, 3, 0, 0, 0]]
    same, same_hidden = bt.upsample(value, hidden, 0)
    assert same[..., 0].tolist() == [[1, 0, 0], [3, 0, 0]] and np.array_equal(same_hidden, hidden)


def test_where_a_picture_lies_on_triangles():
    """Over the whole surface, of which a trimmed one's map shows a box; on a mesh where its own coordinates say."""
    UV, F = np.array([[0, 0], [1, 0], [0.5, 1.0]]), np.array([[0, 1, 2], [2, 1, 0]])
    square = bilinear([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0])
    assert bt.coordinates(square, F, UV).tolist() == UV[F].tolist()
    part = TrimmedSurface(square, np.array([0.25, 0.75, 0.5, 1.5]), UV, np.array([0, 3]), np.zeros((3, 3)), np.ones(3))
    corners = [[0.25, 0.5], [0.75, 0.5], [0.5, 1.5]]
    assert bt.coordinates(part, F, UV).tolist() == [corners, corners[::-1]]
    T = np.random.default_rng(4).random((12, 3, 2))
    mesh = replace(cube_mesh(), T=T)
    assert bt.coordinates(mesh, None, None) is T and bt.wraps(mesh, (1, 1)) == (True, True)
