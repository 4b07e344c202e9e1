"""Sheets whose sides are known to be lit or dark: small rooms of typed-in quadrilaterals."""

import numpy as np
import pytest

from lib.visibility.both_sides import is_two_sided, side_light

LAMP = np.array([10.0, 5, 0])
MILLIMETRE = 1 / 3000  # in a room 3 m wide, whose side is 1 in the frame


def quad(origin, e1, e2):
    """Two triangles, front towards e1 x e2: (2, 3, 3)."""
    o, a, b = (np.array(x, dtype=float) for x in (origin, e1, e2))
    return np.array([[o, o + a, o + a + b], [o, o + a + b, o + b]])


def box(low, high, is_outward):
    """Six quadrilaterals: bottom, top, then the other sides."""
    low, (w, d, h) = np.array(low, dtype=float), np.subtract(high, low)
    x, y, z = np.diag([w, d, h]).astype(float)
    sides = [(low, x, y), (low + z, y, x), (low, z, x), (low + y, x, z), (low, y, z), (low + x, z, y)]
    return [quad(o, b, a) if is_outward else quad(o, a, b) for o, a, b in sides]


def room(**more):
    """{name: triangles} of a closed room of side 1 with a lamp under its ceiling."""
    walls = {f"wall {k}": side for k, side in enumerate(box([0, 0, 0], [1, 1, 1], is_outward=False))}
    return {**walls, "lamp": quad([0.4, 0.4, 0.99], [0, 0.2, 0], [0.2, 0, 0]), **more}


def light_of(surfaces, candidates, rho=0.5, order=None, **more):
    """{name: [front, back]} of the candidates; order: of the surfaces' numbers."""
    names = sorted(surfaces) if order is None else order
    corners = np.concatenate([surfaces[name] for name in names])
    face_surface = np.repeat(np.arange(len(names)), [len(surfaces[name]) for name in names])
    E = np.array([LAMP if name == "lamp" else np.zeros(3) for name in names])
    F = np.arange(3 * len(corners)).reshape(-1, 3)
    numbers = [names.index(name) for name in candidates]
    light = side_light(corners.reshape(-1, 3), F, face_surface, E, np.full(len(names), rho), numbers, **more)
    assert light.shape == (len(names), 2) and not np.delete(light, numbers, axis=0).any()
    return {name: light[k] for name, k in zip(candidates, numbers, strict=True)}


def two_sided(light):
    return is_two_sided(np.array(list(light.values()))).tolist()


def open_box(low, high):
    """The five outer sides of a box that stands on its missing bottom, one surface."""
    return np.concatenate(box(low, high, is_outward=True)[1:])


TABLE = quad([0.3, 0.3, 0.4], [0.4, 0, 0], [0, 0.4, 0])  # its front upwards


def test_a_sheet_in_the_room_has_light_on_both_sides():
    light = light_of(room(table=TABLE), ["table"])
    assert two_sided(light) == [True]
    assert light["table"][0] > 2 * light["table"][1] > 0


def test_a_wall_has_light_on_its_front_alone():
    light = light_of(room(), ["wall 0", "wall 1", "wall 5"])
    assert not any(two_sided(light))
    assert all(front > 0 and back == 0 for front, back in light.values())


def test_a_wall_turned_inside_out_is_lit_from_behind():
    surfaces = room()
    surfaces["wall 0"] = surfaces["wall 0"][:, ::-1]
    front, back = light_of(surfaces, ["wall 0"])["wall 0"]
    assert front == 0 and back > 0


@pytest.mark.parametrize("together", [True, False])
def test_a_box_without_a_bottom_on_the_floor_is_dark_inside(together):
    sides = open_box([0.3, 0.3, 0], [0.5, 0.5, 0.3]).reshape(5, 2, 3, 3)
    boxes = {"box": sides.reshape(10, 3, 3)} if together else {f"box {k}": side for k, side in enumerate(sides)}
    light = light_of(room(**boxes), list(boxes))
    assert all(front > 0 and back == 0 for front, back in light.values())
    assert not any(two_sided(light))


def test_the_same_box_above_the_floor_is_lit_inside():
    assert two_sided(light_of(room(box=open_box([0.3, 0.3, 0.1], [0.5, 0.5, 0.4])), ["box"])) == [True]


def test_a_bowl_is_lit_inside_and_outside():
    around, up = np.linspace(0, 2 * np.pi, 17), np.linspace(0, np.pi / 2, 5)[1:]
    rings = [
        np.stack([np.cos(around) * np.sin(t), np.sin(around) * np.sin(t), 1 - np.cos(t) + 0 * around], axis=1)
        for t in up
    ]
    bowl = []
    for low, high in zip(rings[:-1], rings[1:], strict=True):
        for k in range(16):
            bowl += [[low[k], high[k + 1], low[k + 1]], [low[k], high[k], high[k + 1]]]  # seen from within
    bowl = [0.5, 0.5, 0.1] + 0.15 * np.array(bowl)
    normal = np.cross(bowl[:, 1] - bowl[:, 0], bowl[:, 2] - bowl[:, 0])
    assert (np.einsum("ij,ij->i", normal, [0.5, 0.5, 0.25] - bowl.mean(axis=1)) > 0).all()
    light = light_of(room(bowl=bowl), ["bowl"])
    assert two_sided(light) == [True] and light["bowl"][0] > light["bowl"][1]


