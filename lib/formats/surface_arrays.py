"""Surfaces of every kind as flat arrays and back, for scene.npz."""

from collections.abc import Sequence

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


class Surfaces(Sequence):
    """The surfaces of `packed` arrays, each made when it is first asked for: most jobs handle a chunk of the scene.

    Raises ValueError when the arrays do not fit the sizes they state.
    """

    def __init__(self, arrays, front):
        kind, self._arrays, self._front = arrays["kind"], arrays, np.asarray(front).tolist()
        if len(kind) != len(self._front) or ((kind < NURBS) | (kind > BACK)).any():
            raise ValueError("kind: not that of each surface")
        self._kind, self._made = kind.tolist(), {}
        is_of = {NURBS: kind <= TRIMMED, TRIMMED: kind == TRIMMED, MESH: kind == MESH}
        self._row = {which: np.cumsum(mask) - 1 for which, mask in is_of.items()}  # in the arrays of that kind
        n, m, has_T, level = arrays["mesh_size"].T
        loop = _starts(arrays["trim_size"])
        point = _starts(arrays["loop_size"])
        self._start = {
            "knots": _starts((arrays["size"] + arrays["degree"] + 1).ravel()),
            "Pw": _starts(arrays["size"].prod(axis=1)),
            "loop_size": loop,
            "trim_box": np.arange(len(loop)),
            **dict.fromkeys(("trim_uv", "trim_S", "trim_significance"), point[np.minimum(loop, len(point) - 1)]),
            "mesh_V": _starts(n),
            **dict.fromkeys(("mesh_F", "mesh_N"), _starts(m)),
            "mesh_T": _starts(m * has_T),
            **dict.fromkeys(("mesh_uv", "mesh_chart"), _starts(m * (level >= 0))),
        }
        rows = {NURBS: arrays["degree"], TRIMMED: arrays["trim_size"], MESH: arrays["mesh_size"]}
        if any(mask.sum() != len(rows[which]) for which, mask in is_of.items()):
            raise ValueError("kind: other numbers of surfaces than the arrays hold")
        if any(start[-1] != len(arrays[name]) for name, start in self._start.items()):
            raise ValueError("arrays of other lengths than their sizes say")

    def __len__(self):
        return len(self._kind)

    def __getitem__(self, s):
        s = range(len(self))[s]
        if self._kind[s] == BACK:
            return self[self._front[s]]
        if s not in self._made:
            make = {NURBS: self._nurbs, TRIMMED: self._trimmed, MESH: self._mesh}[self._kind[s]]
            self._made[s] = make(s)
        return self._made[s]

    def _part(self, name, k):
        """What belongs to row k of its kind in a packed array."""
        return self._arrays[name][self._start[name][k] : self._start[name][k + 1]]

    def _nurbs(self, s):
        k = int(self._row[NURBS][s])
        (p, q), (n_u, n_v) = self._arrays["degree"][k].tolist(), self._arrays["size"][k].tolist()
        knots_u, knots_v = self._part("knots", 2 * k), self._part("knots", 2 * k + 1)
        return NurbsSurface(p, q, knots_u, knots_v, self._part("Pw", k).reshape(n_u, n_v, 4))

    def _trimmed(self, s):
        k = int(self._row[TRIMMED][s])
        box, uv, *rest = (self._part(f"trim_{name}", k) for name in ("box", "uv", "S", "significance"))
        return TrimmedSurface(self._nurbs(s), box[0], uv, _starts(self._part("loop_size", k)), *rest)

    def _mesh(self, s):
        k = int(self._row[MESH][s])
        has_T, level = self._arrays["mesh_size"][k, 2:].tolist()
        V, F, N, T, uv, chart = (self._part(f"mesh_{name}", k) for name in ("V", "F", "N", "T", "uv", "chart"))
        packing = (uv, chart, int(level)) if level >= 0 else ()
        return Mesh(V, F, N, T if has_T else None, *packing)


def _starts(sizes):
    """Where parts of these sizes (n,) begin in their packed array, and its end: (n + 1,) int64."""
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def _kind(surface):
    if isinstance(surface, Mesh):
        return MESH
    return TRIMMED if isinstance(surface, TrimmedSurface) else NURBS


def _joined(parts, shape, dtype):
    return np.concatenate([np.zeros(shape, dtype), *parts])
