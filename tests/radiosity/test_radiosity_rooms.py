"""Whole bakes of rooms whose light is known: white furnaces, what adds nothing, what is dark, seams and poles."""

import numpy as np
import pytest

from lib.nurbs.evaluate import frame
from lib.nurbs.shape import transformed
from lib.radiosity.form_factors import form_factor_polygon
from tests.rooms import baked, cube
from tests.shapes import box, cylinder, rectangle, sphere
from tests.tolerances import FLOAT32


def crossing_weights(n):
    """Trapezium rule over n crossings of [0, 1]."""
    weights = np.ones(n)
    weights[[0, -1]] = 0.5
    return weights / weights.sum()


def mean(H):
    """Mean of a map (h, w, 1, 3) over u and v, first channel."""
    return crossing_weights(H.shape[0]) @ H[..., 0, 0] @ crossing_weights(H.shape[1])


def square_factor(corners, x, n):
    x = np.asarray(x, float).reshape(-1, 3)
    return form_factor_polygon(np.asarray(corners, float)[None] - x[:, None], np.tile(n, (len(x), 1)))


def crossings(H, origin, u, v, inside=0.002):
    """Points of a rectangle's map where its samples look from: borders a little inside."""
    b, a = (
        np.clip(np.linspace(0, 1, H.shape[0]), inside, 1 - inside),
        np.clip(np.linspace(0, 1, H.shape[1]), inside, 1 - inside),
    )
    return np.asarray(origin) + a[None, :, None] * np.asarray(u, float) + b[:, None, None] * np.asarray(v, float)


@pytest.mark.parametrize("rho, tolerance", [(0.5, 0.01), (0.9, 0.05), (0.99, 0.10)])
def test_white_furnace(tmp_path, rho, tolerance):
    """Every wall glows and reflects alike: H = E / (1 - rho) at every texel, edges and corners of the room included."""
    maps = baked(tmp_path, cube(2.0, E=1.0), rho)
    assert len(maps) == 6
    for H, hidden in maps.values():
        assert not hidden.any()
        assert H * (1 - rho) == pytest.approx(np.ones(H.shape), rel=tolerance)


@pytest.mark.parametrize("rho", [0.5, 0.9])
def test_furnace_in_a_ball(tmp_path, rho):
    """A hollow sphere, poles and seam included; its mesh is a closed shell seen from inside."""
    H, hidden = baked(tmp_path, {"ball": (sphere(), {"E": 1.0, "flip": True})}, rho)["ball"]
    assert not hidden.any()
    assert H * (1 - rho) == pytest.approx(np.ones(H.shape), rel=0.03)
    assert (H[:, 0] == H[:, -1]).all() and (H[0] == H[0, 0]).all() and (H[-1] == H[-1, 0]).all()


def test_one_glowing_wall_keeps_the_mean(tmp_path):
    """Same rho everywhere, any emission: area mean of B = mean E / (1 - rho)."""
    room = cube(1.0)
    room["wall 1"][1]["E"] = np.array([6.0, 3, 0])
    maps = baked(tmp_path, room, 0.5, n_elements=1000, rays_per_element=256)
    B = np.mean([0.5 * mean(H) for H, _ in maps.values()]) + 1
    assert B == pytest.approx(1 / (1 - 0.5), rel=0.01)
    assert all((H[..., 2] == 0).all() for H, _ in maps.values())


def test_light_of_a_lamp_is_counted_once(tmp_path):
    """A black lamp over a black floor in a black room: rays that meet the lamp add nothing to its direct light."""
    lamp = rectangle([0.25, 0.75, 1], [0.5, 0, 0], [0, -0.5, 0])
    floor = [0, 0, 0], [1, 0, 0], [0, 1, 0]
    surfaces = {"floor": (rectangle(*floor), {}), "lamp": (lamp, {"E": [3, 2, 1], "is_black": True})}
    rho = {"floor": 0.5, "lamp": 0.0}
    maps = baked(tmp_path, surfaces, rho)
    assert list(maps) == ["floor"]
    H = maps["floor"][0]
    corners = [[0.25, 0.25, 1], [0.75, 0.25, 1], [0.75, 0.75, 1], [0.25, 0.75, 1]]
    F = square_factor(corners, crossings(H, *floor) + [0, 0, 1e-4], [0.0, 0, 1]).reshape(H.shape[:2])
    assert H[..., 0, :] == pytest.approx(F[..., None] * [3, 2, 1], rel=1e-3)


