"""From the parameters of a STEP file to those of rational surfaces, and polylines along edges."""

import numpy as np
import pytest

from lib.formats import step_edges, step_parameters
from lib.nurbs.evaluate import point
from lib.nurbs.surface import from_points

HALF = np.sqrt(0.5)
QUARTERS = np.array([0.0, 0.5, 1.0, 1.5, 2.0]) * np.pi


def cylinder(turns=4, radius=2.0, height=3.0):
    """Quarters of a rational cylinder about z, as converters make it: (surface, distinct knots in u, in v)."""
    corners = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)][: 2 * turns + 1]
    P = np.array([[[radius * x, radius * y, z] for z in (0.0, height)] for x, y in corners])
    w = np.array([[1.0, HALF][k % 2] for k in range(len(corners))])[:, None].repeat(2, axis=1)
    angles = QUARTERS[: turns + 1]
    knots = np.concatenate([angles[:1], np.repeat(angles, 2), angles[-1:]])
    return from_points(2, 1, knots, [0, 0, height, height], P, w), (angles, np.array([0.0, height]))


def on_cylinder(u, v, radius=2.0):
    return np.stack([radius * np.cos(u), radius * np.sin(u), v], axis=1)


def test_the_angle_is_found_out_and_followed_round_the_seam():
    surface, knots = cylinder()
    box = np.array([[0.0, 2 * np.pi], [0.0, 3.0]])
    mapping = step_parameters.Map(surface, knots, box, (2 * np.pi, None), on_cylinder)
    assert mapping.how == ("arc", "linear") and mapping.off < 1e-12
    u, v = np.linspace(1.0, 1.0 + 2 * np.pi, 50), np.linspace(0.0, 3.0, 50)
    uv, gap = mapping(np.stack([u, v], axis=1), on_cylinder(u, v), 4.0)
    assert gap < 1e-12 and (np.diff(uv[:, 0]) > 0).all() and uv[-1, 0] - uv[0, 0] == pytest.approx(1.0)
    assert point(surface, *(uv % 1.0)[1:-1].T) == pytest.approx(on_cylinder(u, v)[1:-1], abs=1e-12)


def test_a_part_that_begins_whole_turns_away():
    surface, knots = cylinder(turns=2)
    box = np.array([[-2.0, -1.0], [0.0, 1.0]]) * np.pi
    mapping = step_parameters.Map(surface, knots, box, (2 * np.pi, None), on_cylinder)
    u = np.linspace(-2 * np.pi, -np.pi, 9)
    uv, gap = mapping(np.stack([u, 0 * u], axis=1), on_cylinder(u, 0 * u), 4.0)
    assert gap < 1e-12 and uv[[0, -1], 0] == pytest.approx([0.0, 1.0], abs=1e-12)


def test_a_hyperbola_has_a_form_of_its_own():
    half, knots = 0.7, np.array([0.0, 1.4])
    middle = np.cosh(half)
    points = [[np.cosh(-half), np.sinh(-half)], [1 / middle, 0.0], [np.cosh(half), np.sinh(half)]]
    P = [[[x, y, z] for z in (0.0, 1.0)] for x, y in points]
    w = [[1.0, 1.0], [middle, middle], [1.0, 1.0]]
    surface = from_points(2, 1, [0, 0, 0, 1.4, 1.4, 1.4], [0, 0, 1, 1], P, w)

    def own(u, v):
        return np.stack([np.cosh(u - half), np.sinh(u - half), v], axis=1)

    box = np.array([[0.0, 1.4], [0.0, 1.0]])
    mapping = step_parameters.Map(surface, (knots, np.array([0.0, 1.0])), box, (None, None), own)
    assert mapping.how == ("hyperbola", "linear") and mapping.off < 1e-12


