"""scene.npz: the surfaces of a scene in world metres, and what each of them is for.

Written by import_scene, read by all.  Reflectances are not in it: they reach the solver as parameters, so that a
repainted texture of equal average changes nothing here.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lib.formats import artefact, surface_arrays
from lib.formats.artefact import ArtefactError
from lib.maps.glow import Glow

KIND, VERSION = "scene", 4
ROLES = ("full", "cast_only", "receive_only")


@dataclass(frozen=True, eq=False)
class Scene:
    """n surfaces, ordered by name; the index counts from 0 and is the same in every later file.

    names : n different texts, ascending
    files : n file stems, safe in any file system, e.g. "003-teapot-12"
    surfaces : sequence of n NurbsSurface, TrimmedSurface or Mesh with charts, world metres
    front : (n,) int32, the surface whose back this is, with the same geometry and the other side lit; -1 otherwise
    flip : (n,) bool, the lit side is against S_u x S_v
    role : n of ROLES;  material : n texts
    E : (n, 3) float64 exitance, linear RGB [W/m^2], >= 0
    group : (n,) int32 index into groups, 0 for surfaces that emit nothing
    groups : names of the light groups, at least one
    is_black : (n,) bool, declared reflectance exactly 0 and no texture
    up : "y" or "z";  warnings : sentences for the user
    glow : {index: lib.maps.glow.Glow} of the surfaces that shine unevenly, E being their mean
    """

    names: list
    files: list
    surfaces: Sequence
    front: np.ndarray
    flip: np.ndarray
    role: list
    E: np.ndarray
    group: np.ndarray
    groups: list
    is_black: np.ndarray
    material: list
    up: str
    warnings: list
    glow: dict = dataclasses.field(default_factory=dict)


def check(scene, where="scene"):
    """Raise ArtefactError, naming the field, unless the scene is as Scene states."""
    n = len(scene.names)

    def demand(holds, field, expected):
        if not holds:
            raise ArtefactError(f"{where}: {field}: expected {expected}")

    demand(n > 0 and list(scene.names) == sorted(set(scene.names)), "names", "at least one, different, ascending")
    for field in ("files", "surfaces", "role", "material"):
        demand(len(getattr(scene, field)) == n, field, f"{n} entries")
    demand(len(set(scene.files)) == n, "files", "different file stems")
    demand(set(scene.role) <= set(ROLES), "role", " | ".join(ROLES))
    for field, shape, dtype in (
        ("front", (n,), np.int32),
        ("flip", (n,), bool),
        ("E", (n, 3), np.float64),
        ("group", (n,), np.int32),
        ("is_black", (n,), bool),
    ):
        array = getattr(scene, field)
        demand(array.shape == shape and array.dtype == dtype, field, f"{np.dtype(dtype).name} of shape {shape}")
    is_front = scene.front < 0
    demand(scene.front.max() < n and is_front[scene.front[~is_front]].all(), "front", "-1 or a surface that is no back")
    demand(np.isfinite(scene.E).all() and (scene.E >= 0).all(), "E", "finite values >= 0")
    n_groups = len(scene.groups)
    demand(n_groups > 0 and 0 <= scene.group.min() and scene.group.max() < n_groups, "group", f"0 to {n_groups - 1}")
    demand(scene.up in ("y", "z"), "up", "y or z")
    for s, glow in scene.glow.items():
        k = len(glow.box)
        holds = 0 <= s < n and k > 0 and glow.box.shape == (k, 4) and glow.colour.shape == (k, 3)
        demand(
            holds and np.isfinite(glow.colour).all() and (glow.colour >= 0).all(), "glow", "parts with a colour >= 0"
        )


def save(path, scene):
    """Write a Scene; the bytes depend on its content alone."""
    check(scene, path)
    header = {
        "names": list(scene.names),
        "files": list(scene.files),
        "role": list(scene.role),
        "groups": list(scene.groups),
        "material": list(scene.material),
        "up": scene.up,
        "warnings": list(scene.warnings),
    }
    arrays = surface_arrays.packed(scene.surfaces, scene.front)
    arrays |= {field: getattr(scene, field) for field in ("front", "flip", "E", "group", "is_black")}
    glow = [scene.glow[s] for s in sorted(scene.glow)]
    arrays["glow_surface"] = np.array(sorted(scene.glow), dtype=np.int32)
    arrays["glow_size"] = np.array([len(one.box) for one in glow], dtype=np.int32)
    arrays["glow_box"] = np.concatenate([np.zeros((0, 4)), *(one.box for one in glow)])
    arrays["glow_colour"] = np.concatenate([np.zeros((0, 3)), *(one.colour for one in glow)])
    artefact.write(path, KIND, VERSION, header, arrays)


def load(path):
    """Read a Scene; ArtefactError if the file is not one."""
    header, arrays = artefact.read(path, KIND, VERSION)
    try:
        surfaces = surface_arrays.Surfaces({k: arrays.pop(k) for k in surface_arrays.NAMES}, arrays["front"])
        fields = ("names", "files", "role", "groups", "material", "up", "warnings")
        glow = _glow(*(arrays.pop(f"glow_{name}") for name in ("surface", "size", "box", "colour")))
        scene = Scene(surfaces=surfaces, **{field: header[field] for field in fields}, **arrays, glow=glow)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise ArtefactError(f"{path}: damaged ({error}); delete it to have it made again") from error
    check(scene, path)
    return scene


def _glow(surface, size, box, colour):
    """{index: Glow} of the packed arrays."""
    ends = np.cumsum(size)[:-1]
    parts = zip(surface.tolist(), np.split(box, ends), np.split(colour, ends), strict=True) if len(surface) else ()
    return {s: Glow(own, its_colour) for s, own, its_colour in parts}
