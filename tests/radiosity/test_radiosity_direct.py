"""Direct light in scenes with a closed form: no shadow, half shadow, full shadow, curved and dim lights."""

import numpy as np
import pytest

from lib.nurbs.shape import transformed
from lib.radiosity.direct import DIM, direct_light
from lib.radiosity.form_factors import form_factor_polygon
from tests.rooms import world_of
from tests.shapes import cylinder, rectangle, sphere
from tests.tolerances import FACETED, FLOAT32, STANDARD_ERRORS

UP = np.array([0.0, 0, 1])
LAMP = rectangle([-0.5, 0.5, 1], [1, 0, 0], [0, -1, 0])  # the unit square at z = 1, shining down


def light(surfaces, x, N=UP, n0=16, n1=64, seed=1):
    """H (n, G, 3) and the noise stated, at points of the world; the scene's largest side is its unit."""
    world = world_of(surfaces)
    x = (np.atleast_2d(np.asarray(x, float)) - world.casters.centre) / world.casters.scale
    N = np.broadcast_to(np.asarray(N, float), x.shape)
    shifts = np.random.default_rng(seed).random((len(x), 2))
    found = direct_light(x, N, shifts, world.emitters, world.n_groups, world.tracer, world.mesh.face_surface, n0, n1)
    return found.H.astype(float), found.noise


def polygon(corners, x, n=UP):
    x = np.atleast_2d(np.asarray(x, float))
    return form_factor_polygon(np.asarray(corners, float)[None] - x[:, None], np.tile(n, (len(x), 1)))


def lamp_corners(left=-0.5, right=0.5):
    return [[left, -0.5, 1], [right, -0.5, 1], [right, 0.5, 1], [left, 0.5, 1]]


def points(n, seed=2, z=0.0, spread=1.0):
    return np.append(np.random.default_rng(seed).uniform(-spread, spread, (n, 2)), np.full((n, 1), z), axis=1)


FLOOR = {"floor": (rectangle([-2, -2, -0.01], [4, 0, 0], [0, 4, 0]), {})}


def test_without_shadow_it_is_the_form_factor_exactly():
    x = points(200)
    E = np.array([3.0, 2, 1])
    H, noise = light(FLOOR | {"lamp": (LAMP, {"E": E})}, x)
    assert H[:, 0] == pytest.approx(polygon(lamp_corners(), x)[:, None] * E, rel=FLOAT32)
    assert not noise.any()


@pytest.mark.parametrize("n", [[0.6, 0, 0.8], [1, 0, 0], [-0.8, 0.6, 0]])
def test_receivers_that_see_a_part_of_the_lamp(n):
    """Cut by the horizon, not by an occluder."""
    x = points(100)
    H, noise = light(FLOOR | {"lamp": (LAMP, {"E": 1.0})}, x, N=n)
    assert H[:, 0, 0] == pytest.approx(polygon(lamp_corners(), x, n), rel=1e-5, abs=1e-9)
    assert not noise.any()


def test_a_light_has_one_side():
    H, _ = light(FLOOR | {"lamp": (LAMP, {"E": 1.0})}, points(50, z=2.0), N=-UP)
    assert (H == 0).all()
    turned, _ = light(FLOOR | {"lamp": (LAMP, {"E": 1.0, "flip": True})}, points(50))
    assert (turned == 0).all()


def screen(x0, x1, z=0.5):
    """An occluder over x0 < x < x1 at the height z."""
    return {"screen": (rectangle([x0, -20, z], [x1 - x0, 0, 0], [0, 40, 0]), {})}


def half_shaded(x, n0, n1=64, n=UP):
    """Light at (x, 0.1, 0) below a screen over x < 0 half way up in 400 draws, its noise, the truth, and no screen.

    The screen hides what lies left of -x: the rest is a rectangle of known form factor.
    """
    H, noise = light(
        FLOOR | screen(-20, 0) | {"lamp": (LAMP, {"E": 1.0})}, np.tile([x, 0.1, 0], (400, 1)), N=n, n0=n0, n1=n1
    )
    return (
        H[:, 0, 0],
        noise,
        polygon(lamp_corners(left=-x), [x, 0.1, 0], n)[0],
        polygon(lamp_corners(), [x, 0.1, 0], n)[0],
    )


