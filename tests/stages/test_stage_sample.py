"""Stage sample: what the file holds, that chunks agree, and what it refuses."""

from pathlib import Path

import numpy as np
import pytest

from lib.formats import artefact, casters, samples
from lib.nurbs.shape import transformed
from lib.nurbs.surface import from_points
from lib.radiosity.form_factors import form_factor_polygon
from lib.radiosity.sampling import finer
from stages import sample
from tests.rooms import Baked, cube, scene_of
from tests.shapes import cylinder, rectangle, sphere

FLOOR = rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0])
LAMP = rectangle([0.25, 0.75, 1], [0.5, 0, 0], [0, -0.5, 0])


def still_life():
    """A floor, a wall, a tube standing in the air below the lamp."""
    lift = np.eye(4)
    lift[:3, 3] = 0.5, 0.5, 0.2
    tube = {"tube": (transformed(cylinder(0.1, 0.4), lift), {})}
    wall = {"wall": (rectangle([0, 0, 0], [0, 1, 0], [0, 0, 1]), {})}
    return {"floor": (FLOOR, {}), "lamp": (LAMP, {"E": [3, 2, 1], "is_black": True})} | tube | wall


def sampled(folder, surfaces, chunks=1, **changes):
    bake = Baked(folder, scene_of(surfaces), 0.5, chunks=chunks, **changes)
    assert bake.tessellate() == 0
    assert [bake.sample(c) for c in range(chunks)] == [0] * chunks
    return bake, [samples.load(bake.path("samples", c)) for c in range(chunks)]


def test_direct_light_on_the_base_lattice(tmp_path):
    """An open floor below a lamp: the form factor at every crossing, borders 0.002 inside."""
    surfaces = {"floor": (FLOOR, {}), "lamp": (LAMP, {"E": [3, 2, 1], "is_black": True})}
    _, (x,) = sampled(tmp_path, surfaces)
    assert x.surface.tolist() == [0] and x.first.tolist() == [0, len(x.value)]
    side = 2 ** int(x.level[0]) + 1
    t = np.clip(np.linspace(0, 1, side), 0.002, 0.998)
    at = np.stack([*np.meshgrid(t, t), np.zeros((side, side))], axis=-1).reshape(-1, 3)
    corners = np.array([[0.25, 0.25, 1], [0.75, 0.25, 1], [0.75, 0.75, 1], [0.25, 0.75, 1]])
    F = form_factor_polygon(corners - at[:, None], np.tile([0.0, 0, 1], (len(at), 1)))
    assert x.value == pytest.approx(F[:, None] * [3, 2, 1], rel=1e-3)
    assert not x.hidden.any()


def test_elements_of_all_surfaces_that_reflect(tmp_path):
    """Every element once, rows as long as asked, H_direct the light at its points."""
    bake, (x,) = sampled(tmp_path, still_life(), rays_per_element=32)
    grids = vars(casters.load(bake.path("casters")))
    assert x.element.tolist() == list(range(len(x.element)))
    assert x.entries.shape == (len(x.element), 32) and x.entries.max() < len(x.element)
    total = grids["area"][[0, 2, 3]].sum()  # floor, tube, wall: the lamp is black
    assert x.area.sum() == pytest.approx(total, rel=1e-3)
    assert (x.H_direct >= 0).all() and x.H_direct.max() <= 1.01 * x.value.max()


def squeezed(degree=5):
    """The floor, with a fifth of its u taking four fifths of its width: speeds from 5 to 0.002."""
    knots, x = [0] * (degree + 1) + [1] * (degree + 1), 1 - np.linspace(1, 0, degree + 1) ** 6
    net = [[[a, b, 0] for b in (0, 1)] for a in x]
    return from_points(degree, 1, knots, [0, 0, 1, 1], net)


@pytest.mark.parametrize("floor", [FLOOR, squeezed()], ids=["even", "uneven speed"])
def test_elements_receive_what_was_sent(tmp_path, floor):
    """Power on the floor, its crest below the lamp included, against F summed over the floor: straight lines between
    the samples would lose 0.5 %.  Means are by area however unevenly points lie."""
    surfaces = {"floor": (floor, {}), "lamp": (LAMP, {"E": [3, 2, 1], "is_black": True})}
    _, (x,) = sampled(tmp_path, surfaces)
    t = (np.arange(200) + 0.5) / 200
    at = np.stack([*np.meshgrid(t, t), np.zeros((200, 200))], axis=-1).reshape(-1, 3)
    corners = np.array([[0.25, 0.25, 1], [0.75, 0.25, 1], [0.75, 0.75, 1], [0.25, 0.75, 1]])
    F = form_factor_polygon(corners - at[:, None], np.tile([0.0, 0, 1], (len(at), 1)))
    received = (x.H_direct[:, :, 0] * x.area[..., None]).sum(axis=(0, 1)) / x.area.sum()
    assert received == pytest.approx(F.mean() * np.array([3, 2, 1]), rel=1e-3)