def test_a_white_lamp_reflects_but_its_glow_is_no_radiosity_of_elements(tmp_path):
    """Two facing white squares, one glowing: the glowing one receives rho F of the light of the other, no E."""
    floor = [0, 0, 0], [1, 0, 0], [0, 1, 0]
    surfaces = {"floor": (rectangle(*floor), {}), "lamp": (rectangle([0, 1, 1], [1, 0, 0], [0, -1, 0]), {"E": 1.0})}
    maps = baked(tmp_path, surfaces, 0.5, n_elements=800, rays_per_element=256, gather_rays=256)
    F = 0.19982
    # means over both: H_floor = F (1 + rho H_lamp), H_lamp = F rho H_floor, up to how evenly light falls on the squares
    H_floor = F / (1 - F * F / 4)
    assert mean(maps["floor"][0]) == pytest.approx(H_floor, rel=0.02)
    assert mean(maps["lamp"][0]) == pytest.approx(F * H_floor / 2, rel=0.05)


def test_a_caster_adds_nothing_and_a_picture_takes_nothing(tmp_path):
    """A cast_only wall beside the floor reflects nothing; a receive_only sheet above casts no shadow but has a map."""
    floor = rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0])
    wall = rectangle([0, 0, 0], [0, 1, 0], [0, 0, 1])
    sheet = rectangle([0.25, 0.25, 0.5], [0.5, 0, 0], [0, 0.5, 0])
    lamp = (rectangle([0.25, 0.75, 1], [0.5, 0, 0], [0, -0.5, 0]), {"E": 1.0, "is_black": True})
    rho = {"floor": 0.9, "wall": 0.9, "sheet": 0.9, "lamp": 0}
    alone = baked(tmp_path / "a", {"floor": (floor, {}), "lamp": lamp}, rho)
    beside = {
        "floor": (floor, {}),
        "lamp": lamp,
        "wall": (wall, {"role": "cast_only"}),
        "sheet": (sheet, {"role": "receive_only"}),
    }
    maps = baked(tmp_path / "b", beside, rho)
    assert sorted(maps) == ["floor", "sheet"]
    assert maps["floor"][0] == pytest.approx(alone["floor"][0], rel=1e-4)
    assert maps["sheet"][0].min() > alone["floor"][0].max()  # nearer to the lamp


def test_a_dim_furnace_beside_one_a_million_times_brighter(tmp_path):
    """No threshold of the scene drops its light or lets the other's in."""
    beside = np.eye(4)
    beside[0, 3] = 1.5
    rooms = cube(1.0, E=1e6) | {f"dim {k}": (transformed(face, beside), f) for k, (face, f) in cube(1.0, E=1.0).items()}
    for name, (H, _) in baked(tmp_path, rooms, 0.8).items():
        E = 1.0 if name.startswith("dim") else 1e6
        assert H * 0.2 / E == pytest.approx(np.ones(H.shape), rel=0.03)


def test_a_ball_is_not_shaded_by_its_own_mesh(tmp_path):
    """Where it sees the whole lamp at more than n.l = 0.1 the light of every sample is the form factor, within 5 %."""
    lamp = [[-0.2, -0.2, 2], [0.2, -0.2, 2], [0.2, 0.2, 2], [-0.2, 0.2, 2]]
    surfaces = {"ball": (sphere(0.5), {}), "lamp": (rectangle([-0.2, 0.2, 2], [0.4, 0, 0], [0, -0.4, 0]), {"E": 1.0})}
    H = baked(tmp_path, surfaces, 0.5, bounces=1, base_direct=4)["ball"][0]
    v, u = np.meshgrid(np.linspace(0, 1, H.shape[0]), np.linspace(0, 1, H.shape[1]), indexing="ij")
    S, N = frame(sphere(0.5), u.ravel(), v.ravel())
    to_lamp = np.asarray(lamp) - S[:, None]
    sees_all = (np.einsum("kpc,kc->kp", to_lamp, N) / np.linalg.norm(to_lamp, axis=2) > 0.1).all(axis=1)
    expected = form_factor_polygon(to_lamp, N)
    assert sees_all.sum() > 50
    assert H[..., 0, 0].ravel()[sees_all] == pytest.approx(expected[sees_all], rel=0.05)


@pytest.mark.parametrize("axis", [0, 2])
def test_two_rooms_with_one_wall_of_two_sheets(tmp_path, axis):
    """Both are furnaces of their own: whose wall a ray meets is not left to rounding, nor is anything buried."""
    beside = np.eye(4)
    beside[axis, 3] = 1
    near, far = cube(1.0, E=1.0), cube(1.0, E=1.0)
    rooms = {f"far {k}": (transformed(face, beside), facts) for k, (face, facts) in far.items()} | near
    for H, hidden in baked(tmp_path, rooms, 0.5).values():
        assert not hidden.any()
        assert H * 0.5 == pytest.approx(np.ones(H.shape), rel=0.01)


