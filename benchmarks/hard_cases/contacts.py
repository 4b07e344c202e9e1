"""Contact edges: where walls meet the floor, and where a bar stands on it, at one texel from the edge and nearer.

A room 1 wide and 1 high with a lamp below its ceiling and a bar that lies on the floor from wall to wall, once as long
as wide and once LONG times that.  Direct light is known in closed form, all light by tracing paths (block_room.py).
Irradiance is read from the final map, bilinearly; a texel is one of that map.  Cells along a contact are divided down
to a share of the scene's largest side: the long room tells whether that is enough beside small things.
"""

import numpy as np

from benchmarks.hard_cases.bench import STANDARD, Figure, numeric_rectangle, rms, worst
from benchmarks.hard_cases.block_room import BlockRoom
from benchmarks.score import bilinear
from lib.maps.fill import one_deep
from tests.shapes import rectangle

LONG = 8.0
MIDDLE = 0.35, 0.65  # of the length: what is compared
RHO = 0.6
BAR = 0.3712, 0.6443, 0.2  # from, to, height: its sides fall between texels
LAMP = 0.15, 0.55, 0.95  # from, to, height
LAMP_LENGTH = 0.2, 0.8  # of the room's
PLACES, PATHS = 65, 1 << 16
AWAY = {0.3: 0.05, 1.0: 0.02}  # texels from the edge, error asked of the mean
ALONG = 0.05  # asked of the RMS along an edge
CHEAP = STANDARD
SEGMENTS = {  # of the cross section: from, to (x, z), lit on the left
    "floor": ((0, 0), (1, 0)),
    "right": ((1, 0), (1, 1)),
    "ceiling": ((1, 1), (0, 1)),
    "left": ((0, 1), (0, 0)),
    "bar left": ((BAR[0], 0), (BAR[0], BAR[2])),
    "bar top": ((BAR[0], BAR[2]), (BAR[1], BAR[2])),
    "bar right": ((BAR[1], BAR[2]), (BAR[1], 0)),
    "lamp": ((LAMP[1], LAMP[2]), (LAMP[0], LAMP[2])),
}
EDGES = {  # name: segment, where on it from 0 to 1, direction away from the edge
    "floor at the left wall": ("floor", 0.0, 1),
    "floor at the right wall": ("floor", 1.0, -1),
    "floor left of the bar": ("floor", BAR[0], -1),
    "floor right of the bar": ("floor", BAR[1], 1),
    "left wall at the floor": ("left", 1.0, -1),
    "right wall at the floor": ("right", 0.0, 1),
    "bar's left side": ("bar left", 0.0, 1),
    "bar's right side": ("bar right", 1.0, -1),
}
SHADED = "floor right of the bar", "bar's right side"  # no direct light there, or next to none


def room(length):
    """{name: (surface, facts)}: u runs along a segment, v along the room; and its BlockRoom."""
    out = {}
    for name, ends in SEGMENTS.items():
        a, b = (np.array([x, 0, z]) for x, z in ends)
        begin, end = np.multiply(LAMP_LENGTH if name == "lamp" else (0, 1), length)
        facts = {"E": 1.0, "is_black": True} if name == "lamp" else {}
        out[name] = rectangle(a + [0, begin, 0], b - a, [0, end - begin, 0]), facts
    (x, z), y = np.eye(3)[[0, 2]], np.array([0, length, 0])
    out |= {"near": (rectangle([0, 0, 0], z, x), {}), "far": (rectangle(y, x, z), {})}
    left, right, top = BAR
    corner, across, up = left * x, (right - left) * x, top * z
    unseen = {"bottom": (corner + across, -across, y), "near": (corner, across, up), "far": (corner + y, up, across)}
    out |= {f"bar {name}": (rectangle(*place), {"role": "cast_only"}) for name, place in unseen.items()}
    lamp = np.array([LAMP[:2], np.multiply(LAMP_LENGTH, length)]).T
    return out, BlockRoom(
        np.array([1, length, 1.0]), np.array([[left, 0, 0], [right, length, top]]), lamp, LAMP[2], RHO
    )


