"""Light that is NaN stops the stage it appears in with one line that names the surface, and is never written."""

from pathlib import Path

import numpy as np
import pytest

from lib.radiosity import refine, sampling
from lib.refusal import Refusal, demand_finite
from tests.rooms import Baked, cube, scene_of


def test_what_is_not_finite_is_refused_by_name():
    demand_finite({"floor": np.full((2, 3), 3e38, dtype=np.float32)})
    with pytest.raises(Refusal, match="^surface lamp and 1 more: NaN or Inf in its light; nothing is written$"):
        demand_finite({"floor": np.zeros(3), "lamp": np.array([1.0, np.nan]), "wall": np.array([np.inf])})


@pytest.mark.parametrize(
    "module, name, stage", [(sampling, "direct_light", "sample"), (refine, "indirect_light", "refine")]
)
def test_nan_stops_the_stage_it_appears_in(tmp_path, capsys, monkeypatch, module, name, stage):
    bake = Baked(tmp_path, scene_of(cube(E=1.0)), 0.5, tolerance=0.1)
    before = [bake.tessellate, lambda: bake.sample(0), bake.shoot, lambda: bake.refine("direct", 0)]
    for step in before[:1] if stage == "sample" else before:
        assert step() == 0
    measured = getattr(module, name)

    def broken(*args):
        light = measured(*args)
        light.H[0] = np.nan
        return light

    monkeypatch.setattr(module, name, broken)
    assert (bake.sample(0) if stage == "sample" else bake.refine("indirect", 0)) == 1
    assert capsys.readouterr().err == "surface wall 0: NaN or Inf in its light; nothing is written\n"
    assert not Path(bake.path("samples" if stage == "sample" else "indirect", 0)).exists()
