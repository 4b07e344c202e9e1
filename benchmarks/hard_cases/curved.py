"""Curved surfaces: against their own tessellation, as lamps, as thin tubes; and surfaces of next to no width."""

import numpy as np

from benchmarks.hard_cases.bench import DENSE, Figure, crossings, looked_up, numeric_rectangle, rms, worst
from benchmarks.hard_cases.shadows import bowl
from lib.nurbs.evaluate import frame_grid
from lib.nurbs.shape import transformed
from tests.rooms import cube
from tests.shapes import cylinder, rectangle, sphere

LEAST = 0.1  # n . l from which the exact surface sees the light


def own_tessellation(bench):
    """A small lamp over a ball, and one in the middle of a bowl: no shadow where the exact surface sees the light."""
    light = [-0.05, 0.05], [0.1, 0, 0], [0, -0.1, 0]
    for name, surface, flip, height in (("ball", sphere(), False, 2.0), ("bowl", bowl(), True, 0.0)):
        corner = [*light[0], height]
        lamp = rectangle(corner, *light[1:]), {"E": 1.0, "is_black": True}
        scene = {name: (surface, {"flip": flip}), "lamp": lamp}
        H = bench.maps(scene, {name: 0.5, "lamp": 0.0}, bounces=1)[name][0][..., 0]
        H = looked_up(H, np.maximum(H.shape, 33))  # a map that was dropped to a few texels must not pass for them
        h, w = H.shape
        S, N = frame_grid(surface, np.linspace(0, 1, w), np.linspace(0, 1, h))
        N = -N if flip else N
        F = numeric_rectangle(S.reshape(-1, 3), N.reshape(-1, 3), corner, *light[1:], [0.0, 0, -1], n=8)
        to_lamp = np.array([0, 0, height]) - S
        seen = (to_lamp * N).sum(axis=2) > LEAST * np.linalg.norm(to_lamp, axis=2)
        seen &= S[..., 2] < height - 0.1  # in front of the lamp
        F = F.reshape(h, w)
        error = worst(H[seen], F[seen])
        yield Figure(f"{name} below its own mesh, n · l > 0.1, worst texel", "numeric integration", 0.05, error)
        yield Figure(f"{name} below its own mesh, RMSE", "numeric integration", 0.01, rms(H[seen], F[seen]))


def lamps(bench):
    """A ball over a floor, F = h r^2 / d^3; a standing tube before a wall (Howell's catalogue, B-31)."""
    r, height = 0.2, 1.0
    put = np.diag([r, r, r, 1.0])
    put[2, 3] = height
    floor = [-1.0, -1, 0], [2.0, 0, 0], [0.0, 2, 0]
    glow = {"E": 1.0, "is_black": True}
    scene = {"floor": (rectangle(*floor), {}), "lamp": (transformed(sphere(), put), glow)}
    rho = {"floor": 0.5, "lamp": 0.0}
    H = looked_up(bench.maps(scene, rho, bounces=1)["floor"][0][..., 0], (DENSE, DENSE))
    d2 = (crossings(H.shape, *floor)[..., :2] ** 2).sum(axis=2) + height**2
    yield Figure("lamp that is a ball, worst texel", "H = E r² h / d³", 0.02, worst(H, r * r * height / d2**1.5))
    radius, length, away = 0.1, 1.0, 0.5
    wall = [away, -0.5, 0], [0, 0, length], [0, 1, 0]
    scene = {"floor": (rectangle(*wall), {}), "lamp": (cylinder(radius, length), glow)}
    H = looked_up(bench.maps(scene, rho, bounces=1)["floor"][0][..., 0], (DENSE, DENSE))
    z = np.clip(np.linspace(0, 1, H.shape[1]), 0.002, 0.998) * length
    F = tube(away, radius, z) + tube(away, radius, length - z)
    yield Figure("lamp that is a tube, middle line, worst texel", "closed form", 0.02, worst(H[len(H) // 2], F))
    power = _absorbed(bench, r)
    yield Figure("power of a ball within a black room", "E A", 0.01, abs(power / (4 * np.pi * r * r) - 1))


def _absorbed(bench, r):
    put = np.diag([r, r, r, 1.0])
    put[:3, 3] = 0.45, 0.5, 0.55
    room = cube(1.0) | {"lamp": (transformed(sphere(), put), {"E": 1.0, "is_black": True})}
    maps = bench.maps(room, {name: 0.5 for name in room} | {"lamp": 0.0}, bounces=1)
    total = 0.0
    for H, _ in maps.values():
        weights = [np.concatenate([[0.5], np.ones(n - 2), [0.5]]) / (n - 1) for n in H.shape[:2]]
        total += weights[0] @ H[..., 0] @ weights[1]
    return total


def tube(away, radius, length):
    """F from a small plane at `away` from the axis, facing it, at one end of a tube."""
    D, L = away / radius, np.asarray(length) / radius
    A, B = (D + 1) ** 2 + L**2, (D - 1) ** 2 + L**2
    first = np.arctan(L / np.sqrt(D * D - 1)) / (np.pi * D)
    second = (A - 2 * D) / (D * np.sqrt(A * B)) * np.arctan(np.sqrt(A * (D - 1) / (B * (D + 1))))
    return first + L / np.pi * (second - np.arctan(np.sqrt((D - 1) / (D + 1))) / D)


def slender(bench):
    """A tube of 1/1000 of the room, a strip of a millionth: all as bright as the furnace around them."""
    lift = np.eye(4)
    lift[:3, 3] = 0.5, 0.5, 0.1
    strip = rectangle([0.3, 0.3, 0.5], [0.4, 0, 0], [0, 1e-6, 0])
    for name, thing in (("thin tube, 1/1000 of the room", cylinder(1e-3, 0.8)), ("strip, 1e-6 wide", strip)):
        at = lift if name.startswith("thin") else np.eye(4)
        maps = bench.maps(cube(1.0, E=1.0) | {"thing": (transformed(thing, at), {"E": 1.0})}, 0.5)
        yield Figure(f"{name}, in a furnace, worst texel of it", "H = E / (1 - ρ)", 0.02, worst(maps["thing"][0], 2.0))
        walls = max(worst(H, 2.0) for name, (H, _) in maps.items() if name != "thing")
        yield Figure(f"{name}, worst texel of the room", "H = E / (1 - ρ)", 0.02, walls)


CASES = [own_tessellation, lamps, slender]
