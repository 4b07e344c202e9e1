"""Closed rooms: white furnaces, integrating spheres, edges and corners, reflectances near 1."""

import numpy as np

from benchmarks.hard_cases.bench import STANDARD, Figure, quietly, rms, worst
from lib.formats import preflight
from tests.rooms import cube
from tests.shapes import rectangle, revolved


def furnace(bench):
    """Every wall glows and reflects alike."""
    for rho, asked in ((0.5, 0.01), (0.9, 0.05), (0.99, 0.10)):
        maps = bench.maps(cube(2.0, E=1.0), rho)
        error = max(worst(H * (1 - rho), 1.0) for H, _ in maps.values())
        yield Figure(f"white furnace, ρ = {rho}, worst texel, borders included", "H = E / (1 - ρ)", asked, error)
    rho = 0.999
    maps = bench.maps(cube(2.0, E=1.0), rho)
    error = max(worst(H * (1 - rho), 1.0) for H, _ in maps.values())
    yield Figure("white furnace, ρ = 0.999, worst texel", "H = E / (1 - ρ)", 0.20, error)


def any_emission(bench):
    """The same reflectance everywhere, one wall glows: the mean is known."""
    room = cube(1.0)
    room["wall 1"][1]["E"] = 6.0
    for rho in (0.5, 0.9):
        maps = bench.maps(room, rho)
        B = 1 + rho * np.mean([_mean(H) for H, _ in maps.values()])
        error = worst(B, 1 / (1 - rho))
        yield Figure(f"closed room, one glowing wall, ρ = {rho}, mean B", "mean E / (1 - ρ)", 0.01, error)


def _mean(H):
    weights = [np.concatenate([[0.5], np.ones(n - 2), [0.5]]) / (n - 1) for n in H.shape[:2]]
    return weights[0] @ H[..., 0] @ weights[1]


ZONES = {  # of the unit sphere: latitudes in degrees, E, rho
    "zone 1": (-90, -30, 0.0, 0.2),
    "zone 2": (-30, 10, 2.0, 0.5),
    "zone 3": (10, 45, 0.0, 0.8),
    "zone 4": (45, 90, 1.0, 0.6),
}


def zone(low, high):
    """Part of the unit sphere between two latitudes in degrees, normals outwards."""
    a, b = np.radians([low, high])
    middle, half = (a + b) / 2, (b - a) / 2
    profile = [[np.cos(t) * r, np.sin(t) * r] for t, r in ((a, 1), (middle, 1 / np.cos(half)), (b, 1))]
    profile = np.where(np.abs(profile) < 1e-15, 0.0, profile)
    return revolved(profile, [1, np.cos(half), 1], 2, [0, 0, 0, 1, 1, 1])


def spheres(bench):
    """A hollow sphere: every point sees every piece of it by its share of the area, so H is the same everywhere."""
    for name, zones in (("closed", list(ZONES)), ("open, its top missing", list(ZONES)[:3])):
        surfaces = {k: (zone(*ZONES[k][:2]), {"E": ZONES[k][2], "flip": True}) for k in zones}
        share = {k: np.diff(np.sin(np.radians(ZONES[k][:2])))[0] / 2 for k in zones}
        power = sum(share[k] * ZONES[k][2] for k in zones)
        H = power / (1 - sum(share[k] * ZONES[k][3] for k in zones))
        maps = bench.maps(
            surfaces, {k: ZONES[k][3] for k in zones}, cheap=STANDARD | {"max_level": 4, "elements": 1000}
        )
        values = np.concatenate([m[0].ravel() for m in maps.values()])
        yield Figure(f"hollow sphere of uneven E and ρ, {name}, RMSE", "H = Σ E A / (A - Σ ρ A)", 0.01, rms(values, H))
        yield Figure(f"hollow sphere of uneven E and ρ, {name}, worst texel", "the same", 0.05, worst(values, H))


def edges(bench):
    """What border samples of a box see: of walls that glow, and of walls that reflect."""
    room = cube(1.0, E=1.0)
    one = {name: H for name, (H, _) in bench.maps(room, 0.5, bounces=1).items()}
    direct = min(np.min(H) for H in one.values())
    maps = bench.maps(room, 0.5, bounces=2)
    gathered = min(np.min((H - 1) / 0.5) for H, _ in maps.values())
    yield Figure("closure at edges and corners, direct light", "1", 0.02, 1 - direct)
    yield Figure("closure at edges and corners, gathered light", "1", 0.02, 1 - gathered)


def narrow_gap(bench):
    """Two glowing plates a hundredth of their side apart: in the middle it is a furnace."""
    floor = rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0])
    lid = rectangle([0, 0, 0.01], [0, 1, 0], [1, 0, 0])
    plates = {"floor": (floor, {"E": 1.0}), "lid": (lid, {"E": 1.0})}
    H, _ = bench.maps(plates, 0.5, cheap=STANDARD)["floor"]
    n = [len(H) // 4, H.shape[1] // 4]
    middle = H[n[0] : -n[0], n[1] : -n[1]]
    yield Figure("gap of 1/100 between glowing plates, middle", "H = E / (1 - ρ)", 0.01, worst(middle, 2.0))


PERFECT = """
geometry:
- {{name: floor, rectangle: {{origin: [0, 0, 0], u: [1, 0, 0], v: [0, 1, 0]}}}}
- {{name: ceiling, rectangle: {{origin: [0, 0, 1], u: [0, 1, 0], v: [1, 0, 0]}}, material: lamp}}
- {{name: south, rectangle: {{origin: [0, 0, 0], u: [0, 0, 1], v: [1, 0, 0]}}}}
- {{name: north, rectangle: {{origin: [0, 1, 0], u: [1, 0, 0], v: [0, 0, 1]}}}}
- {{name: west, rectangle: {{origin: [0, 0, 0], u: [0, 1, 0], v: [0, 0, 1]}}}}
- {{name: east, rectangle: {{origin: [1, 0, 0], u: [0, 0, 1], v: [0, 1, 0]}}}}
materials: {{default: {{reflectance: {rho}}}, lamp: {{reflectance: {rho}, emission: 1}}}}
"""


def perfect_mirror_room(bench):
    """All reflectances 1 in a closed room: refused, never an answer."""
    status, said = quietly(_shot, bench.prepare(cube(1.0, E=1.0), 1.0))
    refused = status == 1 and "does not converge" in said and "Traceback" not in said
    yield Figure("ρ = 1 everywhere, closed: refused in one line (0 yes, 1 no)", "refusal", 0, 0.0 if refused else 1.0)
    path = bench.file("perfect/scene.yaml", PERFECT.format(rho=0.97))
    said = preflight.load(path.parent, results_root=bench.folder / "made").warnings
    warned = any("0.95" in text for text in said)
    yield Figure("ρ above 0.95: warned of (0 yes, 1 no)", "warning", 0, 0.0 if warned else 1.0)


def _shot(bake):
    return bake.tessellate() or bake.sample(0) or bake.shoot()


CASES = [furnace, any_emission, spheres, edges, narrow_gap, perfect_mirror_room]