def test_lattices_twice_as_fine_follow_bends_and_keep_the_dark():
    """Parabolas exactly, a step straight across, nothing between dark ends, hidden ends left out."""
    t = np.linspace(0, 1, 9)
    bent = np.broadcast_to((2 - t**2)[None, :, None], (3, 9, 1))
    fine, hidden = finer(bent, np.zeros((3, 9), bool))
    assert fine[:, :, 0] == pytest.approx(np.tile(2 - np.linspace(0, 1, 17) ** 2, (5, 1))) and not hidden.any()
    step = np.broadcast_to(np.array([0, 0, 0, 1, 1, 1.0])[None, :, None], (3, 6, 1))
    assert finer(step, np.zeros((3, 6), bool))[0][0, :, 0].tolist() == [0, 0, 0, 0, 0, 0.5, 1, 1, 1, 1, 1]
    buried = np.zeros((3, 6), bool)
    buried[:, :3] = True
    fine, hidden = finer(step, buried)
    assert fine[0, 5:, 0].tolist() == [1] * 6 and hidden[0].tolist() == [True] * 5 + [False] * 6


def test_three_chunks_hold_what_one_holds(tmp_path):
    """Byte by byte, surface by surface."""
    _, (whole,) = sampled(tmp_path / "1", still_life())
    _, parts = sampled(tmp_path / "3", still_life(), chunks=3)
    assert sorted(s for p in parts for s in p.surface) == whole.surface.tolist()
    for p in parts:
        for k, s in enumerate(p.surface):
            at = np.flatnonzero(whole.surface == s)[0]
            mine, its = slice(*p.first[k : k + 2]), slice(*whole.first[at : at + 2])
            for field in ("value", "hidden", "noise"):
                assert getattr(p, field)[mine].tobytes() == getattr(whole, field)[its].tobytes()
        for field in ("entries", "is_hidden", "area", "H_direct"):
            assert getattr(p, field).tobytes() == getattr(whole, field)[p.element].tobytes()


def test_same_bytes_again_and_others_for_another_seed(tmp_path):
    runs = (("a", 1), ("b", 1), ("c", 2))
    files = [sampled(tmp_path / name, still_life(), seed=seed)[0].path("samples", 0) for name, seed in runs]
    one, again, other = (Path(file).read_bytes() for file in files)
    assert one == again != other


def test_more_chunks_than_surfaces(tmp_path):
    _, parts = sampled(tmp_path, {"floor": (FLOOR, {})}, chunks=3)
    assert [len(p.surface) for p in parts] == [1, 0, 0]
    assert parts[2].value.shape == (0, 3) and parts[2].H_direct.shape == (0, 16, 1, 3)


def test_one_bounce_casts_no_element_rays(tmp_path):
    cost = {}
    for bounces in (1, "converge"):
        bake = Baked(tmp_path / str(bounces), scene_of(still_life()), 0.5, bounces=bounces)
        bake.tessellate()
        argv = ["--casters", bake.path("casters"), "--chunk", "0", "--chunks", "1", "--out", bake.path("samples", 0)]
        assert bake.run(sample, "sample", *argv, log=["--cost", str(tmp_path / "cost.json")]) == 0
        cost[bounces] = artefact.read_json(tmp_path / "cost.json")
        x = samples.load(bake.path("samples", 0))
        assert (x.entries < 0).all() == (bounces == 1)
    assert 0 < cost[1]["rays"] < cost["converge"]["rays"]
    assert cost[1]["stage"] == "sample" and cost[1]["seconds"] > 0


def test_no_emission_is_no_light(tmp_path):
    _, (x,) = sampled(tmp_path, cube())
    assert not x.value.any() and not x.H_direct.any() and not x.hidden.any()


def test_hidden_samples_are_those_inside(tmp_path):
    """A ball of radius 1/4 half sunk in the floor: crossings below it are hidden, others are not."""
    r = 0.25
    sunk = np.diag([r, r, r, 1.0])
    sunk[:2, 3] = 0.5
    lamp = {"lamp": (rectangle([0, 1, 2], [1, 0, 0], [0, -1, 0]), {"E": 1.0, "is_black": True})}
    surfaces = {"ball": (transformed(sphere(), sunk), {}), "floor": (FLOOR, {})} | lamp
    _, (x,) = sampled(tmp_path, surfaces)
    side = 2 ** int(x.level[1]) + 1
    hidden = x.hidden[x.first[1] : x.first[2]].reshape(side, side)
    t = np.linspace(-0.5, 0.5, side)
    away = np.hypot(*np.meshgrid(t, t))
    assert hidden[away < 0.95 * r].all() and not hidden[away > 1.05 * r].any()


@pytest.mark.parametrize("name", ["scene", "casters"])
def test_damaged_files_are_refused_by_name(tmp_path, capsys, name):
    bake = Baked(tmp_path, scene_of(still_life()), 0.5)
    bake.tessellate()
    data = bytearray(Path(bake.path(name)).read_bytes())
    data[len(data) // 2] ^= 1
    Path(bake.path(name)).write_bytes(data)
    assert bake.sample(0) == 1
    said = capsys.readouterr().err
    assert bake.path(name) in said and "damaged" in said and len(said.splitlines()) == 1
    assert not (tmp_path / "samples_0.npz").exists()
