"""Points, derivatives and normals against worked pages, closed forms and geomdl."""

import numpy as np
import pytest

from lib.nurbs import model
from lib.nurbs.evaluate import basis, densities, evaluate, evaluate_grid, frame, frame_grid, normal, point, span
from lib.nurbs.surface import NurbsSurface, bezier, bilinear, from_points
from tests.shapes import cylinder, disc, extruded, rectangle, revolved, sphere, triangle
from tests.tolerances import EXACT, LIMIT

BOOK_KNOTS = np.array([0, 0, 0, 1, 2, 3, 4, 4, 5, 5, 5], dtype=float)  # The NURBS Book, p. 68
U, V = np.random.default_rng(2).uniform(size=(2, 50))


def random_surface(seed, rational=True):
    """Degrees 1 to 4, uneven knots with repeated ones, weights from 0.2 to 5."""
    rng = np.random.default_rng(seed)
    degree, n = rng.integers(1, 5, 2), rng.integers(5, 9, 2)
    knots = []
    for p, k in zip(degree, n, strict=True):
        inner = np.sort(rng.choice(np.linspace(0.1, 0.9, 9), k - p - 1, replace=p > 2))
        values, counts = np.unique(inner, return_counts=True)
        inner = np.repeat(values, np.minimum(counts, p))
        inner = np.sort(np.concatenate([inner, 0.05 + 0.001 * np.arange(k - p - 1 - len(inner))]))
        knots.append(np.concatenate([np.zeros(p + 1), inner, np.ones(p + 1)]))
    w = rng.uniform(0.2, 5, n) if rational else None
    return from_points(int(degree[0]), int(degree[1]), *knots, rng.uniform(-1, 1, (*n, 3)), w)


def paraboloid():
    """x = u, y = v, z = u^2 + v^2."""
    t = np.array([0, 0.5, 1])
    P = np.zeros((3, 3, 3))
    P[..., 0], P[..., 1] = t[:, None], t[None]
    P[..., 2] = np.array([0, 0, 1])[:, None] + np.array([0, 0, 1])[None]
    return bezier(P)


def quarter_tube(height=2.0):
    """x = (1 - u^2) / (1 + u^2), y = 2 u / (1 + u^2), z = height v."""
    arc = np.array([[1, 0], [1, 1], [0, 1]], dtype=float)
    P = np.zeros((3, 2, 3))
    P[..., :2] = arc[:, None]
    P[:, 1, 2] = height
    return bezier(P, np.array([1.0, 1.0, 2.0])[:, None] * np.ones(2))


def test_basis_of_the_book():
    """p. 68-69: span 4 and 1/8 6/8 1/8 at 5/2; derivatives -1/2 0 1/2 of (3 - u)^2 / 2, ..., (u - 2)^2 / 2."""
    k, N, dN = basis(BOOK_KNOTS, 2, 8, np.array([2.5]))
    assert k.tolist() == [4]
    assert N.tolist() == [[1 / 8, 6 / 8, 1 / 8]]
    assert dN.tolist() == [[-0.5, 0.0, 0.5]]


def test_span_holds_its_parameter_and_is_never_empty():
    u = np.concatenate([np.linspace(0, 5, 101), BOOK_KNOTS])
    k = span(BOOK_KNOTS, 2, 8, u)
    assert ((BOOK_KNOTS[k] <= u) & (u <= BOOK_KNOTS[k + 1]) & (BOOK_KNOTS[k] < BOOK_KNOTS[k + 1])).all()
    assert span(BOOK_KNOTS, 2, 8, np.array([4.0, 5.0])).tolist() == [7, 7]


@pytest.mark.parametrize("seed", range(8))
def test_basis_is_a_partition_of_unity(seed):
    s = random_surface(seed)
    _, N, dN = basis(s.knots_u, s.degree_u, len(s.Pw), np.concatenate([U, s.knots_u]))
    assert (N >= 0).all()
    assert np.abs(N.sum(axis=1) - 1).max() < EXACT
    assert np.abs(dN.sum(axis=1)).max() < EXACT * np.abs(dN).max()


def test_rational_quarter_circle_keeps_its_radius():
    S, S_u, _ = evaluate(quarter_tube(), np.linspace(0, 1, 1001), np.zeros(1001))
    assert np.abs(np.hypot(S[:, 0], S[:, 1]) - 1).max() < EXACT
    assert np.abs((S[:, :2] * S_u[:, :2]).sum(axis=1)).max() < EXACT


def test_derivatives_of_a_paraboloid():
    S, S_u, S_v = evaluate(paraboloid(), U, V)
    one, none = np.ones_like(U), np.zeros_like(U)
    assert np.abs(S - np.stack([U, V, U**2 + V**2], axis=1)).max() < EXACT
    assert np.abs(S_u - np.stack([one, none, 2 * U], axis=1)).max() < EXACT
    assert np.abs(S_v - np.stack([none, one, 2 * V], axis=1)).max() < EXACT
    expected = np.stack([-2 * U, -2 * V, one], axis=1) / np.sqrt(1 + 4 * U**2 + 4 * V**2)[:, None]
    assert np.abs(normal(paraboloid(), U, V) - expected).max() < EXACT


