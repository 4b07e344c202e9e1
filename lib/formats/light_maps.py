"""Artefact of balance_resample: irradiance maps of a chunk of surfaces, per light group."""

from __future__ import annotations

from dataclasses import dataclass, field

from lib.formats import artefact
from lib.maps import mapset
from lib.maps.mapset import MapSet

KIND, VERSION = "light_maps", 1
FIELDS = ("surface", "roots", "level", "value", "hidden")


@dataclass(frozen=True)
class LightMaps:
    """maps  : MapSet, value (N, G, 3) irradiance H [W/m^2], one slice a light group
    stats : {surface name: {figure: number or list}}, whatever the stages before tell the report
    """

    maps: MapSet
    stats: dict = field(default_factory=dict)


def check(x, path="light_maps"):
    """Raise ArtefactError naming path and field of what breaks the contract."""
    try:
        x.maps.check()
        if x.maps.value.ndim != 3 or x.maps.value.shape[1] < 1:
            raise ValueError(f"value: expected (N, G, 3) with G >= 1, found {x.maps.value.shape}")
    except ValueError as error:
        raise artefact.ArtefactError(f"{path}: {error}") from None


def save(path, x):
    """Write a LightMaps; raises ArtefactError before anything is written if it is not sound."""
    check(x, path)
    artefact.write(path, KIND, VERSION, {"stats": x.stats}, {name: getattr(x.maps, name) for name in FIELDS})


def load(path):
    """Read a LightMaps; raises ArtefactError."""
    header, arrays = artefact.read(path, KIND, VERSION)
    try:
        x = LightMaps(MapSet(**{name: arrays[name] for name in FIELDS}), header["stats"])
    except KeyError as error:
        raise artefact.ArtefactError(f"{path}: field {error} is missing") from None
    check(x, path)
    return x


def merge(chunks):
    """Return the LightMaps of all chunks together, ascending by surface.  ValueError if a surface is in two."""
    chunks = list(chunks)
    stats = {name: figures for c in chunks for name, figures in c.stats.items()}
    return LightMaps(mapset.merge([c.maps for c in chunks]), stats)
