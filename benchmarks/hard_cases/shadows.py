"""Shadows whose rims are known: penumbras, contacts, walls without thickness, surfaces that run into one another."""

import numpy as np

from benchmarks.hard_cases.bench import DENSE, STANDARD, Figure, crossings, looked_up, parallel_rectangle, rms
from lib.formats import trees
from lib.nurbs.shape import transformed
from tests.rooms import cube
from tests.shapes import box, rectangle, revolved, sphere

FLOOR = [-1.0, -1, 0], [2.0, 0, 0], [0.0, 2, 0]
LAMP = np.array([-0.2, -0.2]), np.array([0.2, 0.2])  # at height 1, looking down
DARK = 1e-12


def lamp(low=LAMP[0], high=LAMP[1], height=1.0, E=1.0):
    """A black lamp that looks down."""
    size = np.asarray(high) - low
    return rectangle([low[0], high[1], height], [size[0], 0, 0], [0, -size[1], 0]), {"E": E, "is_black": True}


def sheet(low, high, height):
    """A horizontal sheet that only casts a shadow."""
    size = np.asarray(high, float) - low
    return rectangle([*low, height], [size[0], 0, 0], [0, size[1], 0]), {"role": "cast_only"}


def below_sheet(x, low, high, height, lamp_low=LAMP[0], lamp_high=LAMP[1]):
    """H / E on the plane z = 0 at x (..., 2) of a lamp at height 1, less what a sheet below it hides."""
    seen_low, seen_high = (x + (np.asarray(corner) - x) / height for corner in (low, high))  # cast from x on the lamp
    hidden = np.maximum(lamp_low, seen_low), np.minimum(lamp_high, seen_high)
    whole = parallel_rectangle(x, np.asarray(lamp_low), np.asarray(lamp_high), 1.0)
    left = whole - parallel_rectangle(x, *hidden, 1.0)
    return np.where(left > DARK, left, 0.0)


def bowl(radius=1.0):
    """The lower half of a sphere, normals outwards."""
    w = np.sqrt(0.5)
    return revolved(radius * np.array([[0, -1], [1, -1], [1, 0]]), [1, w, 1], 2, [0, 0, 0, 1, 1, 1])


def penumbra(bench):
    """Below the edge of a half plane, and below a table: closed form at every texel, nothing in the umbra."""
    blockers = {"half plane": ([-9.0, -9], [0.0, 9], 0.5), "table": ([-0.4, -0.3], [0.4, 0.3], 0.4)}
    for name, (low, high, height) in blockers.items():
        surfaces = {"floor": (rectangle(*FLOOR), {}), "lamp": lamp(), "blocker": sheet(low, high, height)}
        rho = {"floor": 0.5, "lamp": 0.0, "blocker": 0.0}
        bake = bench.bake(surfaces, rho, cheap=STANDARD, bounces=1)
        H = looked_up(bake.maps()["floor"][0][..., 0, 0], (DENSE, DENSE))
        truth = below_sheet(crossings(H.shape, *FLOOR)[..., :2], low, high, height)
        error = rms(H, truth, truth.max())
        yield Figure(f"penumbra of a {name}, RMSE / largest H", "closed form", 0.01, error)
        value, known, _ = direct_tree(bake, "floor").dense()
        truth = below_sheet(crossings(known.shape, *FLOOR)[..., :2], low, high, height)
        umbra = value[known & (truth == 0)]
        share = f"{(truth == 0).mean():.0%} of the floor, {len(umbra)} samples"
        yield Figure(f"umbra of a {name} ({share}), largest H", "0", 0, float(umbra.max()))


def direct_tree(bake, name):
    """The measured samples of a surface's direct light."""
    return trees.load(bake.path("direct", 0), "direct")[0][bake.scene.names.index(name)]


def contact(bench):
    """A closed box on the floor: the floor under it is dark, and the rim no wider than a texel."""
    put = np.diag([0.3, 0.3, 0.3, 1.0])
    put[:3, 3] = 0.35, 0.35, 0.0
    room = {"floor": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {})}
    room["lamp"] = lamp(np.array([0.1, 0.1]), np.array([0.9, 0.9]))
    room |= {f"box {k}": (transformed(face, put), {}) for k, face in enumerate(box())}
    H, hidden = bench.maps(room, {name: 0.5 for name in room} | {"lamp": 0.0})["floor"]
    x = np.abs(np.linspace(0, 1, len(H)) - 0.5)
    inside = np.ix_(x < 0.15 - 1 / (len(H) - 1), x < 0.15 - 1 / (len(H) - 1))
    error = float(H[inside].max() / H.max())
    yield Figure("floor below a box, a texel from its rim, over the open floor", "0", 0.01, error)
    yield Figure("the same: texels not known to be buried", "none", 0, float((~hidden[inside]).sum()))
    outside = np.maximum(x[:, None], x[None]) > 0.15 + 1 / (len(H) - 1)
    yield Figure("floor beside that box is lit: dark texels", "none", 0, float((H[outside].min(axis=-1) <= 0).sum()))