def test_derivatives_of_a_rational_arc():
    _, S_u, S_v = evaluate(quarter_tube(height=2.0), U, V)
    expected = np.stack([-4 * U, 2 * (1 - U**2), 0 * U], axis=1) / (1 + U[:, None] ** 2) ** 2
    assert np.abs(S_u - expected).max() < EXACT
    assert np.abs(S_v - [0, 0, 2.0]).max() < EXACT


@pytest.mark.parametrize("seed", range(12))
def test_agrees_with_geomdl(seed):
    surface = random_surface(seed, rational=seed % 3 > 0)
    shape = model.to_geomdl(surface)
    u, v = np.append(U[:12], [0, 1, 0, 1]), np.append(V[:12], [0, 0, 1, 1])
    S, S_u, S_v = evaluate(surface, u, v)
    oracle = np.array(
        [np.array(shape.derivatives(a, b, order=1))[[0, 1, 0], [0, 0, 1]] for a, b in zip(u, v, strict=True)]
    )
    size = np.abs(oracle).max(axis=(0, 2))
    assert np.abs(S - oracle[:, 0]).max() < EXACT * size[0]
    assert np.abs(S_u - oracle[:, 1]).max() < 10 * EXACT * size[1]
    assert np.abs(S_v - oracle[:, 2]).max() < 10 * EXACT * size[2]


@pytest.mark.parametrize("seed", range(4))
def test_grid_and_scattered_points_are_the_same(seed):
    surface, u, v = random_surface(seed), np.linspace(0, 1, 7), np.linspace(0, 1, 5)
    uu, vv = (a.ravel() for a in np.meshgrid(u, v))
    for grid, scattered in zip(evaluate_grid(surface, u, v), evaluate(surface, uu, vv), strict=True):
        assert grid.shape == (5, 7, 3)
        assert np.abs(grid.reshape(-1, 3) - scattered).max() < EXACT * np.abs(scattered).max()
    for grid, scattered in zip(frame_grid(surface, u, v), frame(surface, uu, vv), strict=True):
        assert np.abs(grid.reshape(-1, 3) - scattered).max() < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_knots_and_weights_do_not_move_the_points(seed):
    surface = random_surface(seed)
    expected = point(surface, U, V)
    finer = model.with_knots(surface, u=[0.123, 0.77], v=[0.456])
    heavier = from_points(
        surface.degree_u,
        surface.degree_v,
        1000 * surface.knots_u - 3,
        1e-6 * surface.knots_v,
        surface.P,
        7.3e5 * surface.w,
    )
    for other in (finer, heavier):
        assert np.abs(point(other, U, V) - expected).max() < EXACT


def test_degree_elevation_does_not_move_the_points():
    surface = quarter_tube()
    assert np.abs(point(model.elevated(model.elevated(surface)), U, V) - point(surface, U, V)).max() < EXACT


def test_ends_are_exact_control_points():
    surface = random_surface(3)
    corners = point(surface, np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1]))
    expected = surface.P[[0, -1, -1, 0], [0, 0, -1, -1]]
    assert np.abs(corners - expected).max() < EXACT


def test_knots_repeated_beyond_the_degree_at_the_ends():
    """Zero-length spans: p + 2 equal knots leave the first and last control points unused, without 0/0."""
    line = np.array([[9, 9, 9], [0, 0, 0], [1, 0, 0], [2, 0, 0], [-9, 9, 9]], dtype=float)
    P = np.stack([line, line + [0, 1, 0]], axis=1)
    surface = from_points(2, 1, [0, 0, 0, 0, 1, 1, 1, 1], [0, 0, 1, 1], P)
    S, S_u, _ = evaluate(surface, np.array([0, 0.5, 1]), np.zeros(3))
    assert np.abs(S - [[0, 0, 0], [1, 0, 0], [2, 0, 0]]).max() < EXACT
    assert np.abs(S_u - [2, 0, 0]).max() < EXACT


def test_unclamped_uniform_knots():
    """A uniform cubic B-spline at a knot: 1/6, 4/6, 1/6 of its control points (The NURBS Book, section 2.4)."""
    x = np.array([0, 1, 4, 9, 16], dtype=float)
    P = np.zeros((5, 2, 3))
    P[..., 0], P[:, 1, 1] = x[:, None], 1
    surface = from_points(3, 1, np.arange(9), [0, 0, 1, 1], P)
    S = point(surface, np.array([0, 0.5, 1]), np.zeros(3))
    expected = [(x[k] + 4 * x[k + 1] + x[k + 2]) / 6 for k in range(3)]
    assert np.abs(S[:, 0] - expected).max() < EXACT


