"""Form factors from a point to polygons: published values, closed forms, and numeric integration where they are cut."""

import numpy as np
import pytest

from lib.radiosity.emitters import Facets
from lib.radiosity.form_factors import FAR, disc, form_factor_facets, form_factor_polygon
from tests.radiosity import plain_form_factors
from tests.tolerances import EXACT

UP = np.array([[0.0, 0, 1]])
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


def polygon(vertices, n=UP, x=(0, 0, 0)):
    return float(form_factor_polygon((np.asarray(vertices, float) - x)[None], np.atleast_2d(np.asarray(n, float)))[0])


def corner_above(a, b, c):
    """Rectangle a x b parallel to the receiver at distance c, one corner straight above it (Howell, B-3)."""
    A, B = a / c, b / c
    root_a, root_b = np.sqrt(1 + A * A), np.sqrt(1 + B * B)
    return (A / root_a * np.arctan(B / root_a) + B / root_b * np.arctan(A / root_b)) / (2 * np.pi)


def corner_beside(width, height, distance):
    """Rectangle standing on the receiver's plane, the corner of its foot straight ahead at `distance` (Howell, B-4)."""
    root = np.hypot(distance, height)
    return (np.arctan(width / distance) - distance / root * np.arctan(width / root)) / (2 * np.pi)


def facets_of_grid(n, size, z, facing=-1.0):
    """n x n squares of side size / n in the plane z, centred above the origin."""
    step = size / n
    j, i = (a.ravel() for a in np.indices((n, n)))
    origin = np.stack([i * step - size / 2, j * step - size / 2, np.full(n * n, z)], axis=1)
    e1, e2 = np.tile([step, 0, 0], (n * n, 1)), np.tile([0, step, 0], (n * n, 1))
    normal = np.tile([0, 0, facing], (n * n, 1))
    one = np.ones(n * n)
    return Facets(origin, e1, e2, np.zeros(n * n, bool), normal, step * step * one, one)


def by_integration(vertices, n, steps=600):
    """The same of a parallelogram by the midpoint rule over cos cos' / (pi r^2), the horizon cut sample by sample."""
    A, B, _, D = np.asarray(vertices, float)
    t = (np.arange(steps) + 0.5) / steps
    y = A + t[:, None, None] * (B - A) + t[None, :, None] * (D - A)
    cross = np.cross(B - A, D - A)
    r2 = (y**2).sum(axis=2)
    g = np.maximum(y @ n, 0) * np.abs(y @ cross) / (np.pi * r2**2)
    return g.mean()


def test_point_to_facing_unit_square():
    F = polygon(SQUARE - [0.5, 0.5, -1])
    assert F == pytest.approx(0.2395, abs=5e-5)
    assert F == pytest.approx(4 * corner_above(0.5, 0.5, 1), rel=EXACT)


def test_point_to_perpendicular_unit_square():
    """The point 0.1 from the middle of the shared edge."""
    standing = [[0.1, -0.5, 0], [0.1, 0.5, 0], [0.1, 0.5, 1], [0.1, -0.5, 1]]
    assert polygon(standing) == pytest.approx(0.4225, abs=5e-5)
    assert polygon(standing) == pytest.approx(2 * corner_beside(0.5, 1, 0.1), rel=EXACT)


@pytest.mark.parametrize("seed", range(5))
def test_rectangles_against_the_closed_form(seed):
    a, b, c = np.random.default_rng(seed).uniform(0.1, 5, 3)
    assert polygon(SQUARE * [a, b, 1] + [0, 0, c]) == pytest.approx(corner_above(a, b, c), rel=1e-10)


@pytest.mark.parametrize(
    "source, normal, expected",
    [
        (lambda x, y: SQUARE + [-x, -y, 1], UP, 0.19982),
        (lambda x, y: np.array([[-x, -y, 0], [-x, 1 - y, 0], [-x, 1 - y, 1], [-x, -y, 1]]), UP, 0.20004),
    ],
    ids=["facing", "perpendicular"],
)
def test_square_to_square(source, normal, expected):
    """Means over the receiving unit square; Gauss nodes crowd at the shared edge, where F jumps to 1/2."""
    t, weight = np.polynomial.legendre.leggauss(24)
    t, weight = (t + 1) / 2, weight / 2
    F = sum(
        wx * wy * polygon(source(x, y), normal)
        for x, wx in zip(t, weight, strict=True)
        for y, wy in zip(t, weight, strict=True)
    )
    assert F == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("seed", range(20))
