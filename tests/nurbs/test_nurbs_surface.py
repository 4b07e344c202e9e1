"""A surface is checked where it is made: every bad field is named."""

import numpy as np
import pytest

from lib.nurbs.evaluate import point
from lib.nurbs.surface import NurbsSurface, bezier, bilinear, from_points
from tests.tolerances import EXACT

GOOD = {
    "degree_u": 2,
    "degree_v": 1,
    "knots_u": [0, 0, 0, 1, 2, 2, 2],
    "knots_v": [0, 0, 1, 1],
    "P": np.stack(np.meshgrid(np.arange(4.0), [0.0, 1.0], [0.0], indexing="ij"), axis=-1)[:, :, 0],
    "w": np.ones((4, 2)),
}


def changed(field, index, value):
    array = np.array(GOOD[field], dtype=float)
    array[index] = value
    return {field: array}


BAD = {
    "NaN in a point": (changed("P", (1, 1, 2), np.nan), "points: NaN, Inf"),
    "Inf in a point": (changed("P", (0, 0, 0), np.inf), "points: NaN, Inf"),
    "overflow": (changed("P", (0, 0, 0), 2e100), "points: .* beyond 1e100"),
    "points in a plane": ({"P": GOOD["P"][..., :2]}, r"points: shape \(4, 2, 2\), expected \(n_u, n_v, 3\)"),
    "a curve's points": ({"P": GOOD["P"][:, 0]}, "points: shape"),
    "empty net": ({"P": np.zeros((0, 0, 3)), "w": np.zeros((0, 0))}, "weights|points|degree"),
    "weight 0": (changed("w", (2, 1), 0), "weights: every weight must be > 0"),
    "weight < 0": (changed("w", (2, 1), -1), "weights: every weight must be > 0"),
    "NaN weight": (changed("w", (2, 1), np.nan), "weights: NaN or Inf"),
    "Inf weight": (changed("w", (2, 1), np.inf), "weights: NaN or Inf"),
    "weights of another shape": ({"w": np.ones((2, 4))}, r"weights: shape \(2, 4\), expected \(4, 2\)"),
    "degree 0": ({"degree_u": 0}, "degree_u: 0, expected an integer >= 1"),
    "degree -1": ({"degree_v": -1}, "degree_v: -1, expected an integer >= 1"),
    "half a degree": ({"degree_u": 1.5}, "degree_u: 1.5, expected an integer >= 1"),
    "a truth for a degree": ({"degree_v": True}, "degree_v: True, expected an integer >= 1"),
    "NaN for a degree": ({"degree_v": float("nan")}, "degree_v: nan, expected an integer >= 1"),
    "Inf for a degree": ({"degree_v": float("inf")}, "degree_v: inf, expected an integer >= 1"),
    "text for a degree": ({"degree_v": "2"}, "degree_v: '2', expected an integer >= 1"),
    "degree too high": (
        {"degree_u": 4, "knots_u": [0] * 4 + [1] * 5},
        "degree_u: 4 needs at least 5 control points, found 4",
    ),
    "too few knots": ({"knots_u": [0, 0, 0, 1, 1, 1]}, r"knots_u: 6 knots, expected 4 \+ 2 \+ 1 = 7"),
    "too many knots": ({"knots_v": [0, 0, 0.5, 1, 1]}, r"knots_v: 5 knots, expected 2 \+ 1 \+ 1 = 4"),
    "knots that go back": ({"knots_u": [0, 0, 0, 2, 1, 2, 2]}, "knots_u: knot 4 goes back"),
    "NaN knot": (changed("knots_u", 3, np.nan), "knots_u: NaN or Inf"),
    "Inf knot": (changed("knots_v", 3, np.inf), "knots_v: NaN or Inf"),
    "empty domain": ({"knots_v": [0, 1, 1, 2]}, r"knots_v: empty domain \[1, 1\]"),
    "a gap inside": ({"degree_u": 1, "knots_u": [0, 0, 1, 1, 2, 2]}, "knots_u: .*multiplicity > degree 1"),
}


@pytest.mark.parametrize("fields, message", BAD.values(), ids=BAD)
def test_bad_fields_are_named(fields, message):
    with pytest.raises(ValueError, match=message):
        from_points(**(GOOD | fields))


def test_the_good_one_is_good():
    assert from_points(**GOOD).Pw.shape == (4, 2, 4)


def test_homogeneous_points_have_four_coordinates():
    with pytest.raises(ValueError, match=r"points: shape \(4, 2, 3\)"):
        NurbsSurface(2, 1, GOOD["knots_u"], GOOD["knots_v"], GOOD["P"])


def test_domain_is_the_unit_square():
    surface = from_points(**(GOOD | {"knots_u": [3, 3, 3, 5, 7, 7, 7], "knots_v": [-2, -2, 6, 6]}))
    assert surface.knots_u.tolist() == [0, 0, 0, 0.5, 1, 1, 1]
    assert surface.knots_v.tolist() == [0, 0, 1, 1]
    unclamped = from_points(**(GOOD | {"knots_u": [0, 1, 2, 3, 4, 5, 6]}))
    assert unclamped.knots_u.tolist() == [-1, -0.5, 0, 0.5, 1, 1.5, 2]


def test_creases_up_to_the_degree_are_allowed():
    assert from_points(**(GOOD | {"degree_u": 1, "knots_u": [0, 0, 1, 2, 3, 3]})).degree_u == 1
    five = np.concatenate([GOOD["P"], GOOD["P"][-1:] + [1, 0, 0]])
    assert from_points(2, 1, [0, 0, 0, 1, 1, 2, 2, 2], [0, 0, 1, 1], five).knots_u.tolist() == [
        0,
        0,
        0,
        0.5,
        0.5,
        1,
        1,
        1,
    ]


def test_a_common_factor_of_the_weights_changes_nothing():
    w = np.random.default_rng(5).uniform(0.5, 2, (4, 2))
    one, other = from_points(**(GOOD | {"w": w})), from_points(**(GOOD | {"w": w * 2.0**-20}))
    assert np.array_equal(one.Pw, other.Pw)
    assert one.w.max() == 1
    assert np.abs(one.P - GOOD["P"]).max() < EXACT


def test_corners_of_a_bilinear_surface():
    corners = np.random.default_rng(6).uniform(-1, 1, (4, 3))
    S = point(bilinear(*corners), np.array([0, 1, 1, 0, 0.5]), np.array([0, 0, 1, 1, 0.5]))
    assert np.abs(S - [*corners, corners.mean(axis=0)]).max() < EXACT


def test_middle_of_a_bezier_patch():
    """Bernstein weights 1 2 1 / 4 along u, 1 3 3 1 / 8 along v."""
    P = np.random.default_rng(7).uniform(-1, 1, (3, 4, 3))
    expected = np.einsum("a,b,abc->c", np.array([1, 2, 1]) / 4, np.array([1, 3, 3, 1]) / 8, P)
    assert np.abs(point(bezier(P), np.array([0.5]), np.array([0.5]))[0] - expected).max() < EXACT
