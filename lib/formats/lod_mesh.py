"""Artefact of lod_export: the triangles of one level of detail, in metres, with their measured distance."""

from dataclasses import dataclass

import numpy as np

from lib.formats import artefact

KIND, VERSION = "lod_mesh", 1


@dataclass(frozen=True)
class LodMesh:
    """One level of n surfaces, packed surface after surface in the scene's order.

    V (n_v, 3) float64 [m]; N (n_v, 3) float32 unit, the lit side; UV (n_v, 2) float64 surface parameters in [0, 1]
    F (n_f, 3) int32 vertices of the whole level, wound so that the geometric normal is the lit side
    vertex_start, face_start (n + 1,) int64: surface s owns vertices and faces start[s] to start[s + 1]
    distance, rms, slide (n,) float64 [m]: largest and root mean square distance to the exact surface, and how far a
        texture slides on it
    level int, asked dict as the user wrote it, tolerance float [m] chord tolerance it was cut for
    gap float [m]   largest distance between neighbours along a shared border
    note str        empty, or why the level is not what was asked for
    """

    V: np.ndarray
    N: np.ndarray
    UV: np.ndarray
    F: np.ndarray
    vertex_start: np.ndarray
    face_start: np.ndarray
    distance: np.ndarray
    rms: np.ndarray
    slide: np.ndarray
    level: int
    asked: dict
    tolerance: float
    gap: float
    note: str = ""


HEADER = ("level", "asked", "tolerance", "gap", "note")


def _expected(x):
    n, n_v, n_f = len(x.distance), len(x.V), len(x.F)
    return {
        "V": ((n_v, 3), np.float64),
        "N": ((n_v, 3), np.float32),
        "UV": ((n_v, 2), np.float64),
        "F": ((n_f, 3), np.int32),
        "vertex_start": ((n + 1,), np.int64),
        "face_start": ((n + 1,), np.int64),
        "distance": ((n,), np.float64),
        "rms": ((n,), np.float64),
        "slide": ((n,), np.float64),
    }


def check(x, path="lod_mesh"):
    """Raise ArtefactError naming path and field of what breaks the class's promises."""
    artefact.check_arrays(path, x, _expected(x))
    rules = {
        "UV": (x.UV >= 0).all() and (x.UV <= 1).all(),
        "N": np.allclose(np.linalg.norm(x.N, axis=1), 1, atol=1e-5),
        "F": not len(x.F) or (x.F.min() >= 0 and x.F.max() < len(x.V)),
        "vertex_start": x.vertex_start[0] == 0
        and x.vertex_start[-1] == len(x.V)
        and (np.diff(x.vertex_start) >= 0).all(),
        "face_start": x.face_start[0] == 0 and x.face_start[-1] == len(x.F) and (np.diff(x.face_start) >= 0).all(),
        "distance": (x.distance >= 0).all() and (x.rms >= 0).all() and (x.slide >= 0).all() and x.gap >= 0,
    }
    for name, holds in rules.items():
        if not holds:
            raise artefact.ArtefactError(f"{path}: {name}: out of range, see lib.formats.lod_mesh")


def save(path, x):
    """Write the level; ArtefactError before anything is written if it is not sound."""
    check(x, path)
    header = {name: getattr(x, name) for name in HEADER}
    artefact.write(path, KIND, VERSION, header, {name: getattr(x, name) for name in _expected(x)})


def load(path):
    """Read a level; ArtefactError naming path and fault."""
    header, arrays = artefact.read(path, KIND, VERSION)
    try:
        x = LodMesh(**{name: header[name] for name in HEADER}, **arrays)
    except (KeyError, TypeError) as error:
        raise artefact.ArtefactError(f"{path}: {error}") from None
    check(x, path)
    return x
