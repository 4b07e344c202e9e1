"""Light on meshes, trimmed surfaces and both sides of sheets: what is known in closed form, or from whole surfaces."""

import numpy as np
import pytest

from lib.maps.fill import one_deep
from lib.nurbs.surface import bilinear
from lib.surfaces.trimmed import TrimmedSurface
from tests.rooms import baked, corner_of, cube, cube_mesh, world_of
from tests.shapes import rectangle


def at(H, u, v):
    """All channels of a map (H (h, w, G, 3), hidden), filled as for its file, bilinear at u, v (n,): (n, 3)."""
    H = one_deep(*H)
    h, w = H.shape[:2]
    x, y = u * (w - 1), v * (h - 1)
    i, j = np.minimum(x.astype(int), w - 2), np.minimum(y.astype(int), h - 2)
    x, y, H = (x - i)[:, None], (y - j)[:, None], H.sum(axis=2)
    return (H[j, i] * (1 - x) + H[j, i + 1] * x) * (1 - y) + (H[j + 1, i] * (1 - x) + H[j + 1, i + 1] * x) * y


def test_furnace_of_one_mesh(tmp_path):
    """Everywhere E / (1 - rho), at the borders of charts too."""
    mesh = cube_mesh()
    H = baked(tmp_path, {"room": (mesh, {"E": 1.0})}, 0.5, rays_per_element=256, gather_rays=256)["room"]
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41)))
    for k in range(6):
        x, y = corner_of(k)
        assert at(H, x + u / 4, y + v / 4) == pytest.approx(2.0, rel=0.01), k


def test_a_mesh_has_the_light_of_the_surfaces_it_is_made_of(tmp_path):
    """A lamp in a room whose walls are one mesh, and six rectangles."""
    lamp = (rectangle([0.35, 0.35, 0.9], [0, 0.3, 0], [0.3, 0, 0]), {"E": 10.0, "is_black": True})
    rho = {"lamp": 0.0, "room": 0.6, **{f"wall {k}": 0.6 for k in range(6)}}
    plain = baked(tmp_path / "1", {**cube(), "lamp": lamp}, {k: v for k, v in rho.items() if k != "room"})
    mesh = cube_mesh()
    H = baked(tmp_path / "2", {"room": (mesh, {}), "lamp": lamp}, {"room": 0.6, "lamp": 0.0})["room"]
    u, v = np.random.default_rng(2).random((2, 500))
    for k in range(6):
        x, y = corner_of(k)
        found, whole = at(H, x + u / 4, y + v / 4), at(plain[f"wall {k}"], u, v)
        assert found.mean() == pytest.approx(whole.mean(), rel=0.03), k
        assert np.sqrt(((found - whole) ** 2).mean()) < 0.04 * whole.mean()


def half_square(z=0.0):
    """The half x + y <= 1 of the unit square as a trimmed surface."""
    base = bilinear([0, 0, z], [1, 0, z], [1, 1, z], [0, 1, z])
    uv = np.array([[0.0, 0], [1, 0], [0, 1]])
    S = np.column_stack([uv, np.full(3, z)])
    return TrimmedSurface(base, np.array([0.0, 1, 0, 1]), uv, np.array([0, 3]), S, np.full(3, np.inf))


def test_light_on_a_trimmed_face_and_past_it(tmp_path):
    """A lamp above: the part inside has the light of the whole square, and what is cut away casts no shadow."""
    lamp = (rectangle([-1, -1, 2], [0, 3, 0], [3, 0, 0]), {"E": 1.0, "is_black": True})
    floor = (rectangle([0, 0, -0.25], [1, 0, 0], [0, 1, 0]), {})
    rho = {"lamp": 0.0, "sheet": 0.0, "floor": 0.0}
    maps = {"lamp": lamp, "floor": floor, "sheet": (half_square(), {})}
    maps = baked(tmp_path / "1", maps, rho, tolerance=0.005)
    whole = {"lamp": lamp, "floor": floor, "sheet": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {})}
    whole = baked(tmp_path / "2", whole, rho, tolerance=0.005)

    t = np.random.default_rng(1).dirichlet([1, 1, 1], 200)[:, :2]
    edge = np.linspace(0, 1, 101)
    for u, v in ((t[:, 0], t[:, 1]), (edge, 1 - edge)):  # inside, and along the cut: no fringe
        assert at(maps["sheet"], u, v) == pytest.approx(at(whole["sheet"], u, v), rel=0.02)
    below, open_above = maps["floor"][0].sum(axis=2)[..., 0], whole["floor"][0].sum(axis=2)[..., 0]
    h, w = below.shape
    assert below[-1, -1] > 1.5 * open_above[-1, -1]  # the corner under what is cut away sees the lamp
    assert below[h // 4, w // 4] < 0.2 * below[-1, -1]


def test_both_sides_of_a_sheet(tmp_path):
    """A sheet across a room, a lamp on either side: each side has the light of its own half, as two sheets would."""
    room = cube(reach := 2.0)
    sheet = rectangle([1, 0, 0], [0, reach, 0], [0, 0, reach])
    near = rectangle([1.9, 0.5, 0.5], [0, 0, 1], [0, 1, 0])
    far = rectangle([0.1, 0.5, 0.5], [0, 1, 0], [0, 0, 1])
    lamps = {"near": (near, {"E": 1.0, "is_black": True}), "far": (far, {"E": 4.0, "is_black": True})}
    rho = {"near": 0.0, "far": 0.0, "sheet": 0.5, "sheet/back": 0.5, **dict.fromkeys(room, 0.5)}
    both = {"sheet": (sheet, {}), "sheet/back": (sheet, {"flip": True, "front": "sheet"})}
    maps = baked(tmp_path, {**room, **lamps, **both}, rho, elements=1500)
    front, back = (maps[name][0].sum(axis=2)[..., 0] for name in both)
    assert back.mean() == pytest.approx(4 * front.mean(), rel=0.03)
    assert front.min() > 0.05


def test_the_back_of_a_trimmed_surface_fills_the_same_part_of_its_map():
    both = {"sheet": (half_square(), {}), "sheet/back": (half_square(), {"flip": True, "front": "sheet"})}
    world = world_of(both | {"lamp": (rectangle([0, 0, 2], [0, 1, 0], [1, 0, 0]), {"E": 1.0})})
    front, back = (world.domain(world.scene.names.index(name)) for name in both)
    assert front.uv.tobytes() == back.uv.tobytes() and front.is_border.tobytes() == back.is_border.tobytes()
    assert (front.face_at(np.array([[0.1, 0.1], [0.9, 0.9]])) >= 0).tolist() == [True, False]
