"""What `sample` measures for a chunk of surfaces: direct light on base lattices, and the elements with their rows."""

from dataclasses import dataclass

import numpy as np

from lib.formats import artefact

KIND, VERSION = "samples", 4


@dataclass(frozen=True)
class Samples:
    """One chunk.

    surface (m,) int32 surfaces with maps, ascending; level (m,) int32, base level of their direct trees
    first (m + 1,) int64 offsets of their lattices in value (N, 3 G) float32 [W/m^2], hidden (N,) bool, noise (N,)
    float32
    element (k,) int32 global numbers; entries (k, R) int32, met (k, R) uint8, is_hidden (k, 16) bool as Rows has them;
    is_alone (k,) bool as Parts has it; area (k, 16) float64 that the elements' points stand for, in frame units, and
    H_direct (k, 16, G, 3) float32 there, both 0 where hidden
    """

    surface: np.ndarray
    level: np.ndarray
    first: np.ndarray
    value: np.ndarray
    hidden: np.ndarray
    noise: np.ndarray
    element: np.ndarray
    entries: np.ndarray
    met: np.ndarray
    is_hidden: np.ndarray
    is_alone: np.ndarray
    area: np.ndarray
    H_direct: np.ndarray


ARRAYS = list(Samples.__dataclass_fields__)


def check(x):
    """Raise ValueError naming the field that breaks the contract."""
    if not np.isfinite(x.value).all() or (x.value < 0).any():
        raise ValueError("samples: value: NaN, Inf or negative irradiance")
    if len(x.first) != len(x.surface) + 1 or x.first[-1] != len(x.value):
        raise ValueError("samples: first: offsets do not fit the values")
    if not (len(x.element) == len(x.entries) == len(x.area) == len(x.H_direct) == len(x.is_hidden)):
        raise ValueError("samples: element arrays of different length")
    if not np.isfinite(x.H_direct).all():
        raise ValueError("samples: H_direct: NaN or Inf")


def save(path, x):
    """Write a chunk."""
    check(x)
    artefact.write(path, KIND, VERSION, {}, {name: getattr(x, name) for name in ARRAYS})


def load(path):
    """Read a chunk; ArtefactError when it is damaged."""
    arrays = artefact.read(path, KIND, VERSION)[1]
    try:
        x = Samples(**arrays)
        check(x)
    except (TypeError, ValueError, IndexError) as error:
        raise artefact.ArtefactError(f"{path}: damaged ({error}); delete it to have it made again") from None
    return x
