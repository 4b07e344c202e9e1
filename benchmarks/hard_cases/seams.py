"""Seams of closed surfaces: the same tube, ball and ring with their seams on one side and on the other.

A seam must not show: where one surface has its seam and its twin has none, light steps as far.
"""

import numpy as np

from benchmarks.hard_cases.bench import STANDARD, Figure
from benchmarks.hard_cases.shadows import lamp
from lib.nurbs.shape import transformed
from tests.rooms import cube
from tests.shapes import CIRCLE, CIRCLE_KNOTS, CIRCLE_WEIGHTS, cylinder, revolved, sphere

STEP = 1 / 64  # of the way round: two texels at most
OFTEN = 95  # percentile of the steps along a seam
NO_LARGER = 1.2  # times the step without a seam: both have noise


def torus(turn, R=0.13, r=0.05):
    """Closed in u and v, seams at u = 0 and at the outermost ring, or the innermost one if turned."""
    return revolved([R, 0] + (-r if turn else r) * CIRCLE, CIRCLE_WEIGHTS, 2, CIRCLE_KNOTS)


def room(turn):
    """{name: (surface, facts)}: a lamp far along y, so that at the seams, at x > 0 or x < 0, the light fades."""
    surfaces = cube(1.0) | {"lamp": lamp(np.array([0.35, 0.7]), np.array([0.65, 0.95]), 0.95)}
    things = {"tube": (cylinder(0.1, 0.35), 0.17, 0.05), "ball": (sphere(0.13), 0.45, 0.3)}
    things["ring"] = torus(turn), 0.78, 0.25
    for name, (surface, x, z) in things.items():
        put = np.diag([-1.0, -1.0, 1.0, 1.0]) if turn else np.eye(4)
        put[:3, 3] = x, 0.3, z
        surfaces[name] = transformed(surface, put), {}
    return surfaces


def step_at(H, u):
    """How far the light of a map (h, w, C), closed in u, steps within STEP round u: the OFTEN-th percentile along v."""
    n = H.shape[1] - 1
    ends = []
    for at in (u - STEP / 2, u + STEP / 2):
        i, t = int(np.floor(at * n)), at * n % 1
        ends.append(H[:, i % n] * (1 - t) + H[:, i % n + 1] * t)  # column n, not 0, ends the last texel
    return float(np.percentile(np.abs(ends[1] - ends[0]), OFTEN))


def seams(bench):
    """Steps across each seam."""
    rho = {name: 0.6 for name in room(False)} | {"lamp": 0.0}
    baked = [bench.maps(room(turn), rho, cheap=STANDARD) for turn in (False, True)]
    for name, way in (("tube", "u"), ("ball", "u"), ("ring", "u"), ("ring", "v")):
        H, twin = (np.swapaxes(maps[name][0].astype(float), 1, "vu".index(way)) for maps in baked)
        ratio = max(step_at(a, 0.0) / step_at(b, 0.5) for a, b in ((H, twin), (twin, H)))
        what = f"seam of a {name}, {way} = 0"
        yield Figure(f"{what}: two ends of the map differ by", "0", 0, float(np.abs(H[:, 0] - H[:, -1]).max()))
        yield Figure(f"{what}: step across it over the step there without it", "no larger", NO_LARGER, ratio)


CASES = [seams]
