"""Artefact of apply_base_texture and of budget_reduce: maps of B with and without their base texture."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lib.formats import artefact
from lib.maps import mapset
from lib.maps.mapset import MapSet

KIND, VERSION = "textured_maps", 2
FIELDS = ("surface", "roots", "level", "value", "hidden")


@dataclass(frozen=True)
class TexturedMaps:
    """Reflected radiosity of m surfaces; light groups are summed.

    names    : m surface names, in the order of the maps
    light    : MapSet, value (N, 3) B = rho_avg H [W/m^2], without base texture
    final    : MapSet, value (N', 3) B rho / rho_avg [W/m^2]; same surfaces; equals light where there is no texture
               and the surface does not shine by a picture
    E        : (m, 3) float64 exitance [W/m^2], in neither map
    rho_avg  : (m, 3) float64 in [0, 1], the reflectance the bake used
    textured : (m,) bool, the surface has a base texture or shines by a picture
    pictures : {sha256 of a base texture's file: [width, height]}, each file once
    stats    : {surface name: {figure: number or list}} for the report
    shining  : names of the surfaces that shine by a picture: it is added to their `final`, and their E is 0
    """

    names: list
    light: MapSet
    final: MapSet
    E: np.ndarray
    rho_avg: np.ndarray
    textured: np.ndarray
    pictures: dict = field(default_factory=dict)
    stats: dict = field(default_factory=dict)
    shining: list = field(default_factory=list)


def check(x, path="textured_maps"):
    """Raise ArtefactError naming path and field of what breaks the contract."""
    m = len(x.names)
    try:
        for name, one in (("light", x.light), ("final", x.final)):
            try:
                one.check(channels=(3,))
            except ValueError as error:
                raise ValueError(f"{name} {error}") from None
            if len(one) != m or not np.array_equal(one.surface, x.light.surface):
                raise ValueError(f"{name}: expected maps of the same {m} surfaces")
        if x.E.shape != (m, 3) or not (np.isfinite(x.E) & (x.E >= 0)).all():
            raise ValueError(f"E: expected ({m}, 3), finite and >= 0")
        if x.rho_avg.shape != (m, 3) or not ((x.rho_avg >= 0) & (x.rho_avg <= 1)).all():
            raise ValueError(f"rho_avg: expected ({m}, 3), 0 <= rho_avg <= 1")
        if not set(x.shining) <= set(x.names):
            raise ValueError("shining: expected names of surfaces with a map")
        if x.textured.shape != (m,) or x.textured.dtype != bool:
            raise ValueError(f"textured: expected ({m},) bool")
    except ValueError as error:
        raise artefact.ArtefactError(f"{path}: {error}") from None


def save(path, x):
    """Write a TexturedMaps; raises ArtefactError before anything is written if it is not sound."""
    check(x, path)
    arrays = {"E": x.E, "rho_avg": x.rho_avg, "textured": x.textured}
    for prefix, one in (("light", x.light), ("final", x.final)):
        arrays.update({f"{prefix}_{name}": getattr(one, name) for name in FIELDS})
    header = {"names": x.names, "pictures": x.pictures, "stats": x.stats, "shining": list(x.shining)}
    artefact.write(path, KIND, VERSION, header, arrays)


def load(path):
    """Read a TexturedMaps; raises ArtefactError."""
    header, arrays = artefact.read(path, KIND, VERSION)
    try:
        light = MapSet(**{name: arrays[f"light_{name}"] for name in FIELDS})
        final = MapSet(**{name: arrays[f"final_{name}"] for name in FIELDS})
        x = TexturedMaps(
            header["names"],
            light,
            final,
            arrays["E"],
            arrays["rho_avg"],
            arrays["textured"],
            header["pictures"],
            header["stats"],
            header["shining"],
        )
    except KeyError as error:
        raise artefact.ArtefactError(f"{path}: field {error} is missing") from None
    check(x, path)
    return x


def merge(chunks):
    """Return the TexturedMaps of all chunks together, ascending by surface. ValueError if a surface is in two."""
    chunks = list(chunks)
    order = np.argsort(np.concatenate([c.light.surface for c in chunks]), kind="stable")
    names = [name for c in chunks for name in c.names]
    return TexturedMaps(
        [names[k] for k in order],
        mapset.merge([c.light for c in chunks]),
        mapset.merge([c.final for c in chunks]),
        np.concatenate([c.E for c in chunks])[order],
        np.concatenate([c.rho_avg for c in chunks])[order],
        np.concatenate([c.textured for c in chunks])[order],
        {key: size for c in chunks for key, size in c.pictures.items()},
        {name: figures for c in chunks for name, figures in c.stats.items()},
        [name for c in chunks for name in c.shining],
    )


def reflected(x):
    """The MapSet of the light alone that a TexturedMaps shows: `final`, and `light` where that holds a picture that
    shines."""
    if not x.shining:
        return x.final
    shining, final = set(x.shining), x.final
    own = [x.light if name in shining else final for name in x.names]
    level = [one.level[k] for k, one in enumerate(own)]
    values, hidden = ([getattr(one, view)(k) for k, one in enumerate(own)] for view in ("map", "hidden_map"))
    return mapset.pack(final.surface, final.roots, level, values, hidden)