def test_what_lies_below_the_horizon_is_cut_away(seed):
    """Parallelograms anywhere, most of them crossing the receiver's plane."""
    rng = np.random.default_rng(seed)
    A, B, D = rng.uniform(-1, 1, (3, 3)) + 1.5 * rng.normal(size=3)
    vertices = np.array([A, B, B + D - A, D])
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    F = polygon(vertices, n)
    assert F == pytest.approx(by_integration(vertices, n), abs=5e-4, rel=5e-3)
    assert 0 <= F <= 1


def test_below_the_horizon_is_nothing():
    assert polygon(SQUARE - [0.5, 0.5, 1]) == 0
    assert polygon(SQUARE - [0.5, 0.5, 0]) == 0  # in the receiver's own plane
    assert polygon(SQUARE + [1, 1, -1e-12]) == 0


def test_order_of_the_vertices_does_not_matter():
    hull = SQUARE * [1, 2, 0] + [0.3, -0.4, 1]
    assert polygon(hull) == pytest.approx(polygon(hull[::-1]), rel=EXACT)
    assert polygon(hull) == pytest.approx(polygon(np.roll(hull, 2, axis=0)), rel=EXACT)


def test_repeated_vertices_are_a_triangle():
    A, B, C = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1.0]])
    triangle = polygon([A, B, C, C])
    assert triangle == polygon([A, B, C])
    other = polygon([B, B + C - A, C, C])
    assert triangle + other == pytest.approx(polygon([A, B, B + C - A, C]), rel=1e-10)


def test_a_whole_sky_is_one():
    assert polygon((SQUARE - [0.5, 0.5, 0]) * 2e6 + [0, 0, 1]) == pytest.approx(1, abs=1e-5)


def test_edges_and_corners_of_a_closed_box_see_everything():
    """The point a hair inside of an edge of a unit box: the other five walls fill its hemisphere."""
    walls = [SQUARE + [0, 0, 1], SQUARE[:, [0, 2, 1]], SQUARE[:, [0, 2, 1]] + [0, 1, 0]]
    walls += [SQUARE[:, [2, 0, 1]], SQUARE[:, [2, 0, 1]] + [1, 0, 0]]
    for x in ([0.5, 0.5, 0], [0.002, 0.5, 0], [0.002, 0.002, 0], [1e-6, 1e-6, 0]):
        assert sum(polygon(w, UP, x) for w in walls) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("place", [[0, 0, 0], [0.5, 0, 0], [0.5, 0.5, 0], [1e-12, 0, 0]])
def test_a_point_on_the_polygon_is_finite(place):
    for n in np.eye(3):
        assert 0 <= polygon(SQUARE, n, place) <= 1


def around(facing, least, most, n=3000):
    """Points from which the unit square that looks along `facing` lies at D, wholly above the horizon: (D, corners)."""
    rng = np.random.default_rng(4)
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    D = direction * rng.uniform(least, most, (n, 1))
    flat = SQUARE - [0.5, 0.5, 0]
    if facing[0]:
        flat, D[:, 0] = flat[:, [2, 0, 1]], -np.abs(D[:, 0])
    above = ((D[:, None] + flat)[..., 2].min(axis=1) > 0) & (np.abs(direction @ facing) > 0.05)
    return D[above], flat


@pytest.mark.parametrize("facing", [[0, 0, -1], [1, 0, 0]])
def test_disc_is_the_polygon_from_afar(facing):
    """In any direction, grazing ones too."""
    D, flat = around(facing, FAR, 3 * FAR)
    F = np.array([disc(*d, *UP[0], *facing, 1.0) for d in D])
    exact = form_factor_polygon(D[:, None] + flat, np.repeat(UP, len(D), axis=0))
    assert len(D) > 500 and np.abs(F / exact - 1).max() < 1e-3


