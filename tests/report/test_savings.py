"""Only what a scene needs is computed, and each saving is a number: noted by the stages, named in the report."""

import numpy as np
import pytest

from lib.formats import artefact
from lib.nurbs.shape import transformed
from lib.report import figures
from tests.rooms import Baked, cube, scene_of
from tests.shapes import box, rectangle

RHO = 0.5
LAMP = rectangle([0.4, 0.6, 0.9], [0.2, 0, 0], [0, -0.2, 0]), {"E": 1.0, "is_black": True}


def costs(folder, surfaces, **changes):
    """Cost records of the stages that save something, {name: record}, and the bake."""
    bake = Baked(folder, scene_of(surfaces), RHO, **changes)
    run, records = bake.run, {}

    def logged(stage, name, *argv, **more):
        called = f"{name} {argv[argv.index('--half') + 1]}" if "--half" in argv else name
        path = folder / f"cost {called}.json"
        status = run(stage, name, *argv, **more | {"log": ["--cost", str(path)]})
        records[called] = artefact.read_json(path)
        return status

    bake.run = logged
    return bake.all(), records


def counted(records):
    return figures.notes(records.values())


def test_a_dark_scene_casts_no_row_and_gathers_nothing(tmp_path):
    bake, records = costs(tmp_path, cube())
    assert records["refine indirect"]["rays"] == 0
    notes = counted(records)
    assert notes["no_rows"] > 0 and notes["no_gather"] == 6
    assert not any(H.any() for H, _ in bake.maps().values())


def test_one_bounce_casts_no_row(tmp_path):
    room = cube() | {"lamp": LAMP}
    _, one = costs(tmp_path / "1", room, bounces=1)
    _, many = costs(tmp_path / "n", room)
    assert one["refine indirect"]["rays"] == 0 < many["refine indirect"]["rays"]
    assert one["sample"]["rays"] < many["sample"]["rays"]
    assert counted(one)["no_rows"] > 0 and counted(many)["no_rows"] == 0 and "no_gather" not in counted(many)


def test_even_walls_end_tiny_and_the_levels_are_counted(tmp_path):
    bake, records = costs(tmp_path, cube(E=1.0))
    notes = counted(records)
    assert all(H.shape[:2] == (2, 2) for H, _ in bake.maps().values())
    assert notes["levels_dropped"] >= 6 * 3  # every wall began at level 3 or deeper


def test_surfaces_that_only_cast_cost_no_sample(tmp_path):
    room = cube() | {"lamp": LAMP}
    before, plain = costs(tmp_path / "a", room)
    sheet = rectangle([0.4, 0.4, 0.4], [0.2, 0, 0], [0, 0.2, 0])
    after, more = costs(tmp_path / "b", room | {"sheet": (sheet, {"role": "cast_only"})})
    assert "sheet" not in after.maps() and set(after.maps()) == set(before.maps())
    per_element = {k: r["sample"]["rays"] for k, r in (("plain", plain), ("more", more))}
    assert per_element["more"] < 1.2 * per_element["plain"]


@pytest.mark.parametrize("far", [False, True])
def test_lamps_out_of_sight_or_dim_cost_no_ray(tmp_path, far):
    """A second lamp below the horizon of the floor; or one so weak that it counts as unblocked."""
    floor = {"floor": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {}), "lamp": LAMP}
    dim = rectangle([1.5, 1.5, 0.9], [0.01, 0, 0], [0, -0.01, 0]), {"E": 1e-3, "is_black": True}
    below = rectangle([0, 0, -1], [1, 0, 0], [0, 1, 0]), {"E": 1.0, "is_black": True}
    _, one = costs(tmp_path / "1", floor, bounces=1)
    _, two = costs(tmp_path / "2", floor | {"other": dim if far else below}, bounces=1)
    assert two["sample"]["rays"] <= one["sample"]["rays"]
    assert counted(two)["dim" if far else "below_horizon"] > 0


def test_buried_samples_are_counted(tmp_path):
    put = np.diag([0.3, 0.3, 0.3, 1.0])
    put[:3, 3] = 0.35, 0.35, 0.0
    room = {"floor": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {}), "lamp": LAMP}
    room |= {f"box {k}": (transformed(face, put), {}) for k, face in enumerate(box())}
    _, records = costs(tmp_path, room)
    notes = counted(records)
    assert notes["hidden_points"] > 0 and notes["hidden_samples"] > 0
    named = {row["what"] for row in figures.savings(notes)}
    assert any("buried" in what for what in named)
