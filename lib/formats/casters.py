"""Artefact of tessellate: the shadow casting mesh and the surfaces' shapes, all in the scene's frame."""

from dataclasses import dataclass

import numpy as np

from lib.formats import artefact

KIND, VERSION = "casters", 4


@dataclass(frozen=True)
class Casters:
    """Triangles and shapes of n surfaces in the frame x' = (x - centre) / scale: box centred, its largest side 1.

    centre (3,) float64 [m], scale float > 0 [m]
    V (n_v, 3) float64, UV (n_v, 2) float64 surface parameters in [0, 1]
    F (n_f, 3) int32    triangles with an area, wound so that their geometric normal is the surface's lit side
    face_surface (n_f,) int32 ascending; surfaces that do not block (receive_only) have no faces
    face_shell (n_f,) bool   faces of closed shells, of whatever kind
    area (n,), extent (n, 2) mean length along u, v; sag (n,) largest distance from the mesh, 0 on planar surfaces
    is_planar (n,), is_closed (n, 2) in u, v; is_collapsed (n, 4) sides u=0, u=1, v=0, v=1; all bool
    is_back_to_back (n,) bool : see lib.nurbs.coincident
    shell (n,) int32    closed shell of whole NURBS surfaces it belongs to, or -1
    borders (m, 5) int32 [surface a, side a, surface b, side b, reversed]: sides that are the same curve at the same
    speed
    part_start (n + 1, 2) int64 : surface s has the rows part_start[s, 0] to part_start[s + 1, 0] of part_uv, and of
    part_border by [:, 1];  part_uv (t, 3, 2) float64, part_border (b, 3) bool : see lib.surfaces.frames.part_of
    """

    centre: np.ndarray
    scale: float
    V: np.ndarray
    UV: np.ndarray
    F: np.ndarray
    face_surface: np.ndarray
    face_shell: np.ndarray
    area: np.ndarray
    extent: np.ndarray
    sag: np.ndarray
    is_planar: np.ndarray
    is_closed: np.ndarray
    is_collapsed: np.ndarray
    is_back_to_back: np.ndarray
    shell: np.ndarray
    borders: np.ndarray
    part_start: np.ndarray
    part_uv: np.ndarray
    part_border: np.ndarray

    def part(self, s):
        """What lib.surfaces.frames.part_of says of surface s."""
        (a, b), (c, d) = self.part_start[s : s + 2].T
        return self.part_uv[a:b], self.part_border[c:d]


def _expected(x):
    n, n_v, n_f = len(x.area), len(x.V), len(x.F)
    return {
        "centre": ((3,), np.float64),
        "V": ((n_v, 3), np.float64),
        "UV": ((n_v, 2), np.float64),
        "F": ((n_f, 3), np.int32),
        "face_surface": ((n_f,), np.int32),
        "face_shell": ((n_f,), np.bool_),
        "area": ((n,), np.float64),
        "extent": ((n, 2), np.float64),
        "sag": ((n,), np.float64),
        "is_planar": ((n,), np.bool_),
        "is_closed": ((n, 2), np.bool_),
        "is_collapsed": ((n, 4), np.bool_),
        "is_back_to_back": ((n,), np.bool_),
        "shell": ((n,), np.int32),
        "borders": ((len(x.borders), 5), np.int32),
        "part_start": ((n + 1, 2), np.int64),
        "part_uv": ((len(x.part_uv), 3, 2), np.float64),
        "part_border": ((len(x.part_border), 3), np.bool_),
    }


def check(x, path="casters"):
    """Raise ArtefactError naming path and field of what breaks the class's promises."""
    artefact.check_arrays(path, x, _expected(x))
    n = len(x.area)
    rules = {
        "scale": x.scale > 0,
        "UV": (x.UV >= 0).all() and (x.UV <= 1).all(),
        "F": not len(x.F) or (x.F.min() >= 0 and x.F.max() < len(x.V)),
        "face_surface": not len(x.F)
        or (x.face_surface.min() >= 0 and x.face_surface.max() < n and (np.diff(x.face_surface) >= 0).all()),
        "area": (x.area > 0).all(),
        "sag": (x.sag >= 0).all(),
        "borders": not len(x.borders)
        or (x.borders.min() >= 0 and x.borders[:, [0, 2]].max() < n and x.borders[:, [1, 3]].max() < 4),
    }
    ends = [len(x.part_uv), len(x.part_border)]
    rules["part_start"] = not x.part_start[0].any() and (np.diff(x.part_start, axis=0) >= 0).all()
    rules["part_start: its end"] = x.part_start[-1].tolist() == ends
    for name, holds in rules.items():
        if not holds:
            raise artefact.ArtefactError(f"{path}: {name}: out of range, see lib.formats.casters")


def save(path, x):
    """Write the casters; ArtefactError before anything is written if they are not sound."""
    check(x, path)
    artefact.write(path, KIND, VERSION, {"scale": float(x.scale)}, {name: getattr(x, name) for name in _expected(x)})


def load(path):
    """Read the casters; ArtefactError naming path and fault."""
    header, arrays = artefact.read(path, KIND, VERSION)
    try:
        x = Casters(scale=float(header["scale"]), **arrays)
    except (KeyError, TypeError) as error:
        raise artefact.ArtefactError(f"{path}: {error}") from None
    check(x, path)
    return x
