"""No light, black rooms, one and two sides, a hundred lamps, and a dim room behind a bright one."""

import numpy as np

from benchmarks.hard_cases.bench import DENSE, Figure, crossings, looked_up, parallel_rectangle, rms
from benchmarks.hard_cases.shadows import below_sheet, lamp, sheet
from lib.nurbs.shape import transformed
from tests.rooms import cube, shining
from tests.shapes import box, rectangle

FLOOR = [-1.0, -1, 0], [2.0, 0, 0], [0.0, 2, 0]


def unlit_and_black(bench):
    """No emission at all; and a room that reflects nothing."""
    maps = bench.maps(cube(1.0), 0.5)
    yield Figure("no emission, largest H", "0, exit 0", 0, max(float(np.abs(H).max()) for H, _ in maps.values()))
    room = cube(1.0)
    room["lamp"] = lamp(np.array([0.4, 0.4]), np.array([0.6, 0.6]), 0.9)
    rho = {name: 0.0 for name in room}
    all_light, direct = bench.maps(room, rho), bench.maps(room, rho, bounces=1)
    bounced = max(float(np.abs(all_light[name][0] - direct[name][0]).max()) for name in direct)
    yield Figure("reflectance 0 everywhere, bounced light", "0", 0, bounced)
    H = direct["wall 0"][0][..., 0]
    x = crossings(H.shape, [0, 0, 0], [0, 1, 0], [1, 0, 0])[..., :2]
    truth = parallel_rectangle(x, np.array([0.4, 0.4]), np.array([0.6, 0.6]), 0.9)
    yield Figure("reflectance 0 everywhere, floor, RMSE", "closed form", 0.01, rms(H, truth))


def two_sides(bench):
    """A sheet receives on one side and casts a shadow with both."""
    scene = {"floor": (rectangle(*FLOOR), {}), "lamp": lamp(*np.array([[-0.2, -0.2], [0.2, 0.2]]))}
    rho = {"floor": 0.5, "lamp": 0.0, "sheet": 0.5}
    found, shadows = {}, []
    for flip in (False, True):
        sheet = rectangle([-0.4, -0.4, 0.5], [0.8, 0, 0], [0, 0.8, 0])
        found[flip] = bench.maps(scene | {"sheet": (sheet, {"flip": flip})}, rho, bounces=1)["sheet"][0]
        blocker = {"sheet": (sheet, {"flip": flip, "role": "cast_only"})}
        shadows.append(bench.maps(scene | blocker, rho, bounces=1)["floor"][0].tobytes())
    differ = float(shadows[0] != shadows[1])
    yield Figure("shadow of a sheet, and of the sheet turned over: other bytes", "the same (0)", 0, differ)
    yield Figure("back of that sheet, direct light", "0", 0, float(found[True].max()))
    yield Figure("front of it, dark texels", "none", 0, float((found[False].min(axis=-1) <= 0).sum()))


def many_lamps(bench):
    """A hundred lamps of uneven power over a table: the sum of the closed forms of each."""
    rng = np.random.default_rng(3)
    place, power = rng.uniform(-0.9, 0.9, (100, 2)), rng.uniform(0.1, 10, 100)
    scene = {f"lamp {k:02d}": lamp(place[k] - 0.02, place[k] + 0.02, 1.0, power[k]) for k in range(100)}
    rho = {name: 0.0 for name in scene} | {"floor": 0.5, "table": 0.0}
    scene |= {"floor": (rectangle(*FLOOR), {}), "table": sheet([-0.3, -0.3], [0.3, 0.3], 0.3)}
    H = looked_up(bench.maps(scene, rho, bounces=1)["floor"][0], (DENSE, DENSE))[..., 0]
    x = crossings(H.shape, *FLOOR)[..., :2]
    below = [below_sheet(x, [-0.3, -0.3], [0.3, 0.3], 0.3, y - 0.02, y + 0.02) for y in place]
    truth = np.tensordot(power, below, 1)
    yield Figure("100 lamps and a table, RMSE", "sum of closed forms", 0.015, rms(H, truth))