def direct(edge, x, N, lamp):
    """Direct light (k,) at x (k, 3) beside an edge: of the part of the lamp that the bar does not hide."""
    (low_x, low_y), (high_x, high_y) = lamp
    steep = LAMP[2] / BAR[2]  # from the floor, a way to the lamp is so much longer than its part below the bar's top
    if edge == "floor left of the bar":
        high_x = min(high_x, x[0, 0] + steep * (BAR[0] - x[0, 0]))
    elif edge == "floor right of the bar":
        low_x = max(low_x, x[0, 0] - steep * (x[0, 0] - BAR[1]))
    elif edge == "bar's left side":
        high_x = min(high_x, BAR[0])
    elif edge == "bar's right side":
        low_x = max(low_x, BAR[1])
    if low_x >= high_x:
        return np.zeros(len(x))
    corner, size = [low_x, low_y, LAMP[2]], (high_x - low_x, high_y - low_y)
    return numeric_rectangle(x, np.tile(N, (len(x), 1)), corner, [size[0], 0, 0], [0, size[1], 0], [0.0, 0, -1])


def beside(segment, s, length, y):
    """Points (k, 3) at s of a segment, from 0 to 1, and y (k,) of the room's length, and the normal there."""
    a, b = np.array(SEGMENTS[segment], float)
    x, z = a + s * (b - a)
    normal = np.array([a[1] - b[1], 0, b[0] - a[0]]) / np.linalg.norm(b - a)
    return np.stack([np.full(len(y), x), length * y, np.full(len(y), z)], axis=1), normal


def contact_edges(bench):
    """Direct light, all along the edges; all light, its mean along them."""
    paths = PATHS // 4 if bench.is_cheap else PATHS
    for length, what in ((1.0, "bar on a floor"), (LONG, f"the same room {LONG:g} times as long"))[
        : 2 - bench.is_cheap
    ]:
        surfaces, traced = room(length)
        rho = {name: 0.0 if name == "lamp" or "role" in facts else RHO for name, (_, facts) in surfaces.items()}
        once, all_light = (bench.maps(surfaces, rho, CHEAP, bounces=n) for n in (1, "converge"))
        y, rng = np.linspace(*MIDDLE, PLACES), np.random.default_rng(1)
        many = rng.uniform(*MIDDLE, paths)
        for texels, asked in AWAY.items():
            found = {("direct", "mean of it"): {}, ("direct", "RMS along it"): {}, ("all", "mean of it"): {}}
            for edge, (segment, begin, direction) in EDGES.items():
                H, s = read(once[segment], begin, direction * texels, y)
                truth = direct(edge, *beside(segment, s, length, y), traced.lamp)
                if edge not in SHADED:
                    found["direct", "mean of it"][edge] = worst(H.mean(), truth.mean())
                    found["direct", "RMS along it"][edge] = rms(H, truth)
                H, s = read(all_light[segment], begin, direction * texels, y)
                x, N = beside(segment, s, length, many)
                truth = direct(edge, x[:: paths // PLACES], N, traced.lamp).mean()
                truth += traced.bounced(x, np.tile(N, (paths, 1)), rng).mean()
                found["all", "mean of it"][edge] = worst(H.mean(), truth)
            for (light, along), of in found.items():
                edge = max(of, key=of.get)
                name = f"{what}, {texels:g} texel from contact edges, {light} light, worst edge ({edge}), {along}"
                limit = asked if along.startswith("mean") else ALONG if length == 1 else np.inf
                yield Figure(name, "path tracing" if light == "all" else "closed form", limit, of[edge])


def read(baked, begin, texels, y):
    """H (k,) of a map (H, hidden) so many texels from where an edge begins on it, at y (k,) along it; and the place on
    the segment."""
    H, hidden = baked
    h, w = hidden.shape
    s = begin * (w - 1) + texels
    return bilinear(one_deep(H, hidden), np.full(len(y), s), y * (h - 1))[:, 0], s / (w - 1)


CASES = [contact_edges]
