"""Surfaces of every kind as flat arrays and back, for scene.npz."""

import numpy as np

from lib.nurbs.surface import NurbsSurface
from lib.surfaces.mesh import Mesh
from lib.surfaces.trimmed import TrimmedSurface

NURBS, TRIMMED, MESH, BACK = range(4)
NAMES = (
    "kind", "degree", "size", "knots", "Pw", "trim_size", "loop_size", "trim_box", "trim_uv", "trim_S",
    "trim_significance",
    "mesh_size", "mesh_V", "mesh_F", "mesh_N", "mesh_T", "mesh_uv", "mesh_chart",
)  # fmt: skip


def packed(surfaces, front):
    """Arrays of n surfaces; those with front[s] >= 0 share the geometry of that surface and are not stored again."""
    kind = [BACK if f >= 0 else _kind(s) for s, f in zip(surfaces, front, strict=True)]
    own = [s for s, k in zip(surfaces, kind, strict=True) if k != BACK]
    trims = [s for s in own if isinstance(s, TrimmedSurface)]
    meshes = [s for s in own if isinstance(s, Mesh)]
    S = [s.base if isinstance(s, TrimmedSurface) else s for s in own if not isinstance(s, Mesh)]
    return {
        "kind": np.array(kind, dtype=np.int8),
        "degree": np.array([(s.degree_u, s.degree_v) for s in S], dtype=np.int32).reshape(-1, 2),
        "size": np.array([s.Pw.shape[:2] for s in S], dtype=np.int32).reshape(-1, 2),
        "knots": _joined([knots for s in S for knots in (s.knots_u, s.knots_v)], (0,), np.float64),
        "Pw": _joined([s.Pw.reshape(-1, 4) for s in S], (0, 4), np.float64),
        "trim_size": np.array([len(t.loop_start) - 1 for t in trims], dtype=np.int64),
        "loop_size": _joined([np.diff(t.loop_start) for t in trims], (0,), np.int64),
        "trim_box": _joined([t.box[None] for t in trims], (0, 4), np.float64),
        "trim_uv": _joined([t.uv for t in trims], (0, 2), np.float64),
        "trim_S": _joined([t.S for t in trims], (0, 3), np.float64),
        "trim_significance": _joined([t.significance for t in trims], (0,), np.float64),
        "mesh_size": np.array(
            [(len(m.V), len(m.F), m.T is not None, -1 if m.level is None else m.level) for m in meshes], dtype=np.int64
        ).reshape(-1, 4),
        "mesh_V": _joined([m.V for m in meshes], (0, 3), np.float64),
        "mesh_F": _joined([m.F for m in meshes], (0, 3), np.int32),
        "mesh_N": _joined([m.N for m in meshes], (0, 3, 3), np.float64),
        "mesh_T": _joined([m.T for m in meshes if m.T is not None], (0, 3, 2), np.float64),
        "mesh_uv": _joined([m.uv for m in meshes if m.uv is not None], (0, 3, 2), np.float64),
        "mesh_chart": _joined([m.chart for m in meshes if m.chart is not None], (0,), np.int32),
    }


def unpacked(arrays, front):
    """The surfaces of `packed` arrays."""
    cut = {name: _Cut(arrays[name]) for name in NAMES}
    nets = zip(arrays["degree"].tolist(), arrays["size"].tolist(), strict=True)
    trim_size, mesh_size = iter(arrays["trim_size"].tolist()), iter(arrays["mesh_size"].tolist())

    def nurbs():
        (p, q), (n_u, n_v) = next(nets)
        knots_u, knots_v = cut["knots"].take(n_u + p + 1), cut["knots"].take(n_v + q + 1)
        return NurbsSurface(p, q, knots_u, knots_v, cut["Pw"].take(n_u * n_v).reshape(n_u, n_v, 4))

    def trimmed():
        loop_start = np.concatenate([[0], np.cumsum(cut["loop_size"].take(next(trim_size)))]).astype(np.int64)
        k = int(loop_start[-1])
        rest = (cut[f"trim_{name}"].take(k) for name in ("S", "significance"))
        return TrimmedSurface(nurbs(), cut["trim_box"].take(1)[0], cut["trim_uv"].take(k), loop_start, *rest)

    def mesh():
        n, m, has_T, level = next(mesh_size)
        V, F, N = cut["mesh_V"].take(n), cut["mesh_F"].take(m), cut["mesh_N"].take(m)
        T = cut["mesh_T"].take(m) if has_T else None
        if level < 0:
            return Mesh(V, F, N, T)
        return Mesh(V, F, N, T, cut["mesh_uv"].take(m), cut["mesh_chart"].take(m), int(level))

    make = {NURBS: nurbs, TRIMMED: trimmed, MESH: mesh, BACK: lambda: None}
    surfaces = [make[kind]() for kind in arrays["kind"].tolist()]
    return [surfaces[f] if f >= 0 else s for s, f in zip(surfaces, np.asarray(front).tolist(), strict=True)]


class _Cut:
    """Takes a packed array apart from the front."""

    def __init__(self, array):
        self.array, self.at = array, 0

    def take(self, n):
        self.at += n
        if self.at > len(self.array):
            raise ValueError("arrays are shorter than their sizes say")
        return self.array[self.at - n : self.at]


def _kind(surface):
    if isinstance(surface, Mesh):
        return MESH
    return TRIMMED if isinstance(surface, TrimmedSurface) else NURBS


def _joined(parts, shape, dtype):
    return np.concatenate([np.zeros(shape, dtype), *parts])