@pytest.mark.parametrize("x", [-0.45, -0.3, -0.1, 0.0, 0.2, 0.35, 0.45])
@pytest.mark.parametrize("n", [UP, [0.96, 0, 0.28]], ids=["level", "steep"])
def test_penumbra_of_a_half_plane(x, n):
    """No bias within 4 standard errors (and the ratio's own, of 1 / n1), each estimate near."""
    H, _, truth, whole = half_shaded(x, n0=64, n=n)
    assert abs(H.mean() - truth) < STANDARD_ERRORS * H.std(ddof=1) / 20 + 1e-3 * whole
    assert H.std() < 0.03 * whole


@pytest.mark.parametrize("x", [-0.1, 0.0, 0.2])
def test_noise_of_a_penumbra_is_stated(x):
    H, noise, _, _ = half_shaded(x, n0=16)
    assert (noise > 0).all() and 0.4 < np.median(noise) / H.std() < 2.5


@pytest.mark.parametrize("x", [-0.45, -0.3, 0.35, 0.45])
def test_first_points_that_agree_by_chance_cost_little(x):
    """At the rim of the penumbra 16 points may all be on one side: worth 2 % of the lamp at most, on the mean."""
    H, _, truth, whole = half_shaded(x, n0=16)
    assert abs(H.mean() - truth) < 0.02 * whole


def test_more_rays_are_nearer():
    surfaces = FLOOR | screen(-20, 0) | {"lamp": (LAMP, {"E": 1.0})}
    spread = [light(surfaces, np.tile([0.1, 0.1, 0], (200, 1)), n1=n1)[0].std() for n1 in (16, 64, 256)]
    assert spread[0] > 1.5 * spread[1] > 2 * spread[2]


@pytest.mark.parametrize("E", [1e-9, 1, 1e6])
def test_umbra_is_exactly_dark(E):
    H, noise = light(FLOOR | screen(-20, 20) | {"lamp": (LAMP, {"E": E})}, points(300))
    assert (H == 0).all() and not noise.any()


def test_a_wall_without_thickness_lets_nothing_through():
    """Lamp at x < 0, wall in the plane x = 0: dark behind it, on its dark side and down to the floor it stands on."""
    lamp = rectangle([-1.5, 0.5, 1], [1, 0, 0], [0, -1, 0])
    wall = {"wall": (rectangle([0, -9, 0], [0, 18, 0], [0, 0, 9]), {})}
    floor = {"floor": (rectangle([-9, -9, 0], [18, 0, 0], [0, 18, 0]), {})}
    surfaces = wall | floor | {"lamp": (lamp, {"E": 1e6})}
    behind = points(500, z=2e-3, spread=0.5)
    behind[:, 0] = np.abs(behind[:, 0]) + np.repeat([2e-3, 1e-2, 0.1, 1], 125)
    assert (light(surfaces, behind)[0] == 0).all()
    on_wall = np.stack([np.full(100, 2e-3), *np.random.default_rng(3).uniform(0.1, 0.9, (2, 100))], axis=1)
    assert (light(surfaces, on_wall, N=[1, 0, 0])[0] == 0).all()
    assert (light(surfaces, on_wall * [-1, 1, 1], N=[-1, 0, 0])[0] > 0).all()


def test_a_lamp_on_the_ceiling_is_not_shaded_by_it():
    ceiling = {"ceiling": (rectangle([-2, 2, 1], [4, 0, 0], [0, -4, 0]), {})}
    x = points(100)
    H, _ = light(FLOOR | ceiling | {"lamp": (LAMP, {"E": 1.0})}, x)
    assert H[:, 0, 0] == pytest.approx(polygon(lamp_corners(), x), rel=FLOAT32)