@pytest.mark.parametrize("is_triangle", [False, True])
@pytest.mark.parametrize("facing", [[0, 0, -1], [1, 0, 0]])
def test_no_distance_is_less_exact(facing, is_triangle):
    """The polygon's value at all distances and in all directions: discs alone are 0.5 % low at 8, seen aside."""
    D, flat = around(facing, 2.0, 100.0)
    facets = Facets(
        flat[:1], flat[1:2] - flat[0], flat[3:] - flat[0], np.array([is_triangle]), np.array([facing], float),
        np.array([0.5 if is_triangle else 1.0]), np.ones(1),
    )  # fmt: skip
    N = np.repeat(UP, len(D), axis=0)
    exact = form_factor_polygon(D[:, None] + facets.corners()[0], N)
    ratio = form_factor_facets(-D, N, facets)[:, 0] / exact
    assert abs(ratio.mean() - 1) < 2e-4 and np.abs(ratio - 1).max() < 3e-3


def test_disc_on_its_axis():
    """A = pi, straight above at 1: 1 / 2."""
    up, down = UP[0], -UP[0]
    assert np.pi * disc(0, 0, 1.0, *up, *down, np.pi) == pytest.approx(0.5, rel=EXACT)
    assert disc(0, 0, 1.0, *up, *up, np.pi) == disc(0, 0, -1.0, *up, *down, np.pi) == disc(0, 0, 0, *up, *down, 1) == 0


@pytest.mark.parametrize("spacings", [0.01, 0.1, 0.5, 1, 2, 4])
def test_receivers_close_to_a_divided_source(spacings):
    """16 x 16 facets, the receiver 0.01 to 4 of their sides below: 1 % of the undivided square, never above 1."""
    facets = facets_of_grid(16, 1.0, 0.0)
    x = np.random.default_rng(5).uniform(-0.6, 0.6, (50, 3))
    x[:, 2] = -spacings / 16
    N = np.repeat(UP, 50, axis=0)
    F = form_factor_facets(x, N, facets).sum(axis=1)
    whole = form_factor_polygon((SQUARE - [0.5, 0.5, 0])[None] - x[:, None], N)
    assert F == pytest.approx(whole, rel=0.01, abs=1e-9)
    assert F.max() <= 1 + 1e-9


def test_facets_have_one_side():
    x, N = np.array([[0.0, 0, -0.1], [0, 0, -30], [0, 0, 0.1]]), np.array([[0.0, 0, 1], [0, 0, 1], [0, 0, -1]])
    assert (form_factor_facets(x, N, facets_of_grid(2, 1.0, 0.0, facing=1.0))[:2] == 0).all()
    assert (form_factor_facets(x, N, facets_of_grid(2, 1.0, 0.0, facing=-1.0))[2] == 0).all()
    assert (form_factor_facets(x, N, facets_of_grid(2, 1.0, 0.0, facing=-1.0))[:2] > 0).all()


def test_scale_changes_nothing():
    vertices = SQUARE * [1, 2, 0] + [0.3, -0.4, 1]
    for scale in (1e-6, 1e6):
        assert polygon(vertices * scale) == pytest.approx(polygon(vertices), rel=1e-10)


@pytest.mark.parametrize("size", [0.003, 0.02, 0.1, 0.5])
def test_points_and_facets_one_by_one_as_all_at_once(size):
    """Parallelograms and triangles of all attitudes, at all distances, above, below and across the horizon."""
    rng = np.random.default_rng(12)
    k, m = 40, 500
    origin, e1, across = rng.random((k, 3)), size * rng.normal(size=(k, 3)), rng.normal(size=(k, 3))
    e2 = np.cross(across, e1) * rng.random((k, 1))
    normal, area = np.cross(e1, e2), np.linalg.norm(np.cross(e1, e2), axis=1)
    is_triangle = rng.random(k) < 0.5
    facets = Facets(
        origin, e1, e2, is_triangle, normal / area[:, None], area * np.where(is_triangle, 0.5, 1.0), np.ones(k)
    )
    x, n = rng.random((m, 3)), rng.normal(size=(m, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    F = form_factor_facets(x, n, facets)
    assert np.abs(F - plain_form_factors.form_factor_facets(x, n, facets)).max() < EXACT
    assert (F > 0).mean() > 0.1


def test_no_facets_and_no_points():
    none = np.zeros((0, 3))
    facets = Facets(none, none, none, np.zeros(0, dtype=bool), none, np.zeros(0), np.zeros(0))
    assert form_factor_facets(UP, UP, facets).shape == (1, 0)
    assert form_factor_facets(none, none, facets_of_grid(2, 1.0, 0.0)).shape == (0, 4)
