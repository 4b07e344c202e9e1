"""Stage shoot: the account in watts, what does not converge, chunks in any order, refusals."""

from pathlib import Path

import numpy as np
import pytest

from lib.formats import artefact, samples, solution
from lib.nurbs.shape import transformed
from stages import shoot
from tests.rooms import Baked, cube, scene_of
from tests.shapes import rectangle


def sampled(folder, surfaces, rho=0.5, chunks=1, **changes):
    bake = Baked(folder, scene_of(surfaces), rho, chunks=chunks, **changes)
    assert not any([bake.tessellate(), *(bake.sample(c) for c in range(chunks))])
    return bake


def solved(folder, surfaces, rho=0.5, **changes):
    bake = sampled(folder, surfaces, rho, **changes)
    assert bake.shoot() == 0
    return solution.load(bake.path("solution"))


def lit_room(side=1.0):
    room = cube(side)
    lamp = rectangle(np.array([0.25, 0.75, 0.99]) * side, [0.5 * side, 0, 0], [0, -0.5 * side, 0])
    return room | {"lamp": (lamp, {"E": [4.0, 2, 1], "is_black": True})}


@pytest.mark.parametrize("side", [1.0, 3.0])
def test_the_account_is_in_watts(tmp_path, side):
    """4 W/m2 over a quarter of side^2; a closed room keeps all but what meets the black lamp."""
    x = solved(tmp_path, lit_room(side))
    ledger = {name: np.array(power) for name, power in x.ledger.items()}
    assert ledger["emitted"][0] == pytest.approx(np.array([4, 2, 1]) * side**2 / 4, rel=1e-6)
    assert ledger["received"][0] == pytest.approx(ledger["emitted"][0], rel=0.03)
    assert ledger["received"] == pytest.approx(ledger["absorbed"] + ledger["escaped"] + ledger["unshot"], rel=1e-9)
    assert 0 <= ledger["escaped"][0, 0] < 0.2 * ledger["received"][0, 0]


def test_a_furnace_has_the_same_irradiance_everywhere(tmp_path):
    x = solved(tmp_path, cube(2.0, E=1.0))
    assert x.H_indirect == pytest.approx(np.ones_like(x.H_indirect), rel=0.01)  # H = 2, half of it direct
    assert x.mean_H == pytest.approx([2, 2, 2], rel=0.01)
    assert x.H_surface == pytest.approx(np.full((6, 3), 2.0), rel=0.01)
    assert not x.is_hidden.any() and not x.is_alone.any()
    assert x.first.tolist() == np.cumsum([0, *(x.n_u * x.n_v)]).tolist()


def test_no_ray_is_cast(tmp_path):
    bake = sampled(tmp_path, lit_room())
    files = ["--casters", bake.path("casters"), "--materials", str(tmp_path / "materials.json")]
    files += ["--samples", bake.path("samples", 0), "--out", bake.path("solution")]
    assert bake.run(shoot, "shoot", *files, log=["--cost", str(tmp_path / "cost.json")]) == 0
    assert artefact.read_json(tmp_path / "cost.json")["rays"] == 0


def test_chunks_in_any_order_are_the_same_bytes(tmp_path):
    bake = sampled(tmp_path, lit_room(), chunks=3)
    found = set()
    for order in ([0, 1, 2], [2, 0, 1]):
        files = ["--casters", bake.path("casters"), "--materials", str(tmp_path / "materials.json")]
        files += ["--samples", *(bake.path("samples", c) for c in order), "--out", bake.path("solution")]
        assert bake.run(shoot, "shoot", *files) == 0
        found.add(Path(bake.path("solution")).read_bytes())
    one = solved(tmp_path / "one", lit_room())
    assert len(found) == 1
    assert np.array_equal(one.H_indirect, solution.load(bake.path("solution")).H_indirect)


def test_reflectances_are_taken_by_name(tmp_path):
    """Unknown names and surfaces without a reflectance reflect nothing."""
    room = lit_room()
    x = solved(tmp_path, room, rho={"wall 0": [0.9, 0.5, 0], "nobody": 1.0})
    names = sorted(room)
    assert x.rho[names.index("wall 0")].tolist() == [0.9, 0.5, 0] and x.rho.sum() == pytest.approx(1.4)
    assert not x.H_indirect[..., 2].any() and x.H_indirect[..., 0].any()


