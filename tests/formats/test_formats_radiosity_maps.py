"""Files of radiosity maps keep every bit, and what does not fit stops where it is made."""

import numpy as np
import pytest

from lib.formats import artefact
from lib.formats import radiosity_maps as files
from lib.radiosity.radiosity_maps import RadiosityMaps


def some():
    rng = np.random.default_rng(3)
    texels = (rng.random((13, 8)).astype(np.float32) for _ in range(2))
    return RadiosityMaps(np.array([1, 4], np.int32), np.array([[2, 2], [3, 3]], np.int32), *texels)


def test_files_hold_them_bit_for_bit(tmp_path):
    x = some()
    files.save(tmp_path / "x.npz", x)
    y = files.load(tmp_path / "x.npz")
    for field in ("surface", "shape", "value", "direct"):
        assert getattr(x, field).tobytes() == getattr(y, field).tobytes()


@pytest.mark.parametrize(
    "field, broken",
    [
        ("surface", np.array([1, 4])),
        ("shape", np.array([[2, 2], [3, 4]], np.int32)),
        ("direct", np.zeros((13, 4), np.float32)),
        ("value", np.full((13, 8), np.nan, np.float32)),
    ],
)
def test_files_refuse_what_does_not_fit(tmp_path, field, broken):
    with pytest.raises(artefact.ArtefactError, match="expected"):
        files.save(tmp_path / "x.npz", RadiosityMaps(**{**vars(some()), field: broken}))
    assert not (tmp_path / "x.npz").exists()