def test_a_room_behind_a_wall_without_thickness_is_exactly_dark(tmp_path):
    """A lit box, and a room that leans against its wall: the five surfaces of the room stay 0, bounces included."""
    rooms = cube(1.0)
    rooms["lamp"] = rectangle([0.4, 0.6, 0.9], [0.2, 0, 0], [0, -0.2, 0]), {"E": 100.0, "is_black": True}
    beside = np.eye(4)
    beside[0, 3] = 1
    rooms |= {f"dark {k}": (transformed(face, beside), {"flip": True}) for k, face in enumerate(box()) if k != 4}
    maps = baked(tmp_path, rooms, {name: 0.8 for name in rooms} | {"lamp": 0.0})
    assert not any(H.any() for name, (H, _) in maps.items() if name.startswith("dark"))
    assert all(H.min() > 0 for name, (H, _) in maps.items() if name.startswith("wall"))


def test_below_a_box_on_the_floor_it_is_dark(tmp_path):
    """The floor under a closed box is hidden, and so dark; beside it lies ordinary light."""
    put = np.diag([0.3, 0.3, 0.3, 1.0])
    put[:3, 3] = 0.35, 0.35, 0.0
    room = {"floor": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {})}
    room["lamp"] = (rectangle([0.1, 0.9, 1], [0.8, 0, 0], [0, -0.8, 0]), {"E": 1.0, "is_black": True})
    room |= {f"box {k}": (transformed(face, put), {}) for k, face in enumerate(box())}
    rho = {name: 0.5 for name in room} | {"lamp": 0.0}
    H, hidden = baked(tmp_path, room, rho)["floor"]
    under = np.abs(np.linspace(0, 1, len(H)) - 0.5) < 0.14
    assert hidden[np.ix_(under, under)].all()
    assert H[np.ix_(under, under)].max() < 0.01 * H.max()
    assert not hidden[0].any() and H[0, 0, 0, 0] > 0.1 * H.max()


def test_below_a_table_top_it_is_ordinary_shadow(tmp_path):
    """The back of an open sheet hides nothing: the floor below is dim, visible, and lit from the sides."""
    room = cube(1.0)
    room["top"] = (rectangle([0.3, 0.3, 0.3], [0.4, 0, 0], [0, 0.4, 0]), {})
    room["lamp"] = (rectangle([0.4, 0.6, 0.99], [0.2, 0, 0], [0, -0.2, 0]), {"E": 10.0, "is_black": True})
    maps = baked(tmp_path, room, {name: 0.7 for name in room} | {"lamp": 0.0})
    H, hidden = maps["wall 0"]
    middle = H[len(H) // 2, H.shape[1] // 2, 0, 0]
    assert not hidden.any()
    assert 0.02 * H.max() < middle < 0.6 * H.max()


def test_one_bounce_is_direct_light_alone(tmp_path):
    room = cube(1.0)
    room["wall 1"][1]["E"] = 1.0
    one = baked(tmp_path / "1", room, 0.5, bounces=1)
    two = baked(tmp_path / "2", room, 0.5, bounces=2, gather_rays=256)
    three = baked(tmp_path / "3", room, 0.5, bounces=3, gather_rays=256)
    assert not one["wall 1"][0].any()  # the lamp's own wall
    means = [np.mean([mean(H) for H, _ in maps.values()]) for maps in (one, two, three)]
    assert means == pytest.approx([1 / 6, 1.5 / 6, 1.75 / 6], rel=0.02)  # all light meets a wall, half goes on


def test_columns_at_a_seam_are_equal(tmp_path):
    """A tube beside a lamp: last column of the map is the first, bit by bit, and light goes on across it."""
    lamp = rectangle([-1, 3, 0], [2, 0, 0], [0, 0, 1])
    surfaces = {"lamp": (lamp, {"E": 1.0}), "tube": (cylinder(1.0, 1.0), {})}
    H, _ = baked(tmp_path, surfaces, 0.5)["tube"]
    assert (H[:, 0] == H[:, -1]).all()
    step = np.abs(np.diff(H[..., 0, 0], axis=1))
    assert max(step[:, 0].max(), step[:, -1].max()) <= 2 * step.max() + FLOAT32


@pytest.mark.parametrize("where", [0.5, 0.43, 4 / 7])
def test_behind_a_thin_wall_it_is_dark_though_floor_and_ceiling_run_on(tmp_path, where):
    """One hall, two rooms: a sheet with two faces across it; through elements, between elements, on their border."""
    hall = cube(1.0)
    hall["lamp"] = (rectangle([0.1, 0.6, 0.9], [0.2, 0, 0], [0, -0.2, 0]), {"E": 100.0, "is_black": True})
    hall["lit"] = (rectangle([where, 0, 0], [0, 0, 1], [0, 1, 0]), {})
    hall["dark"] = (rectangle([where, 0, 0], [0, 1, 0], [0, 0, 1]), {})
    rho = {name: 0.8 for name in hall} | {"lamp": 0.0}
    maps = baked(tmp_path, hall, rho, max_level=7)
    far, near = maps["wall 5"][0], maps["wall 4"][0]  # the walls x = 1 and x = 0
    assert far.mean() <= 5e-3 * near.mean()  # what one texel of the finest level lets through by interpolation
    assert where != 0.5 or not far.any()  # on a line of the lattice: nothing at all
