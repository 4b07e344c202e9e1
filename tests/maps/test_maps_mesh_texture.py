"""Pictures on meshes and on trimmed surfaces: where their pixels land, and that light keeps its mean."""

import numpy as np
import pytest

from lib.maps import base_texture as bt
from lib.maps import mesh_texture as mt
from lib.nurbs.surface import bilinear
from lib.surfaces.mesh import Mesh
from tests.surfaces.trimmed_shapes import SQUARE, circle, cut_out

ROUND = 1e-6  # float32 maps
ENERGY = 1e-3  # relative, of the area mean
HALF_A_PIXEL = 2e-3  # of 200: the picture is linear between pixel centres, also across the border of a part
UNIT = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def grey(values):
    """(H, W) to (H, W, 3) float32."""
    return np.repeat(np.asarray(values, np.float32)[..., None], 3, axis=2)


def random_picture(H, W, seed=0):
    return np.random.default_rng(seed).random((H, W, 3)).astype(np.float32)


def square_mesh(T=UNIT, uv=UNIT, V=None, level=4):
    """Two triangles of a square; T, uv (4, 2) of its corners, counterclockwise from the lower left."""
    V = np.concatenate([UNIT, np.zeros((4, 1))], axis=1) if V is None else np.asarray(V, dtype=float)
    N = np.tile([0, 0, 1.0], (2, 3, 1))
    uv = None if uv is None else np.asarray(uv, float)[TWO]
    chart = None if uv is None else np.zeros(2, dtype=np.int32)
    return Mesh(V, TWO, N, np.asarray(T, float)[TWO], uv, chart, None if uv is None else level)


def read(values, uv):
    """The map values (h, w, 3) at uv (n, 2), bilinearly."""
    h, w, _ = values.shape
    x, y = uv[:, 0] * (w - 1), uv[:, 1] * (h - 1)
    i, j = np.minimum(x.astype(int), w - 2), np.minimum(y.astype(int), h - 2)
    a, b = (x - i)[:, None], (y - j)[:, None]
    low = values[j, i] * (1 - a) + values[j, i + 1] * a
    return low * (1 - b) + (values[j + 1, i] * (1 - a) + values[j + 1, i + 1] * a) * b