@pytest.mark.parametrize("distance", [0.5, 1.0, 3.0])
def test_irradiance_of_a_ball(distance):
    """E (r / d)^2 cos: a ball that is wholly above the horizon lights like a point in its middle."""
    r = 0.2
    centre = np.eye(4)
    centre[:3, 3] = 0, 0, distance
    ball = {"ball": (transformed(transformed(sphere(), np.diag([r, r, r, 1])), centre), {"E": 5.0})}
    x = np.array([[0, 0, 0], [0.2, 0.1, 0], [-1, 0.5, 0]])
    d = np.linalg.norm(x - centre[:3, 3], axis=1)
    H, noise = light(FLOOR | ball, x)
    assert H[:, 0, 0] == pytest.approx(5 * (r / d) ** 2 * distance / d, rel=FACETED)
    assert not noise.any()  # its own facets do not shade it


def test_a_shade_that_shines_inwards_is_dark_outside():
    """The far inside is seen through the opening above alone, not through the near wall."""
    shade = {"shade": (cylinder(0.2, 1.0), {"E": 1.0, "flip": True})}
    around = np.array([[0.5, 0, 0.3], [0, -0.5, 0.5], [0.4, 0.4, 0.1]])
    H, _ = light(FLOOR | shade, around, N=-around * [1, 1, 0] / np.linalg.norm(around[:, :2], axis=1)[:, None])
    assert (H == 0).all()
    inside, _ = light(FLOOR | shade, [[0, 0, 0.01]])
    # from the middle of its foot up to its rim: all but the opening, a disc of sin^2 = r^2 / (r^2 + h^2)
    assert inside[0, 0, 0] == pytest.approx(1 - 0.2**2 / (0.2**2 + 0.99**2), rel=FACETED)


def test_shadow_of_a_screen_in_the_light_of_a_ball():
    """The screen's edge before the middle of a small ball: half of its light, by symmetry."""
    r = 0.1
    lift = np.diag([r, r, r, 1.0])
    lift[2, 3] = 1
    ball = {"ball": (transformed(sphere(), lift), {"E": 1.0})}
    x = np.tile([0.0, 0, 0], (400, 1))
    H, _ = light(FLOOR | screen(-20, 0) | ball, x)
    whole = light(FLOOR | ball, x[:1])[0][0, 0, 0]
    assert abs(H[:, 0, 0].mean() - whole / 2) < STANDARD_ERRORS * H[:, 0, 0].std() / 20 + 0.01 * whole
    dark, _ = light(FLOOR | screen(-20, 20) | ball, x)
    assert (dark == 0).all()


def test_dim_lights_are_taken_as_unblocked_beside_bright_ones_alone():
    """Both behind the screen's two halves: with the bright one in view the dim one is not asked; in the dark it is."""
    dim = rectangle([-0.5, 0.5, 0.4], [1, 0, 0], [0, -1, 0])  # below: a screen between it and the floor
    low = {"low": (rectangle([-1, -1, 0.2], [2, 0, 0], [0, 2, 0]), {})}
    side = rectangle([3, -0.5, 0.05], [0, 1, 0], [0, 0, 1])  # shines along -x, below the screen's rim
    x = [[0.0, 0, 0]]
    dark, _ = light(FLOOR | low | {"dim": (dim, {"E": 1.0})}, x)
    assert dark[0, 0, 0] == 0
    lamp = {"side": (side, {"E": 1.0, "flip": True})}
    alone = light(FLOOR | low | lamp, x)[0][0, 0, 0]
    assert alone > 0
    beside = light(FLOOR | low | lamp | {"dim": (dim, {"E": 1.0})}, x)[0][0, 0, 0]
    assert beside == alone  # bright enough to be asked
    faint = 0.5 * DIM * alone / polygon([[-0.5, -0.5, 0.4], [0.5, -0.5, 0.4], [0.5, 0.5, 0.4], [-0.5, 0.5, 0.4]], x)[0]
    beside = light(FLOOR | low | lamp | {"dim": (dim, {"E": faint})}, x)[0][0, 0, 0]
    assert alone < beside < alone * (1 + DIM)