def thin_wall(bench):
    """A lit and a dark room share a wall that is one sheet: nothing passes, bounces included."""
    rooms = cube(1.0)
    rooms["lamp"] = rectangle([0.4, 0.6, 0.9], [0.2, 0, 0], [0, -0.2, 0]), {"E": 100.0, "is_black": True}
    beside = np.eye(4)
    beside[0, 3] = 1
    rooms |= {f"dark {k}": (transformed(face, beside), {"flip": True}) for k, face in enumerate(box()) if k != 4}
    maps = bench.maps(rooms, {name: 0.8 for name in rooms} | {"lamp": 0.0})
    dark = max(float(H.max()) for name, (H, _) in maps.items() if name.startswith("dark"))
    lit = min(float(H.min()) for name, (H, _) in maps.items() if name.startswith("wall"))
    yield Figure("dark room behind a wall without thickness, largest H", "0", 0, dark)
    yield Figure("lit room before it, dark texels (0 none)", "0", 0, 0.0 if lit > 0 else 1.0)


def interpenetration(bench):
    """A ball half sunk in the floor of a closed room: what is below the floor is dark, as is the floor in the ball."""
    r = 0.25
    sunk = np.diag([r, r, r, 1.0])
    sunk[:3, 3] = 0.5, 0.5, 0.0
    room = cube(1.0) | {"ball": (transformed(sphere(), sunk), {})}
    room["lamp"] = rectangle([0.2, 0.8, 0.99], [0.6, 0, 0], [0, -0.6, 0]), {"E": 1.0, "is_black": True}
    maps = bench.maps(room, {name: 0.7 for name in room} | {"lamp": 0.0})
    H, _ = maps["wall 0"]
    x = np.linspace(0, 1, len(H)) - 0.5
    away = np.hypot(x[:, None], x[None])
    texel = np.sqrt(2) / (len(H) - 1)
    error = _largest(H, away < r - texel)
    yield Figure("floor inside a sunk ball, a texel from its rim, over its largest", "0", 0, error)
    yield Figure("floor outside it: dark texels", "none", 0, float((H[away > r + texel].min(axis=-1) <= 0).sum()))
    ball, _ = maps["ball"]
    v = (crossing_height(len(ball)) * r)[:, None] * np.ones(ball.shape[1])
    step = np.abs(np.diff(v[:, 0])).max()
    yield Figure("ball below the floor, a texel from it, over its largest", "0", 0, _largest(ball, v < -step))
    broken = sum(not np.isfinite(H).all() for H, _ in maps.values())
    yield Figure("ball sunk in the floor: maps that are not finite", "none", 0, float(broken))


def open_sheets(bench):
    """The back of a table top over the floor, a ball in an open bowl: sheets hide nothing by themselves."""
    table = sheet([-0.4, -0.3], [0.4, 0.3], 0.4)[0]
    surfaces = {"floor": (rectangle(*FLOOR), {}), "lamp": lamp(), "table": (table, {})}
    _, hidden = bench.maps(surfaces, {"floor": 0.5, "lamp": 0.0, "table": 0.5})["floor"]
    yield Figure("floor below a table top that is one sheet: texels taken for buried", "none", 0, float(hidden.sum()))
    small = np.diag([0.3, 0.3, 0.3, 1.0])
    ball, pot = small.copy(), small.copy()
    ball[2, 3], pot[2, 3] = 0.5, 0.7  # the bowl stands 0.1 above the floor, the ball in it
    pot[:3, :3] *= 2
    surfaces = {"floor": (rectangle(*FLOOR), {}), "lamp": lamp(height=1.5), "ball": (transformed(sphere(), ball), {})}
    surfaces["bowl"] = transformed(bowl(), pot), {"flip": True}
    maps = bench.maps(surfaces, {name: 0.5 for name in surfaces} | {"lamp": 0.0})
    count = sum(hidden.sum() for _, hidden in maps.values())
    yield Figure("ball in an open bowl: texels taken for buried", "none", 0, float(count))
    H = maps["ball"][0]
    dark = (H.min(axis=-1) <= 0).sum()
    yield Figure("ball in an open bowl: dark texels of the ball", "none", 0, float(dark))


def _largest(H, where):
    return float(H[where].max() / H.max())


def crossing_height(n):
    """z of the rows of tests.shapes.sphere: v in [0, 1] over two rational quadratic quarter circles."""
    t = np.linspace(0, 1, n) * 2
    s = np.where(t < 1, t, t - 1)
    w = np.sqrt(0.5)
    weight = (1 - s) ** 2 + 2 * w * s * (1 - s) + s**2
    lower = -((1 - s) ** 2 + 2 * w * s * (1 - s)) / weight
    upper = (2 * w * s * (1 - s) + s**2) / weight
    return np.where(t < 1, lower, upper)


CASES = [penumbra, contact, thin_wall, interpenetration, open_sheets]
