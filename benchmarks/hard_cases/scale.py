"""What must not change the light, or only in a known way: size, place and turn of the world, the unit of emission."""

import numpy as np

from benchmarks.hard_cases.bench import Figure, worst
from benchmarks.hard_cases.shadows import lamp
from lib.nurbs.shape import transformed
from lib.visibility.tracer import Tracer
from stages import tessellate
from tests.rooms import cube
from tests.shapes import cylinder, rectangle, sphere

RAYS = 40000


def still_life(E=1.0):
    """A room with a lamp, a table top and a tube."""
    lift = np.eye(4)
    lift[:3, 3] = 0.3, 0.6, 0.02
    room = cube(1.0) | {"tube": (transformed(cylinder(0.1, 0.3), lift), {})}
    room["top"] = rectangle([0.5, 0.2, 0.3], [0.3, 0, 0], [0, 0.4, 0]), {}
    room["lamp"] = lamp(np.array([0.35, 0.35]), np.array([0.65, 0.65]), 0.95, E)
    return room, {name: 0.6 for name in room} | {"lamp": 0.0}


def placed(room, M):
    """The room with every surface transformed."""
    return {name: (transformed(surface, M), facts) for name, (surface, facts) in room.items()}


def difference(maps, others):
    """RMS difference over the mean of all texels; inf where sizes of maps differ."""
    if any(maps[name][0].shape != others[name][0].shape for name in maps):
        return np.inf
    a, b = (np.concatenate([m[name][0].ravel() for name in maps]).astype(float) for m in (maps, others))
    return float(np.sqrt(np.mean((a - b) ** 2)) / a.mean())


def world(bench):
    """The same room of other size, elsewhere, turned."""
    room, rho = still_life()
    maps = bench.maps(room, rho)
    for scale in (1e-6, 1e6):
        made = bench.maps(placed(room, np.diag([scale, scale, scale, 1.0])), rho)
        yield Figure(f"world times {scale:g}, RMS difference", "the same maps", 1e-3, difference(maps, made))
    away = np.eye(4)
    away[:3, 3] = 1e5, -1e5, 1e5
    made = bench.maps(placed(room, away), rho)
    yield Figure("world moved by 1e5, RMS difference", "the same maps", 1e-2, difference(maps, made))
    a, b = np.radians([33, 21])
    turn = np.eye(4)
    turn[:3, :3] = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]) @ np.array(
        [[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]]
    )
    made = bench.maps(placed(room, turn), rho)
    means = [np.array([m[name][0].mean() for name in sorted(maps)]) for m in (maps, made)]
    error = float(np.abs(means[0] - means[1]).max() / means[0].mean())
    yield Figure("world turned, worst mean of a surface / mean H", "the same light", 0.02, error)


def emission(bench):
    """Light times k; and a room a millionth as bright as the one beside it."""
    room, rho = still_life()
    maps = bench.maps(room, rho)
    for k in (1e-6, 1e6):
        made = bench.maps(still_life(k)[0], rho)
        error = difference({name: (k * H, hidden) for name, (H, hidden) in maps.items()}, made)
        yield Figure(f"emission times {k:g}, RMS difference", "maps times k", 1e-6, error)
    beside = np.eye(4)
    beside[0, 3] = 1.5
    both = {f"bright {k}": piece for k, piece in cube(1.0, E=1e6).items()}
    both |= {f"dim {k}": piece for k, piece in placed(cube(1.0, E=1.0), beside).items()}
    maps = bench.maps(both, 0.5)
    dim = max(worst(H, 2.0) for name, (H, _) in maps.items() if name.startswith("dim"))
    yield Figure("furnace beside one a million times as bright, worst texel", "H = E / (1 - ρ)", 0.02, dim)
    shaded = {"floor": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {})}
    shaded["candle"] = lamp(np.array([0.2, 0.2]), np.array([0.4, 0.4]), 0.2)
    shaded["roof"] = rectangle([-1, -1, 0.3], [3, 0, 0], [0, 3, 0]), {"role": "cast_only", "flip": True}
    rho = {"floor": 0.5, "candle": 0.0, "roof": 0.0, "sun": 0.0}
    alone = bench.maps(shaded, rho)["floor"][0]
    sun = {"sun": lamp(np.array([0.4, 0.4]), np.array([0.6, 0.6]), 0.6, 1e6)}
    H = bench.maps(shaded | sun, rho)["floor"][0]
    corners = [m[[0, 0, -1, -1], [0, -1, 0, -1]] for m in (H, alone)]
    yield Figure("candle below a roof, 1e6 as bright a lamp above, corners", "candle alone", 0.01, worst(*corners))


def mesh_joints(bench):
    """Rays aimed exactly at vertices, and at points of edges, of the mesh of a ball: none gets through."""
    made = tessellate.make([sphere()], np.array([False]), ["full"], 1e-3)
    V, F = made.V.astype(np.float32), made.F
    tracer = Tracer(V, F)
    rng = np.random.default_rng(1)
    D = rng.normal(size=(RAYS, 3))
    origins = (3 * D / np.linalg.norm(D, axis=1, keepdims=True)).astype(np.float32)
    corner, t = F[rng.integers(len(F), size=RAYS)], rng.random((RAYS, 1)).astype(np.float32)
    aims = {"vertices": V[corner[:, 0]], "edges": V[corner[:, 0]] * (1 - t) + V[corner[:, 1]] * t}
    for name, aim in aims.items():
        through = tracer.closest(origins, 1.2 * (aim - origins)).face < 0
        facing = ((aim - origins) * aim).sum(axis=1) < -0.3  # not near the outline, where passing is right
        yield Figure(
            f"rays aimed at {name} of a closed mesh, share that passes", "0", 1e-4, float(through[facing].mean())
        )


CASES = [world, emission, mesh_joints]
