"""Near light: receivers close to their source, a lamp in its ceiling, surfaces that lie in one another."""

import numpy as np

from benchmarks.hard_cases.bench import (
    DENSE,
    STANDARD,
    Figure,
    crossings,
    looked_up,
    numeric_rectangle,
    parallel_rectangle,
    rms,
    worst,
)
from benchmarks.hard_cases.shadows import lamp
from lib.formats import preflight
from tests.rooms import cube
from tests.shapes import rectangle

DISTANCES = 0.01, 0.1, 0.5, 1.0, 2.0, 4.0


def close_source(bench):
    """A unit square below a unit lamp at 0.01 to 4 of its sides."""
    errors, most = [], 0.0
    floor = [0.0, 0, 0], [1.0, 0, 0], [0.0, 1, 0]
    low, high = np.array([0.0, 0]), np.array([1.0, 1])
    for distance in DISTANCES:
        scene = {"floor": (rectangle(*floor), {}), "lamp": lamp(low, high, distance)}
        maps = bench.maps(scene, {"floor": 0.5, "lamp": 0.0}, cheap=STANDARD, bounces=1)
        H = looked_up(maps["floor"][0][..., 0], (DENSE, DENSE))
        x = crossings(H.shape, *floor)[..., :2]
        lifted = distance - 7e-5 * np.hypot(1, distance)  # where rays leave; matters beside the lamp's rim at 0.01
        truth = parallel_rectangle(x, low, high, lifted)
        errors.append(rms(H, truth))
        most = max(most, float(H.max()))
    yield Figure("receiver 0.01 to 4 sides from its source, worst RMSE", "closed form", 0.01, max(errors))
    yield Figure("the same, estimate above 1", "never", 1e-6, max(0.0, most - 1))


def horizon(bench):
    """A standing lamp that reaches from below the floor's plane to above it: only what is above counts."""
    floor = [0.0, 0, 0], [1.0, 0, 0], [0.0, 1, 0]
    corner, u, v = [-0.1, 0.0, -0.5], [0, 1.0, 0], [0, 0, 1.0]
    scene = {"floor": (rectangle(*floor), {}), "lamp": (rectangle(corner, u, v), {"E": 1.0, "is_black": True})}
    maps = bench.maps(scene, {"floor": 0.5, "lamp": 0.0}, cheap=STANDARD, bounces=1)
    H = looked_up(maps["floor"][0][..., 0], (49, 49))
    x = crossings(H.shape, *floor).reshape(-1, 3)
    truth = numeric_rectangle(x, np.tile([0.0, 0, 1], (len(x), 1)), [-0.1, 0, 0], u, [0, 0, 0.5], [1.0, 0, 0])
    yield Figure("lamp that reaches below the horizon, RMSE", "numeric integration", 0.01, rms(H.ravel(), truth))


def lamp_in_ceiling(bench):
    """A lamp in the plane of the ceiling it hangs on: as if it hung a hair below."""
    made, again = {}, None
    for below in (0.0, 1e-3):
        room = cube(1.0)
        room["lamp"] = lamp(np.array([0.35, 0.35]), np.array([0.65, 0.65]), 1.0 - below)
        rho = {name: 0.5 for name in room} | {"lamp": 0.0}
        made[below] = bench.maps(room, rho)
        if below == 0:
            again = bench.maps(room, rho)
    floors = [maps["wall 0"][0] for maps in made.values()]
    direct = looked_up(bench.maps(room, rho, bounces=1)["wall 0"][0][..., 0], (DENSE, DENSE))
    x = crossings(direct.shape, [0, 0, 0], [0, 1, 0], [1, 0, 0])[..., :2]
    truth = parallel_rectangle(x, np.array([0.35, 0.35]), np.array([0.65, 0.65]), 0.999)
    yield Figure("floor below a lamp lying on the ceiling, direct light, RMSE", "closed form", 0.01, rms(direct, truth))
    means = [float(H.mean()) for H in floors]
    error = abs(means[0] / means[1] - 1)
    yield Figure("the same, mean of the floor, against a lamp 1/1000 below", "the same", 0.01, error)
    same = all(made[0.0][name][0].tobytes() == again[name][0].tobytes() for name in again)
    finite = all(np.isfinite(H).all() for H, _ in made[0.0].values())
    yield Figure("the same, twice: other bytes or not finite (0 no, 1 yes)", "0", 0, float(not (same and finite)))


TWICE = """
geometry:
- {name: floor, rectangle: {origin: [0, 0, 0], u: [1, 0, 0], v: [0, 1, 0]}}
- {name: carpet, rectangle: {origin: [0.2, 0.2, 0], u: [0.5, 0, 0], v: [0, 0.5, 0]}}
- {name: ceiling, rectangle: {origin: [0, 0, 1], u: [0, 1, 0], v: [1, 0, 0]}}
- {name: lamp, rectangle: {origin: [0.3, 0.3, 1], u: [0, 0.2, 0], v: [0.2, 0, 0]}, material: lamp}
materials: {lamp: {emission: 1}}
"""


def coincident(bench):
    """A carpet in the plane of the floor: both get the light of the open floor, and both are named."""
    floor = [0.0, 0, 0], [1.0, 0, 0], [0.0, 1, 0]
    carpet = [0.2, 0.2, 0], [0.5, 0, 0], [0, 0.5, 0]
    low, high = np.array([0.3, 0.3]), np.array([0.6, 0.6])
    scene = {"floor": (rectangle(*floor), {}), "carpet": (rectangle(*carpet), {}), "lamp": lamp(low, high)}
    runs = [bench.maps(scene, {"floor": 0.5, "carpet": 0.5, "lamp": 0.0}) for _ in range(2)]
    errors = []
    for name, place in (("floor", floor), ("carpet", carpet)):
        H = looked_up(runs[0][name][0][..., 0], (DENSE, DENSE))
        errors.append(worst(H, parallel_rectangle(crossings(H.shape, *place)[..., :2], low, high, 1.0)))
    same = all(runs[0][name][0].tobytes() == runs[1][name][0].tobytes() for name in runs[0])
    yield Figure("coincident surfaces, worst texel of both", "closed form of the open floor", 0.02, max(errors))
    yield Figure("the same, twice: other bytes (0 no, 1 yes)", "the same bytes", 0, float(not same))
    path = bench.file("twice/scene.yaml", TWICE)
    said = preflight.load(path.parent, results_root=bench.folder / "made").warnings
    named = [any(a in text and b in text for text in said) for a, b in (("carpet", "floor"), ("ceiling", "lamp"))]
    yield Figure("the same, pairs that no warning names", "0", 0, float(named.count(False)))


CASES = [close_source, horizon, lamp_in_ceiling, coincident]
