"""What a bake says of itself: where the power went, when it stops, what it refuses."""

from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks.hard_cases.bench import Figure, parallel_rectangle, worst
from benchmarks.hard_cases.shadows import FLOOR, LAMP, lamp
from lib.formats import preflight, solution
from lib.radiosity import refine
from lib.refusal import Refusal
from tests.rooms import cube
from tests.shapes import rectangle


def open_scene(bench):
    """The account of a floor below a lamp: what it reflects escapes."""
    rho, surfaces = 0.3, {"floor": (rectangle(*FLOOR), {}), "lamp": lamp()}
    bake = bench.bake(surfaces, {"floor": rho, "lamp": 0.0})
    told = solution.load(bake.path("solution")).ledger
    power = {name: float(np.sum(rows, axis=0)[0]) for name, rows in told.items()}
    t, weight = np.polynomial.legendre.leggauss(64)  # the floor goes from -1 to 1
    F = parallel_rectangle(np.stack(np.meshgrid(t, t), axis=-1), *LAMP, 1.0)
    received = float(weight @ F @ weight)
    what = "floor below a lamp, open: power"
    yield Figure(f"{what} emitted", "E A", 1e-6, worst(power["emitted"], np.prod(LAMP[1] - LAMP[0])))
    yield Figure(f"{what} received", "closed form", 0.01, worst(power["received"], received))
    yield Figure(f"{what} absorbed", "1 - ρ of that", 0.01, worst(power["absorbed"], (1 - rho) * received))
    yield Figure(f"{what} escaped", "ρ of that", 0.01, worst(power["escaped"], rho * received))
    rest = power["received"] - power["absorbed"] - power["escaped"] - power["unshot"]
    yield Figure(f"{what} of which no account is given, over received", "0", 1e-6, abs(rest) / received)


def stopping(bench):
    """A closed room, solved to an unshot share of 5 %."""
    rho, convergence = 0.9, 0.05
    room = cube(1.0)
    room["wall 1"][1]["E"] = 6.0
    bake = bench.bake(room, rho, convergence=convergence)
    mean_H = solution.load(bake.path("solution")).mean_H.max()
    asked = rho * convergence
    yield Figure(f"closed room, ρ = {rho}, stopped at 5 % unshot, mean H", "1 / (1 - ρ)", asked, worst(mean_H, 10.0))


WRONG = """
geometry:
- {{name: floor, rectangle: {{origin: [0, 0, 0], u: [1, 0, 0], v: [0, 1, 0]}}, material: paint}}
- {{name: lamp, rectangle: {{origin: [0, 0, 1], u: [0, 1, 0], v: [1, 0, 0]}}, material: lamp}}
materials: {{paint: {{reflectance: {rho}}}, lamp: {{emission: {E}}}}}
"""
WRONG_RHO, WRONG_E = ("1.01", "-0.01", ".nan", ".inf", "[0.5, 0.5]", "[0.5, 0.5, 2]"), ("-1", ".nan", ".inf", "[1, 2]")


def wrong_input(bench):
    """Reflectances and emissions that do not exist."""
    field = {"rho": "materials.paint.reflectance", "E": "materials.lamp.emission"}
    missed = 0
    for key, values in (("rho", WRONG_RHO), ("E", WRONG_E)):
        for k, value in enumerate(values):
            path = bench.file(f"wrong {key} {k}/scene.yaml", WRONG.format(**{"rho": "0.5", "E": "1", key: value}))
            try:
                preflight.load(path.parent, results_root=bench.folder / "made")
                missed += 1
            except Refusal as error:
                missed += field[key] not in str(error) and f"'{value}'" not in str(error)
    what = f"{len(WRONG_RHO)} wrong reflectances, {len(WRONG_E)} wrong emissions: not refused by name"
    yield Figure(what, "0", 0, float(missed))


def not_finite(bench):
    """One gathered sample becomes NaN."""
    bake = bench.prepare(cube(1.0, E=1.0), 0.5)
    for step in (bake.tessellate, lambda: bake.sample(0), bake.shoot, lambda: bake.refine("direct", 0)):
        step()
    gathered = refine.indirect_light

    def broken(*args):
        light = gathered(*args)
        light.H[0] = np.nan
        return light

    with patch.object(refine, "indirect_light", broken):
        try:
            stopped = bake.refine("indirect", 0) != 0
        except ValueError as error:
            stopped = "surface" in str(error)
    made = Path(bake.path("indirect", 0)).exists()
    yield Figure("a sample that is NaN: not stopped at, or written (0 no)", "0", 0, float(made or not stopped))


CASES = [open_scene, stopping, wrong_input, not_finite]