def mean_over(mesh, values, n=400_000):
    """Area mean of a map over a mesh, at random places."""
    rng = np.random.default_rng(7)
    A, B, C = (mesh.V[mesh.F[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(B - A, C - A), axis=1)
    face = rng.choice(len(area), n, p=area / area.sum())
    weight = rng.dirichlet([1, 1, 1], n)
    return read(values.astype(float), np.einsum("nk,nkc->nc", weight, mesh.uv[face])).mean(axis=0)


# ---- average reflectance of meshes


@pytest.mark.parametrize("shape", [(1, 1), (5, 3), (300, 400)])
@pytest.mark.parametrize("repeat", [(1, 1), (4, 2.5)])
def test_a_constant_picture_is_exact(shape, repeat):
    picture = np.broadcast_to(np.float32([0.1, 0.7, 1]), (*shape, 3))
    mesh = square_mesh(T=UNIT * 3.3 - 7, uv=None)
    assert mt.rho_average(mesh, picture, repeat).tolist() == np.float32([0.1, 0.7, 1]).astype(float).tolist()


@pytest.mark.parametrize("shape", [(1, 1), (5, 3), (100, 256), (300, 400), (1000, 1000)])
@pytest.mark.parametrize("repeat", [(1, 1), (3, 2)])
def test_average_over_whole_tiles_is_the_mean_of_the_pixels(shape, repeat):
    picture = random_picture(*shape)
    assert bt.rho_average(square_mesh(uv=None), picture, repeat) == pytest.approx(picture.mean((0, 1)), rel=ENERGY)


def test_average_is_weighted_by_area():
    """One triangle of area 3/2 on white, one of 1/2 on black."""
    V = np.array([[0, 0, 0], [3, 0, 0], [3, 1, 0], [0, 0, 1.0], [1, 0, 1], [1, 1, 1]])
    F = np.array([[0, 1, 2], [3, 4, 5]], dtype=np.int32)
    T = np.array([[[0.6, 0.1], [0.9, 0.1], [0.9, 0.9]], [[0.1, 0.1], [0.4, 0.1], [0.4, 0.9]]])
    picture = grey(np.repeat([[0, 1]], 64, axis=1).reshape(1, -1))
    average = mt.rho_average(Mesh(V, F, np.zeros((2, 3, 3)), T), picture)
    assert average == pytest.approx([0.75] * 3, abs=1e-4)


def test_average_of_many_small_triangles():
    """A sheet of 2 x 150 x 150 triangles on the inner nine tenths of a ramp from 0 to 1."""
    n = 150
    x, y = (a.ravel() / n for a in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
    lower = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    F = np.concatenate(
        [np.stack([lower, lower + 1, lower + n + 2], 1), np.stack([lower, lower + n + 2, lower + n + 1], 1)]
    )
    mesh = Mesh(np.stack([x**2, y, 0 * x], 1), F, None, 0.05 + 0.9 * np.stack([x, y], 1)[F])  # area density 2 x
    ramp = grey((np.arange(256)[None] + 0.5) / 256)
    assert mt.rho_average(mesh, ramp) == pytest.approx([0.05 + 0.9 * 2 / 3] * 3, rel=ENERGY / 10)


# ---- pictures on the maps of meshes


def test_a_mesh_that_is_its_map_shows_what_a_rectangle_shows():
    surface = bilinear([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0])
    for shape in [(8, 8), (20, 30)]:
        picture = random_picture(*shape)
        on_mesh, outside = bt.on_map(square_mesh(), picture, (1, 1), 65, 65)
        on_surface, _ = bt.on_map(surface, picture, (1, 1), 65, 65)
        assert not outside.any()
        inside = np.s_[4:-4, 4:-4]  # the picture of a mesh repeats over its border
        assert np.allclose(on_mesh[inside], on_surface[inside], atol=ROUND)


def test_a_turned_picture_by_hand():
    """T turned by 90 degrees against (u, v): T = (v, 1 - u).  The letter's pixels, top row first:
    1 .5
    0 .25    at T (1/4, 3/4) 1, (3/4, 3/4) .5, (1/4, 1/4) 0, (3/4, 1/4) .25.
    """
    mesh = square_mesh(T=np.stack([UNIT[:, 1], 1 - UNIT[:, 0]], axis=1))
    rho = bt.on_map(mesh, grey([[1, 0.5], [0, 0.25]]), (1, 1), 5, 5)[0][..., 0]
    assert rho[1, 1] == pytest.approx(1)  # u 1/4, v 1/4: T (1/4, 3/4)
    assert rho[3, 1] == pytest.approx(0.5)  # u 1/4, v 3/4: T (3/4, 3/4)
    assert rho[1, 3] == pytest.approx(0)  # u 3/4, v 1/4: T (1/4, 1/4)
    assert rho[3, 3] == pytest.approx(0.25)
    assert rho[2, 2] == pytest.approx(1.75 / 4)
    assert rho[1, 2] == pytest.approx(0.5)  # T (1/4, 1/2), between 1 and 0
    assert rho[2, 0] == pytest.approx((1 + 0.5 + 0 + 0.25) / 4)  # T (1/2, 1): the next tile's lower row


LETTER = np.array(["#######.", "#.......", "#.......", "####....", "#.......", "#.......", "#.......", "#......."])


def test_letters_are_not_mirrored():
    """An F on a chart in the middle of the map is still one, and the chart's surroundings are outside."""
    picture = grey([[float(c == "#") for c in row] for row in LETTER])
    mesh = square_mesh(uv=0.25 + UNIT / 2)
    rho, outside = bt.on_map(mesh, picture, (1, 1), 65, 65)
    centres = (16 + 32 * (np.arange(8) + 0.5) / 8).astype(int)
    assert np.array_equal(rho[np.ix_(centres[::-1], centres)][..., 0], picture[..., 0])
    assert not outside[16:49, 16:49].any() and outside[:15].all() and outside[:, 51:].all()
    assert not rho[outside].any()
    tiled = bt.on_map(mesh, picture, (2, 2), 65, 65)[0]
    centres = (16 + 16 * (np.arange(8) + 0.5) / 8).astype(int)
    for j in (0, 16):
        for i in (0, 16):
            assert np.array_equal(tiled[np.ix_(j + centres[::-1], i + centres)][..., 0], picture[..., 0])


def test_a_fine_picture_is_averaged_over_the_spacing():
    """A chessboard of single pixels on a coarse map is grey; on a map fine enough it is a chessboard."""
    board = grey(np.indices((256, 256)).sum(axis=0) % 2)
    coarse = bt.on_map(square_mesh(), board, (1, 1), 33, 33)[0]
    assert coarse == pytest.approx(0.5, abs=ROUND)
    fine = bt.on_map(square_mesh(), board, (1, 1), 513, 513)[0][..., 0]
    assert fine[1:-1:2, 1:-1:2] == pytest.approx(board[::-1, :, 0], abs=ROUND)  # crossings on pixel centres


def test_crossings_beside_a_chart_hold_its_border():
    """Two charts, one all white, one all black, of a picture that is white on its left half."""
    picture = grey([[1.0] * 8 + [0.0] * 8])
    corners = np.concatenate([UNIT, UNIT + [3, 0]])
    V = np.concatenate([corners, np.zeros((8, 1))], axis=1)
    F = np.concatenate([TWO, TWO + 4])
    uv = np.concatenate([0.05 + 0.4 * UNIT, [0.53, 0.05] + 0.4 * UNIT])
    T = np.concatenate([[0.1, 0.1] + 0.2 * UNIT, [0.7, 0.1] + 0.2 * UNIT])
    mesh = Mesh(V, F, np.zeros((4, 3, 3)), T[F], uv[F], np.array([0, 0, 1, 1], dtype=np.int32), 6)
    rho, outside = bt.on_map(mesh, picture, (1, 1), 65, 65)
    u = np.arange(65) / 64
    rows = ~outside.all(axis=1)
    assert set(np.unique(rho)) == {0, 1}
    assert (rho[rows][:, u < 0.47] == 1).sum() == (~outside[rows][:, u < 0.47]).sum() * 3
    assert not rho[:, u > 0.51].any() and (~outside[:, u > 0.51]).any()


@pytest.mark.parametrize("shape", [(5, 3), (120, 80), (700, 500)])
@pytest.mark.parametrize("repeat", [(1, 1), (3, 2)])
def test_even_light_keeps_its_mean_on_a_mesh(shape, repeat):
    """A quadrilateral whose triangles are of different sizes, T sheared over it."""
    V = [[0, 0, 0], [2, 0, 0], [1.5, 1, 0.5], [0, 2, 0.3]]
    mesh = square_mesh(T=[[0, 0], [1, 0.2], [1.1, 1.2], [0.1, 1]], uv=0.05 + 0.9 * UNIT, V=V)
    picture = random_picture(*shape)
    rho_avg = bt.rho_average(mesh, picture, repeat)
    rho, outside = bt.on_map(mesh, picture, repeat, 513, 513)
    final = bt.apply(np.where(outside[..., None], 0, np.full((513, 513, 3), 2.5, np.float32)), rho, rho_avg)
    assert mean_over(mesh, final) == pytest.approx([2.5] * 3, rel=2 * ENERGY)  # 400 000 places: half of it noise


@pytest.mark.parametrize(
    "size, T, level, cap, expected",
    [
        ((512, 512), UNIT, 3, 10, 9),  # as a rectangle's
        ((513, 1), UNIT, 3, 10, 9),
        ((514, 1), UNIT, 3, 10, 10),
        ((512, 512), UNIT / 4, 3, 10, 7),
        ((512, 512), UNIT * 4, 3, 10, 10),  # the cap decides
        ((1, 1), UNIT, 0, 10, 2),  # charts stay apart
        ((1, 1), UNIT, 6, 10, 6),  # the light decides
        ((1, 1), UNIT, 6, 2, 6),
        ((512, 512), 0 * UNIT, 0, 10, 2),  # one colour
        ((512, 512), UNIT, 0, 1, 1),
    ],
)
def test_common_level_of_a_mesh(size, T, level, cap, expected):
    assert bt.level_on_map(square_mesh(T=T), (1, 1), level, size, (1, 1), cap) == expected


# ---- trimmed surfaces


def sheet():
    return bilinear([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0])


def cropped_sheet(u0, u1, v0, v1):
    """The part of the sheet over a box, trimmed along its border."""
    base = bilinear([u0, v0, 0], [u1, v0, 0], [u1, v1, 0], [u0, v1, 0])
    trim = cut_out(base, [SQUARE])
    return type(trim)(base, np.array([u0, u1, v0, v1]), trim.uv, trim.loop_start, trim.S, trim.significance)


TRIANGLE = cut_out(sheet(), [np.array([[0, 0], [1, 0], [0, 1.0]])])
HALVES = grey([[0.0] * 200 + [1.0] * 200])


def test_average_of_a_trimmed_surface_is_of_its_inside():
    assert bt.rho_average(TRIANGLE, HALVES) == pytest.approx([0.25] * 3, abs=ENERGY)
    ring = cut_out(sheet(), [SQUARE, circle([0.5, 0.5], 0.3, 200, is_hole=True)])
    inner = grey(np.hypot(*(np.indices((1000, 1000)) + 0.5 - 500)) < 300)  # white in the hole
    assert bt.rho_average(ring, inner) == pytest.approx([0] * 3, abs=2 * ENERGY)
    disc = cut_out(sheet(), [circle([0.5, 0.5], 0.3, 200)])
    assert bt.rho_average(disc, inner) == pytest.approx([1] * 3, abs=2 * ENERGY)
    constant = np.full((7, 5, 3), 0.3, np.float32)
    assert bt.rho_average(ring, constant).tolist() == [float(np.float32(0.3))] * 3


def test_the_box_chooses_the_part_of_the_picture():
    assert bt.rho_average(cropped_sheet(0, 0.5, 0, 1), HALVES) == pytest.approx([0] * 3, abs=HALF_A_PIXEL)
    assert bt.rho_average(cropped_sheet(0.5, 1, 0, 0.3), HALVES) == pytest.approx([1] * 3, abs=HALF_A_PIXEL)
    assert bt.rho_average(cropped_sheet(0.25, 1, 0, 1), HALVES) == pytest.approx([2 / 3] * 3, abs=HALF_A_PIXEL)
    assert bt.rho_average(cropped_sheet(0, 0.5, 0, 1), HALVES, (2, 1)) == pytest.approx([0.5] * 3, abs=HALF_A_PIXEL)


@pytest.mark.parametrize("shape", [(16, 16), (512, 512)])  # coarser and finer than the map
@pytest.mark.parametrize("repeat", [(1, 1), (2, 1)])
def test_a_part_shows_what_the_whole_shows_there(shape, repeat):
    picture = random_picture(*shape)
    whole = bt.on_map(sheet(), picture, repeat, 129, 129)[0]
    part = bt.on_map(cropped_sheet(0.25, 0.5, 0.5, 1), picture, repeat, 33, 65)[0]
    inside = np.s_[1:-1, 1:-1]  # boxes are cut off at the part's border
    assert np.allclose(part[inside], whole[64:129, 32:65][inside], atol=ROUND)


def test_a_box_over_the_seam_goes_round():
    picture = grey([[0, 1, 0.5, 0.25]])
    rho = bt.evaluate_picture(picture, (1, 1), 5, 2, (True, False), box=(0.875, 1.375, 0, 1))[0, :, 0]
    assert rho == pytest.approx([0.25, 0.125, 0, 0.5, 1])  # u = 7/8, 1, 1/8, 1/4, 3/8


@pytest.mark.parametrize("shape", [(5, 3), (120, 80), (700, 500)])
def test_even_light_keeps_its_mean_inside_the_loops(shape):
    picture = random_picture(*shape)
    rho_avg = bt.rho_average(TRIANGLE, picture)
    rho, outside = bt.on_map(TRIANGLE, picture, (1, 1), 513, 513)
    assert not outside.any()
    final = bt.apply(np.full(rho.shape, 2.5, np.float32), rho, rho_avg)
    middle = (np.arange(512) + 0.5) / 512
    u, v = np.meshgrid(middle, middle)
    inside = u + v < 1
    mean = read(final.astype(float), np.stack([u[inside], v[inside]], axis=1)).mean(axis=0)
    assert mean == pytest.approx([2.5] * 3, rel=ENERGY)


def test_common_level_of_a_part():
    """A quarter of the picture's width and half of its height are on this map."""
    part = cropped_sheet(0.25, 0.5, 0.5, 1)
    assert bt.level_on_map(part, (1, 1), 3, (1024, 512), (1, 1)) == 8
    assert bt.level_on_map(part, (1, 1), 3, (1024, 514), (1, 1)) == 8
    assert bt.level_on_map(part, (1, 1), 3, (1032, 512), (1, 1)) == 9
