"""What the direct half of `refine` leaves for the rays of the indirect half: the radiosity maps of a chunk."""

import numpy as np

from lib.formats import artefact
from lib.radiosity.radiosity_maps import RadiosityMaps, offsets

KIND, VERSION = "radiosity_maps", 1


def check(x, path="radiosity_maps"):
    """Raise ArtefactError naming path and field of what breaks the contract."""
    k, n = len(x.surface), int(offsets(x.shape)[-1]) if x.shape.ndim == 2 else -1
    channels = x.value.shape[1:]
    expected = {
        "surface": ((k,), np.int32),
        "shape": ((k, 2), np.int32),
        "value": ((n, *channels), np.float32),
        "direct": ((n, *channels), np.float32),
    }
    artefact.check_arrays(path, x, expected)


def save(path, x):
    """Write RadiosityMaps; ArtefactError before anything is written if they are not sound."""
    check(x)
    artefact.write(path, KIND, VERSION, {}, {name: getattr(x, name) for name in x.__dataclass_fields__})


def load(path):
    """Read RadiosityMaps; ArtefactError when the file is damaged."""
    arrays = artefact.read(path, KIND, VERSION)[1]
    try:
        x = RadiosityMaps(**arrays)
    except TypeError as error:
        raise artefact.ArtefactError(f"{path}: damaged ({error}); delete it to have it made again") from None
    check(x, path)
    return x