@pytest.mark.parametrize("seed", range(8))
def test_a_sheet_a_millimetre_before_a_wall_is_dark_behind(seed):
    """The rule: what light gets in along the border is less than a hundredth of the front's."""
    sheet = quad([MILLIMETRE, 0.3, 0.3], [0, 0.4, 0], [0, 0, 0.4])
    light = light_of(room(sheet=sheet), ["sheet"], seed=seed)
    assert two_sided(light) == [False] and light["sheet"][0] > 0


def test_a_sheet_away_from_the_wall_is_lit_behind():
    sheet = quad([100 * MILLIMETRE, 0.3, 0.3], [0, 0.4, 0], [0, 0, 0.4])
    assert two_sided(light_of(room(sheet=sheet), ["sheet"])) == [True]


def test_a_closed_box_with_the_lamp_inside_is_dark_outside():
    outer = {f"side {k}": side for k, side in enumerate(box([0.2, 0.2, 0.2], [0.8, 0.8, 0.8], is_outward=True))}
    lamp = {"lamp": quad([0.45, 0.45, 0.7], [0, 0.1, 0], [0.1, 0, 0])}
    walls = {f"wall {k}": side for k, side in enumerate(box([0, 0, 0], [1, 1, 1], is_outward=False))}
    light = light_of({**outer, **lamp, **walls}, list(outer))
    assert all(front == 0 and back > 0 for front, back in light.values())
    assert not any(two_sided(light))


def test_the_back_of_a_candidate_reflects_and_that_of_others_does_not():
    """A shelf lit from below alone: by light that a sheet under the lamp's level throws back down."""
    surfaces = {
        "lamp": quad([0, 0.4, 0.1], [0.2, 0, 0], [0, 0.2, 0]),  # shines upwards
        "ceiling": quad([0, 0, 1], [1, 0, 0], [0, 1, 0]),  # its back to the lamp
        "shelf": quad([0.6, 0.3, 0.05], [0.4, 0, 0], [0, 0.4, 0]),  # under the lamp's plane, its front upwards
    }
    assert light_of(surfaces, ["shelf"])["shelf"].tolist() == [0, 0]
    assert light_of(surfaces, ["shelf", "ceiling"])["shelf"][0] > 0


def test_irradiance_in_a_white_furnace():
    """A closed room whose walls all emit 1 and reflect a half: H = 1 / (1 - 1/2) = 2, less the light after 4 bounces,
    1/16; and nothing behind.  Walls are 8 x 8 tiles; the disc form loses some light between those that meet in edges.
    """
    tiles, t = [], np.arange(8)
    for a, b, c in (wall[0] for wall in box([0, 0, 0], [1, 1, 1], is_outward=False)):
        tiles += [quad(a + (b - a) * i / 8 + (c - b) * j / 8, (b - a) / 8, (c - b) / 8) for i in t for j in t]
    corners = np.concatenate(tiles)
    F, surface = np.arange(3 * len(corners)).reshape(-1, 3), np.repeat(np.arange(6), len(corners) // 6)
    light = side_light(corners.reshape(-1, 3), F, surface, np.ones((6, 3)), np.full(6, 0.5), np.arange(6))
    assert light[:, 0].mean() == pytest.approx(2 - 1 / 16, rel=0.1)
    assert not light[:, 1].any()


def test_same_seed_same_light_whatever_the_order_of_surfaces():
    surfaces = room(table=TABLE, box=open_box([0.1, 0.1, 0.01], [0.2, 0.2, 0.1]))
    one = light_of(surfaces, ["table", "box"], seed=3)
    again = light_of(surfaces, ["table", "box"], seed=3)
    turned = light_of(surfaces, ["box", "table"], seed=3, order=sorted(surfaces)[::-1])
    other = light_of(surfaces, ["table", "box"], seed=4)
    for name in one:
        assert one[name].tolist() == again[name].tolist() == turned[name].tolist() != other[name].tolist()


def test_nothing_to_do():
    surfaces = room()
    del surfaces["lamp"]
    assert light_of(surfaces, ["wall 0"])["wall 0"].tolist() == [0, 0]
    assert light_of(room(), []) == {}
    V, F = np.zeros((0, 3)), np.zeros((0, 3), dtype=int)
    assert side_light(V, F, np.zeros(0, dtype=int), np.ones((2, 3)), np.ones(2), [0, 1]).tolist() == [[0, 0], [0, 0]]
    assert is_two_sided(np.zeros((2, 2))).tolist() == [False, False]
    assert is_two_sided(np.zeros((0, 2))).tolist() == []


def test_a_side_is_dark_by_both_measures():
    light = np.array([[1e-6, 1e-7], [1e4, 50.0], [60, 40], [70, 0.6], [80, 1]])
    # a dim room; a lampshade, half a hundredth of its inside but as light as the others; ordinary; 0.6 of 70; 1 of 80
    assert is_two_sided(light).tolist() == [True, True, True, False, True]
    assert is_two_sided(light, least=0.02).tolist() == [True, True, True, False, False]