def test_crease_has_exact_points_and_a_normal_of_one_side():
    """Two walls of a corner: the crease at u = 1/2 takes the side it begins."""
    corner = extruded([[0, 0], [1, 0], [1, 1]], 1.0)
    S, N = frame(corner, np.array([0.25, 0.5, 0.75]), np.full(3, 0.5))
    assert np.abs(S[1] - [1, 0, 0.5]).max() < EXACT
    assert np.abs(N - [[0, -1, 0], [1, 0, 0], [1, 0, 0]]).max() < EXACT
    smooth = extruded([[0, 0], [1, 0], [1, 0], [1, 1]], 1.0, knots=[0, 0, 0, 0.5, 1, 1, 1], degree=2)
    assert np.abs(np.linalg.norm(normal(smooth, np.linspace(0, 1, 9), np.full(9, 0.5)), axis=1) - 1).max() < EXACT


def test_normals_at_the_poles_of_a_sphere():
    u = np.linspace(0, 1, 33)
    for radius in (1e-6, 1.0, 1e6):
        N = normal(sphere(radius), np.tile(u, 2), np.repeat([0.0, 1.0], 33))
        assert np.abs(N[:33] - [0, 0, -1]).max() < LIMIT
        assert np.abs(N[33:] - [0, 0, 1]).max() < LIMIT


def test_normals_of_a_sphere_are_its_points():
    assert np.abs(normal(sphere(), U, V) - point(sphere(), U, V)).max() < 1e-9


def test_normals_at_the_tip_of_a_cone():
    """Radius 1, height 2: the normal at the tip is that of the line it ends, (2 cos, 2 sin, 1) / sqrt 5."""
    cone = revolved([[1, 0], [0, 2]], [1, 1], 1, [0, 0, 1, 1])
    u = np.linspace(0, 1, 17)
    foot = point(cone, u, np.zeros(17))
    expected = np.stack([2 * foot[:, 0], 2 * foot[:, 1], np.ones(17)], axis=1) / np.sqrt(5)
    assert np.abs(normal(cone, u, np.ones(17)) - expected).max() < LIMIT


def test_normals_of_flat_poles():
    u = np.linspace(0, 1, 17)
    assert np.abs(normal(disc(), u, np.zeros(17)) - [0, 0, -1]).max() < LIMIT
    ABC = triangle([0, 0, 0], [1, 0, 0], [0, 1, 0])
    assert np.abs(normal(ABC, u, np.ones(17)) - [0, 0, 1]).max() < LIMIT


def test_normal_where_control_points_are_doubled():
    """S_v vanishes along v = 0 as v, and at a pole of two equal rows S_u x S_v as v^3; the limits are those inside."""
    P = paraboloid().P.copy()
    P[:, 1] = P[:, 0]  # y = v^2, z = u^2 + v^2: the plane-like sheet z = u^2 + y
    expected = np.stack([-2 * U, -np.ones_like(U), np.ones_like(U)], axis=1)
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    assert np.abs(normal(bezier(P), U, np.zeros_like(U)) - expected).max() < LIMIT
    flat = revolved([[0, 0], [0, 0], [1, 0]], [1, 1, 1], 2, [0, 0, 0, 1, 1, 1])
    assert np.abs(normal(flat, U, np.zeros_like(U)) - [0, 0, -1]).max() < LIMIT


def test_a_curve_has_no_normal():
    with pytest.raises(ValueError, match="no normal at u = 0.5"):
        normal(bilinear([0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0]), np.array([0.5]), np.array([0.5]))


def test_thin_and_distant_surfaces_have_normals():
    thin = bilinear([0, 0, 0], [1, 0, 0], [1, 1e-6, 0], [0, 1e-6, 0])
    assert np.abs(normal(thin, U, V) - [0, 0, 1]).max() < LIMIT
    far = NurbsSurface(
        1, 1, [0, 0, 1, 1], [0, 0, 1, 1], bilinear([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]).Pw + [1e5, 1e5, 1e5, 0]
    )
    assert np.abs(normal(far, U, V) - [0, 0, 1]).max() < LIMIT


def test_many_points_are_evaluated_in_pieces():
    u = np.linspace(0, 1, 40001)
    S = point(cylinder(2.0, 3.0), u, u)
    assert np.abs(np.hypot(S[:, 0], S[:, 1]) - 2).max() < 2 * EXACT
    assert np.abs(S[:, 2] - 3 * u).max() < 3 * EXACT


def test_no_points_are_no_points():
    assert point(sphere(), np.zeros(0), np.zeros(0)).shape == (0, 3)
    assert normal(sphere(), np.zeros(0), np.zeros(0)).shape == (0, 3)


def test_densities_are_the_lengths_of_derivatives_and_of_their_product():
    turned = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    u, v = np.random.default_rng(4).uniform(0.05, 0.95, (2, 50))
    for surface in (sphere(), rectangle([1, 2, 3], *(turned[:2] * [[2], [5]]))):
        _, S_u, S_v = evaluate(surface, u, v)
        expected = [np.linalg.norm(x, axis=1) for x in (np.cross(S_u, S_v), S_u, S_v)]
        assert densities(surface, u, v) == pytest.approx(np.stack(expected, axis=1), rel=1e-12)
    assert densities(surface, u, v) == pytest.approx(np.tile([10, 2, 5], (50, 1)), rel=1e-12)