def two_rooms():
    """A bright room of six walls, and a dim one beside it that gets its light through a door of 0.2 x 0.6."""
    bright = cube(1.0)
    del bright["wall 5"]  # x = 1
    rooms = {f"bright {name[-1]}": piece for name, piece in bright.items()}
    beside = np.eye(4)
    beside[0, 3] = 1.0
    rooms |= {f"dim {k}": (transformed(face, beside), {"flip": True}) for k, face in enumerate(box()) if k != 4}
    pieces = {"left": (0.0, 0.4, 0.0, 1.0), "right": (0.6, 1.0, 0.0, 1.0), "above": (0.4, 0.6, 0.6, 1.0)}
    for name, (y, to_y, z, to_z) in pieces.items():
        size = [0, to_y - y, 0], [0, 0, to_z - z]
        rooms[f"dim by the door, {name}"] = rectangle([1, y, z], *size), {}
        rooms[f"bright by the door, {name}"] = rectangle([1, y, z], *size), {"flip": True}
    rooms["lamp"] = lamp(np.array([0.3, 0.3]), np.array([0.5, 0.5]), 0.95, 10.0)
    return rooms, {name: 0.6 for name in rooms} | {"lamp": 0.0}


def dim_room(bench):
    """Light that comes through a door: relative to the scene's mean by default, finer where asked."""
    rooms, rho = two_rooms()
    level = 4 if bench.is_cheap else 6
    finest = {"gather_rays": 1024 if bench.is_cheap else 4096, "rays_per_element": 512, "shadow_rays": [64, 256]}
    truth = bench.maps(rooms, rho, tolerance=0.01, relative_to="surface", max_level=level, **finest)
    dim = [name for name in truth if name.startswith("dim")]
    mean = np.mean([truth[name][0].mean() for name in dim])
    scene_mean = np.mean([H.mean() for H, _ in truth.values()])
    bakes = {
        "default": {},
        "tolerance / 4 on its surfaces": {"tolerances": dict.fromkeys(dim, 0.005 if bench.is_cheap else 0.0025)},
        "relative_to: surface": {"relative_to": "surface"},
    }
    own = {}
    for name, changes in bakes.items():
        maps = bench.maps(rooms, rho, max_level=level, **changes)
        errors = [looked_up(maps[wall][0], truth[wall][0].shape) - truth[wall][0] for wall in dim]
        own[name] = float(np.sqrt(np.mean(np.concatenate([e.ravel() for e in errors]) ** 2))) / mean
    what = f"dim room behind a bright one ({mean / scene_mean:.0%} of the mean light), "
    truth = "a much finer bake"
    if not bench.is_cheap:
        yield Figure(what + "default, RMSE / mean of the scene", truth, 0.01, own["default"] * mean / scene_mean)
        yield Figure(what + "default, RMSE / its own mean", truth, np.inf, own["default"])
    for name in list(bakes)[1:]:
        if not bench.is_cheap:
            yield Figure(what + f"{name}, RMSE / its own mean", truth, 0.025, own[name])
        yield Figure(what + f"{name}, that error over the default's", "less", 0.85, own[name] / own["default"])


def textured_emitter(bench):
    """A lamp of 0.8 x 0.8 that shines by a picture of 16 x 16 uneven squares, each known in closed form; direct light
    sees 8 x 8 parts of it at most."""
    n, side = 16, 0.8 / 16
    colour = np.random.default_rng(5).random((n, n, 3)) ** 3  # row 0 the picture's top, y = 0.4; columns against x
    picture = colour.repeat(32, axis=0).repeat(32, axis=1).astype(np.float32)
    row, column = (axis.ravel() for axis in np.indices((n, n)))
    corner = np.stack([0.4 - side * (column + 1), 0.4 - side * (row + 1)], axis=1)
    table = [-0.3, -0.3], [0.3, 0.3], 0.3
    cases = (
        ("1 above the floor", 1.0, False, 0.01),
        ("and a table", 1.0, True, 0.015),
        ("0.2 above it", 0.2, False, 0.05),
    )
    for name, height, has_table, asked in cases:
        lamp = shining(rectangle([0.4, -0.4, height], [-0.8, 0, 0], [0, 0.8, 0]), picture, is_black=True)
        scene = {"floor": (rectangle(*FLOOR), {}), "lamp": lamp} | ({"table": sheet(*table)} if has_table else {})
        H = bench.maps(scene, {"floor": 0.5, "lamp": 0.0, "table": 0.0}, bounces=1)["floor"][0]
        H = looked_up(H, (DENSE, DENSE))
        x = crossings(H.shape, *FLOOR)[..., :2]
        squares = ((c, c + side) for c in corner)
        F = [below_sheet(x, *table, *c) if has_table else parallel_rectangle(x, *c, height) for c in squares]
        error = rms(H, np.tensordot(F, colour.reshape(-1, 3), (0, 0)))
        yield Figure(f"textured emitter, 0.8 wide, {name}, RMSE", "sum over the picture's squares", asked, error)


CASES = [unlit_and_black, two_sides, many_lamps, dim_room, textured_emitter]
