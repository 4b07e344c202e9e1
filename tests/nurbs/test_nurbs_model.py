"""geomdl as the oracle: its evaluation agrees, and its knot and degree operations change nothing."""

import numpy as np
import pytest

from lib.nurbs import model
from lib.nurbs.evaluate import evaluate, point
from lib.nurbs.surface import bezier, from_points

RNG = np.random.default_rng(11)
U, V = RNG.uniform(size=(2, 40))


def cubic():
    """Rational, degrees 3 and 2, uneven knots, a C0 crease at u = 0.4."""
    P, w = RNG.uniform(-1, 1, (8, 5, 3)), RNG.uniform(0.5, 2, (8, 5))
    return from_points(3, 2, [0, 0, 0, 0, 2, 2, 2, 4, 5, 5, 5, 5], [1, 1, 1, 1.5, 3, 4, 4, 4], P, w)


def test_evaluation_agrees_with_geomdl():
    surface = cubic()
    shape = model.to_geomdl(surface)
    assert np.abs(point(surface, U, V) - shape.evaluate_list(np.stack([U, V], axis=1).tolist())).max() < 1e-13
    for u, v in zip(U[:10], V[:10], strict=True):
        S, S_u, S_v = (a[0] for a in evaluate(surface, np.array([u]), np.array([v])))
        expected = shape.derivatives(u, v, order=1)
        assert S_u == pytest.approx(np.array(expected[1][0]), rel=1e-10, abs=1e-10)
        assert S_v == pytest.approx(np.array(expected[0][1]), rel=1e-10, abs=1e-10)


def test_there_and_back_is_the_same_surface():
    surface = cubic()
    back = model.from_geomdl(model.to_geomdl(surface))
    assert np.array_equal(back.Pw, surface.Pw) and np.array_equal(back.knots_u, surface.knots_u)


def test_inserted_knots_change_the_net_only():
    surface = cubic()
    finer = model.with_knots(surface, u=[0.1, 0.55], v=[0.5])
    assert finer.Pw.shape == (10, 6, 4)
    assert np.abs(point(finer, U, V) - point(surface, U, V)).max() < 1e-13


def test_elevated_degrees_change_the_net_only():
    surface = bezier(RNG.uniform(-1, 1, (4, 3, 3)), RNG.uniform(0.5, 2, (4, 3)))
    higher = model.elevated(surface)
    assert (higher.degree_u, higher.degree_v) == (4, 3)
    assert np.abs(point(higher, U, V) - point(surface, U, V)).max() < 1e-13
    with pytest.raises(ValueError, match="Bezier"):
        model.elevated(cubic())