@pytest.mark.parametrize("bounces", [1, 2, 3])
def test_a_number_of_bounces(tmp_path, bounces):
    """The sum that the final gather reads: nothing of it indirect before the third reflection."""
    x = solved(tmp_path, cube(1.0, E=1.0), bounces=bounces)
    expected = {1: 0, 2: 0, 3: 0.5}[bounces]
    assert x.H_indirect == pytest.approx(np.full_like(x.H_indirect, expected), rel=0.01)
    assert len(x.history) == 0 and x.facts["shots"] == 0


def test_no_emission(tmp_path):
    x = solved(tmp_path, cube())
    assert not x.H_indirect.any() and not x.mean_H.any() and not np.array(x.ledger["received"]).any()


def test_a_white_closed_room_is_refused(tmp_path, capsys):
    bake = sampled(tmp_path, cube(1.0, E=1.0), rho=1.0)
    assert bake.shoot() == 1
    said = capsys.readouterr().err
    assert "does not converge" in said and len(said.strip().splitlines()) == 1
    assert not Path(bake.path("solution")).exists()


def test_history_falls_to_the_convergence_asked(tmp_path):
    coarse = solved(tmp_path / "a", lit_room(), convergence=0.1)
    fine = solved(tmp_path / "b", lit_room(), convergence=0.001)
    assert coarse.history[-1, 1] <= 0.1 and fine.history[-1, 1] <= 0.001
    assert fine.facts["shots"] > coarse.facts["shots"] > 0


def test_the_unit_changes_nothing_but_the_watts(tmp_path):
    one = solved(tmp_path / "1", lit_room())
    grown = {k: (transformed(s, np.diag([1e3, 1e3, 1e3, 1])), facts) for k, (s, facts) in lit_room().items()}
    large = solved(tmp_path / "2", grown)
    assert large.H_indirect == pytest.approx(one.H_indirect, rel=1e-2, abs=1e-3 * one.mean_H.max())
    assert np.array(large.ledger["received"]) == pytest.approx(1e6 * np.array(one.ledger["received"]), rel=1e-3)


@pytest.mark.parametrize("fault", ["missing", "cut", "another kind"])
def test_bad_samples_are_refused_by_name(tmp_path, capsys, fault):
    bake = sampled(tmp_path, lit_room())
    path = Path(bake.path("samples", 0))
    if fault == "missing":
        path.unlink()
    elif fault == "cut":
        path.write_bytes(path.read_bytes()[:-100])
    else:
        path.write_bytes(Path(bake.path("casters")).read_bytes())
    assert bake.shoot() == 1
    said = capsys.readouterr().err
    assert str(path) in said and len(said.strip().splitlines()) == 1


def test_arrays_of_other_names_are_refused(tmp_path, capsys):
    """A file of the right kind whose arrays are not those of the contract: written by other code."""
    bake = sampled(tmp_path, lit_room())
    path = bake.path("samples", 0)
    header, arrays = artefact.read(path, "samples", samples.VERSION)
    header.pop("kind"), header.pop("version")
    arrays["penumbra"] = arrays.pop("hidden")
    artefact.write(path, "samples", samples.VERSION, header, arrays)
    assert bake.shoot() == 1
    assert path in capsys.readouterr().err


def test_the_plot_draws_the_history(tmp_path):
    bake = sampled(tmp_path, lit_room())
    files = ["--casters", bake.path("casters"), "--materials", str(tmp_path / "materials.json")]
    files += ["--samples", bake.path("samples", 0), "--out", bake.path("solution")]
    assert bake.run(shoot, "shoot", *files, log=["--plot", str(tmp_path / "convergence.svg")]) == 0
    rounds = len(solution.load(bake.path("solution")).history)
    assert rounds > 2 and (tmp_path / "convergence.svg").read_text().count("<circle") == rounds
