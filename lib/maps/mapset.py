"""The maps of many surfaces in one packed array.

Conventions: a map is indexed [j, i] = [v row, u column], row 0 is v = 0; sample i lies on the grid crossing
u = i/(w - 1). Side lengths are w = roots_u 2^level + 1 and h = roots_v 2^level + 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class MapSet:
    """Maps of m surfaces, N samples in all.

    surface : (m,) int32    global surface indices, strictly ascending
    roots   : (m, 2) int32  root cells [along u, along v], >= 1
    level   : (m,) int32    depth below the roots, >= 0
    value   : (N, ..., 3) float32  packed row-major, map after map; linear RGB, unit as its owner states
    hidden  : (N,) bool     samples buried in solids; their values mean nothing until filled (lib.maps.fill)
    """

    surface: np.ndarray
    roots: np.ndarray
    level: np.ndarray
    value: np.ndarray
    hidden: np.ndarray

    def __len__(self):
        return len(self.surface)

    def sizes(self):
        """Return (w, h), two (m,) int64 arrays of map sides in samples."""
        scale = np.int64(1) << self.level.astype(np.int64)
        return self.roots[:, 0] * scale + 1, self.roots[:, 1] * scale + 1

    def offsets(self):
        """Return (m + 1,) int64: map k is value[offsets[k]:offsets[k + 1]]."""
        w, h = self.sizes()
        return np.concatenate([[0], np.cumsum(w * h)]).astype(np.int64)

    def map(self, k):
        """Return map k as a view (h, w, ..., 3)."""
        return self._view(self.value, k)

    def hidden_map(self, k):
        """Return the hidden mask of map k as a view (h, w)."""
        return self._view(self.hidden, k)

    def _view(self, packed, k):
        w, h = side_lengths(self.roots[k], self.level[k])
        start = int(self.offsets()[k])
        return packed[start : start + w * h].reshape(h, w, *packed.shape[1:])

    def position(self, surface):
        """Return the k whose map belongs to global surface index `surface`, or -1."""
        k = int(np.searchsorted(self.surface, surface))
        return k if k < len(self.surface) and self.surface[k] == surface else -1

    def check(self, channels=None):
        """Raise ValueError naming the field that breaks the class's promises.

        `channels` is the expected trailing shape of value, such as (3,); None takes any that ends in 3.
        """
        m = len(self.surface)
        for name, shape, kind in (("surface", (m,), np.int32), ("roots", (m, 2), np.int32), ("level", (m,), np.int32)):
            array = getattr(self, name)
            if array.shape != shape or array.dtype != kind:
                raise ValueError(f"{name}: expected {shape} {np.dtype(kind)}, found {array.shape} {array.dtype}")
        if m and (self.surface[0] < 0 or np.any(np.diff(self.surface) <= 0)):
            raise ValueError("surface: indices must be >= 0 and strictly ascending")
        if np.any(self.roots < 1) or np.any(self.level < 0) or np.any(self.level > 24):
            raise ValueError("roots, level: expected roots >= 1 and 0 <= level <= 24")
        n = int(self.offsets()[-1])
        if self.value.dtype != np.float32 or self.value.ndim < 2 or self.value.shape[-1] != 3 or len(self.value) != n:
            raise ValueError(f"value: expected ({n}, ..., 3) float32, found {self.value.shape} {self.value.dtype}")
        if channels is not None and self.value.shape[1:] != tuple(channels):
            raise ValueError(f"value: expected trailing shape {tuple(channels)}, found {self.value.shape[1:]}")
        if self.hidden.dtype != bool or self.hidden.shape != (n,):
            raise ValueError(f"hidden: expected ({n},) bool, found {self.hidden.shape} {self.hidden.dtype}")
        self._check_finite()

    def _check_finite(self):
        if np.isfinite(self.value.min(initial=0.0)) and np.isfinite(self.value.max(initial=0.0)):
            return  # both are NaN where one is
        bad = ~np.isfinite(self.value)
        if bad.any():
            sample = int(np.nonzero(bad.reshape(len(bad), -1).any(axis=1))[0][0])
            k = int(np.searchsorted(self.offsets(), sample, side="right")) - 1
            raise ValueError(f"value[{sample}] is not finite (surface {int(self.surface[k])})")


def side_lengths(roots, level):
    """Return (w, h), ints: samples along u and v of one map with `roots` = [n_u, n_v] at `level`."""
    return (int(roots[0]) << int(level)) + 1, (int(roots[1]) << int(level)) + 1


def pack(surface, roots, level, maps, hidden=None, channels=(3,)):
    """Pack single maps into a MapSet.

    surface (m,), roots (m, 2), level (m,) as in MapSet; maps: m arrays (h, w, ..., 3); hidden: m arrays (h, w) bool or
    None for all visible. `channels` is the trailing shape where there is no map at all. Raises ValueError by check().
    """
    maps = [np.asarray(a, np.float32) for a in maps]
    roots = np.asarray(roots, np.int32).reshape(-1, 2)
    level = np.asarray(level, np.int32).reshape(-1)
    for k, a in enumerate(maps):
        w, h = side_lengths(roots[k], level[k])
        if a.shape[:2] != (h, w):
            raise ValueError(f"map {k}: expected {h} x {w} samples by its roots and level, found {a.shape[:2]}")
        if hidden is not None and np.shape(hidden[k]) != (h, w):
            raise ValueError(f"hidden {k}: expected {h} x {w} samples, found {np.shape(hidden[k])}")
    if maps:
        value = np.concatenate([a.reshape(-1, *a.shape[2:]) for a in maps])
    else:
        value = np.zeros((0, *channels), np.float32)
    if hidden is None:
        packed_hidden = np.zeros(len(value), bool)
    else:
        packed_hidden = np.concatenate([np.asarray(a, bool).ravel() for a in hidden] or [np.zeros(0, bool)])
    packed = MapSet(np.asarray(surface, np.int32).reshape(-1), roots, level, value, packed_hidden)
    packed.check()
    return packed


def merge(sets):
    """Return one MapSet of the maps of all `sets`, ascending by surface. Raises ValueError if a surface is in two."""
    sets = list(sets)
    if len(sets) == 1:
        return sets[0]
    owners = sorted((int(s), n, k) for n, one in enumerate(sets) for k, s in enumerate(one.surface))
    return pack(
        [s for s, _, _ in owners],
        [sets[n].roots[k] for _, n, k in owners],
        [sets[n].level[k] for _, n, k in owners],
        [sets[n].map(k) for _, n, k in owners],
        [sets[n].hidden_map(k) for _, n, k in owners],
        channels=sets[0].value.shape[1:] if sets else (3,),
    )