def test_curves_in_u_v_that_do_not_fit_their_edge_are_put_right():
    surface, knots = cylinder(turns=1)
    box = np.array([[0.0, np.pi / 2], [0.0, 3.0]])
    mapping = step_parameters.Map(surface, knots, box, (2 * np.pi, None), on_cylinder)
    u, v = np.linspace(0.2, 1.3, 30), np.linspace(0.5, 2.0, 30)
    askew = np.stack([u + 0.1 * np.sin(3 * v), v + 0.1 * np.cos(5 * u)], axis=1)
    uv, gap = mapping(askew, on_cylinder(u, v), 4.0)
    assert gap < 1e-9 and point(surface, *uv.T) == pytest.approx(on_cylinder(u, v), abs=1e-8)


def test_what_an_edge_off_its_surface_leaves_is_told():
    surface, knots = cylinder(turns=1)
    mapping = step_parameters.Map(
        surface, knots, np.array([[0.0, np.pi / 2], [0.0, 3.0]]), (2 * np.pi, None), on_cylinder
    )
    u, v = np.linspace(0.2, 1.3, 30), np.linspace(0.5, 2.0, 30)
    _, gap = mapping(np.stack([u, v], axis=1), on_cylinder(u, v, radius=2.1), 4.0)
    assert gap == pytest.approx(0.1 / 4, rel=1e-3)


@pytest.mark.parametrize(
    "corners, is_trimmed",
    [
        ([[0, 0], [4, 0], [4, 2], [0, 2]], False),
        ([[0, 0], [2, 0], [4, 0], [4, 2], [0, 2], [0, 1]], False),
        ([[0, 0], [4, 0], [4, 2], [2, 1], [0, 2]], True),
        ([[2, 0], [4, 1], [2, 2], [0, 1]], True),  # every corner on the border of the box
    ],
)
def test_a_loop_round_its_whole_box_trims_nothing(corners, is_trimmed):
    bounds, loop = np.array([[-9.0, 9.0], [-9.0, 9.0]]), np.array(corners, dtype=float)
    box, found = step_parameters.box([loop], bounds, (None, None))
    assert box.tolist() == [[0, 4], [0, 2]] and found == is_trimmed
    assert step_parameters.box([loop, loop / 9 + 1], bounds, (None, None))[1]


def test_the_box_stays_on_the_surface():
    loop = np.array([[-1e-9, 0], [1 + 1e-9, 0], [1 + 1e-9, 7], [-1e-9, 7]])
    box, is_trimmed = step_parameters.box([loop], np.array([[0.0, 1.0], [0.0, 2 * np.pi]]), (None, 2 * np.pi))
    assert box.tolist() == [[0.0, 1.0], [0.0, 2 * np.pi]] and not is_trimmed
    with pytest.raises(ValueError, match="no area"):
        step_parameters.box([loop * [1, 0]], np.array([[0.0, 1.0], [0.0, 1.0]]), (None, None))


def test_chords_of_a_circle_stay_within_their_share():
    def circle(t):
        return np.stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t), 0 * t], axis=1)

    t = step_edges.sampled(circle, np.array([0.0, 1.0]), [])
    assert t[0] == 0.0 and t[-1] == 1.0 and (np.diff(t) > 0).all() and len(t) <= step_edges.MOST
    middle = circle((t[1:] + t[:-1]) / 2), (circle(t)[1:] + circle(t)[:-1]) / 2
    assert np.linalg.norm(middle[0] - middle[1], axis=1).max() <= 2 * step_edges.IN_SPACE


def test_straight_edges_have_two_points_unless_a_face_bends_them():
    def straight(t):
        return np.stack([t, 2 * t, 3 * t], axis=1)

    def bent(t):
        return np.hstack([straight(t), t[:, None], 0.3 * t[:, None] ** 2])

    assert step_edges.sampled(straight, np.array([0.0, 0.5, 1.0]), []).tolist() == [0.0, 1.0]
    assert len(step_edges.sampled(bent, np.array([0.0, 1.0]), [1.0, 1.0])) > 20