def test_what_one_point_has_found_makes_no_light_dim_at_another():
    """A lit point on the left of a wall; on its right a faint lamp above a screen: dark, asked together or alone."""
    wall = {"wall": (rectangle([0, -2, -0.01], [0, 4, 0], [0, 0, 3]), {})}
    low = {"low": (rectangle([0, -2, 0.5], [2, 0, 0], [0, 4, 0]), {})}
    lamp = {"lamp": (rectangle([-1.5, 0.5, 1], [1, 0, 0], [0, -1, 0]), {"E": 1.0})}
    faint = {"faint": (rectangle([0.5, 0.5, 1], [1, 0, 0], [0, -1, 0]), {"E": 0.1 * DIM})}
    H, _ = light(FLOOR | wall | low | lamp | faint, [[-1.0, 0, 0], [1.0, 0, 0]])
    assert H[0].min() > 0.1 and not H[1].any()


def test_light_groups_are_kept_apart_and_add_up():
    x = points(60)
    left = rectangle([-1.5, 0.5, 1], [1, 0, 0], [0, -1, 0])
    both = (
        FLOOR
        | screen(-0.2, 0.2)
        | {"a": (LAMP, {"E": [1, 2, 3], "group": 0}), "b": (left, {"E": [4, 0, 1], "group": 1})}
    )
    one = FLOOR | screen(-0.2, 0.2) | {"a": (LAMP, {"E": [1, 2, 3]}), "b": (left, {"E": [4, 0, 1]})}
    H, sum_ = light(both, x)[0], light(one, x)[0]
    assert H.shape == (60, 2, 3) and sum_.shape == (60, 1, 3)
    assert H.sum(axis=1) == pytest.approx(sum_[:, 0], rel=FLOAT32, abs=1e-9)
    assert (H[:, 0, 1] == pytest.approx(2 * H[:, 0, 0], rel=FLOAT32)) and (H[:, 1, 1] == 0).all()


def test_light_scales_with_the_lamp():
    x, scene = points(60), FLOOR | screen(-0.2, 0.2)
    one, many = (light(scene | {"lamp": (LAMP, {"E": E})}, x)[0] for E in (1.0, 1e6))
    assert many == pytest.approx(1e6 * one, rel=FLOAT32)


def test_a_ball_over_what_casts_no_shadow():
    floor = {"floor": (FLOOR["floor"][0], {"role": "receive_only"})}
    lift = np.diag([0.2, 0.2, 0.2, 1.0])
    lift[2, 3] = 1
    ball = {"ball": (transformed(sphere(), lift), {"E": 1.0, "role": "receive_only"})}
    assert light(floor | ball, [[0, 0, 0]])[0][0, 0, 0] == pytest.approx(0.04, rel=FACETED)


def test_no_lamp_no_light():
    H, noise = light(FLOOR, points(5))
    assert H.shape == (5, 1, 3) and not H.any() and not noise.any()


def test_many_points_in_pieces_are_the_same_points():
    x = points(5000)
    surfaces = FLOOR | screen(-0.2, 0.2) | {"lamp": (LAMP, {"E": 1.0})}
    world = world_of(surfaces)
    frame = (x - world.casters.centre) / world.casters.scale
    shifts, N = np.random.default_rng(5).random((5000, 2)), np.tile(UP, (5000, 1))
    arguments = world.emitters, 1, world.tracer, world.mesh.face_surface, 16, 64
    whole = direct_light(frame, N, shifts, *arguments).H
    part = direct_light(frame[4000:], N[4000:], shifts[4000:], *arguments).H
    assert np.array_equal(whole[4000:], part)
