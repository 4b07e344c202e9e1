"""Trimmed surfaces from loops of edges: closed in u, v, oriented, cropped to their box, every border point once."""

from dataclasses import dataclass

import numpy as np

from lib.nurbs.crop import cropped
from lib.nurbs.evaluate import point
from lib.nurbs.shape import collapsed_sides, is_closed, size
from lib.surfaces.loops import inside_loops, signed_area
from lib.surfaces.trimmed import TrimmedSurface

SNAP = 1e-6  # of the domain or box: a parameter so near a border is the border
SAME_UV = 1e-9  # of the domain: border points nearer than this are one
GAP = 1e-3  # of the surface's size: a wider gap between edges is not closed
LEAST_AREA = 1e-9  # of the box, of a loop that encloses something


@dataclass(frozen=True, eq=False)
class EdgeUse:
    """One edge as a face's border runs along it.

    uv : (k, 2) float64 in the surface's [0, 1] x [0, 1], k >= 2; along a closed direction it may go on over the seam
    S : (k, 3) float64 positions, those of the edge;  significance : (k,) float64 of the edge, see
        lib.surfaces.significance
    """

    uv: np.ndarray
    S: np.ndarray
    significance: np.ndarray

    def reversed(self):
        """The same edge in the other direction."""
        return EdgeUse(self.uv[::-1], self.S[::-1], self.significance[::-1])


def trimmed(surface, loops):
    """The TrimmedSurface of a NurbsSurface inside loops, each a list of EdgeUse that follow one another.

    The outer loop is the one with the largest area; loops may come in any order and run either way.

    Raises ValueError, `loop 2: does not close in u, v: ...`, loops counted from 1, if they bound no part of it.
    """
    about = _About(surface)
    chains = []
    for number, loop in enumerate(loops, 1):
        try:
            chains.append(about.chain(loop))
        except ValueError as error:
            raise ValueError(f"loop {number}: {error}") from None
    if not chains:
        raise ValueError("loops: there is none")
    # Turn the outer loop counterclockwise and the holes clockwise, and put the outer one first
    areas = [signed_area(uv) for uv, _, _ in chains]
    outer = int(np.argmax(np.abs(areas)))
    chains = [
        tuple(a[::-1] for a in chain) if (area > 0) != (i == outer) else chain
        for i, (chain, area) in enumerate(zip(chains, areas, strict=True))
    ]
    around, shape = chains[outer][0], surface.Pw.shape
    if not abs(areas[outer]) > LEAST_AREA * max(np.ptp(around, axis=0).prod(), 1e-12):
        raise ValueError(f"loop {outer + 1}: encloses no area in u, v ({shape[0]} x {shape[1]} control points)")
    for i, (uv, S, sharp) in enumerate(chains):
        if i != outer:
            chains[i] = (about.inside(uv, around, i + 1), S, sharp)
    chains.insert(0, chains.pop(outer))
    # Crop to the box of the outer loop, and count u, v from its corner
    box, start = about.box(around)
    base = surface if (box == [0, 1, 0, 1]).all() else cropped(surface, *box)
    extent = np.array([box[1] - box[0], box[3] - box[2]])
    uv = [_snapped((one[0] - start) / extent) for one in chains]
    count = [len(one) for one in uv]
    return TrimmedSurface(
        base,
        box,
        np.clip(np.concatenate(uv), 0.0, 1.0),
        np.concatenate([[0], np.cumsum(count)]).astype(np.int64),
        np.concatenate([S for _, S, _ in chains]),
        np.concatenate([sharp for _, _, sharp in chains]),
    )


class _About:
    """A surface with what its loops need to know of it."""

    def __init__(self, surface):
        self.surface, self.size = surface, size(surface)
        self.closed, self.collapsed = np.array(is_closed(surface)), collapsed_sides(surface)

    def chain(self, loop):
        """Points uv (k, 2), S (k, 3), significance (k,) of a closed round trip; ValueError if it is not closed."""
        if not loop:
            raise ValueError("has no edge")
        # Put every edge into the period of the one before
        places, end = [], None
        for use in loop:
            uv = self._snapped(np.array(use.uv, dtype=np.float64))
            if end is not None and not self._same_pole(end, uv[0]):
                uv = uv + self._turns(end - uv[0])
            places.append(uv)
            end = uv[-1]
        turns = self._turns(places[0][0] - end)
        if turns.any() and not self._same_pole(end, places[0][0]):
            what = f"it winds around in {'u' if turns[0] else 'v'}, and the file gives no seam"
            raise ValueError(f"does not close in u, v: {what}")
        # Let neighbours share their corner; at a pole both ends stay
        parts = []
        for i, use in enumerate(loop):
            a, b = places[i], places[(i + 1) % len(loop)]
            stays = self._same_pole(a[-1], b[0]) and np.abs(a[-1] - b[0]).max() > SAME_UV
            if not stays:
                self._check_gap(a[-1], b[0], i + 1, (i + 1) % len(loop) + 1)
                b[0] = np.where(_on_line(a[-1]), a[-1], np.where(_on_line(b[0]), b[0], (a[-1] + b[0]) / 2))
            count = len(a) if stays else len(a) - 1
            parts.append((a[:count], use.S[:count], use.significance[:count]))
        uv, S, sharp = (np.concatenate(items) for items in zip(*parts, strict=True))
        # Drop doubled points: the same place in u, v, keeping corners
        same = np.abs(uv - np.roll(uv, 1, axis=0)).max(axis=1) <= SAME_UV
        drop = same & ~np.isinf(sharp)
        drop |= np.roll(same, -1) & np.isinf(np.roll(sharp, -1)) & ~np.isinf(sharp)
        drop |= same & np.isinf(sharp) & np.isinf(np.roll(sharp, 1))
        uv, S, sharp = uv[~drop], S[~drop], sharp[~drop]
        if len(uv) < 3:
            raise ValueError(f"has {len(uv)} different points in u, v; at least 3 enclose something")
        return uv, S, sharp

    def _snapped(self, uv):
        """Parameters at a border or seam to within rounding are put there; those beyond an open border too."""
        near = np.round(uv)
        uv = np.where(np.abs(uv - near) <= SNAP, near, uv)
        return np.where(self.closed, uv, np.clip(uv, 0.0, 1.0))

    def _turns(self, step):
        """Whole periods in a step, along closed directions."""
        return np.where(self.closed, np.round(step), 0.0)

    def _same_pole(self, a, b):
        """True if both places (2,) lie on one collapsed side."""
        return any(a[side // 2] == side % 2 == b[side // 2] for side in np.flatnonzero(self.collapsed))

    def _check_gap(self, a, b, i, j):
        way = a + (b - a) * np.linspace(0.0, 1.0, 5)[:, None]
        S = point(self.surface, *np.where(self.closed, way - np.floor(way), way).T)
        gap = float(np.linalg.norm(S - S[0], axis=1).max())
        if gap > GAP * self.size or np.abs(b - a).max() > 0.1:
            where = f"({a[0]:.6g}, {a[1]:.6g}) to ({b[0]:.6g}, {b[1]:.6g})"
            raise ValueError(f"does not close in u, v: edge {i} to edge {j} leaves a gap of {gap:.3g}, {where}")

    def inside(self, uv, around, number):
        """A hole's uv moved by whole periods into the outer loop; ValueError if it does not lie there."""
        after = np.roll(around, -1, axis=0)
        for turns in np.stack(np.meshgrid(*[[0, 1, -1] if c else [0] for c in self.closed]), axis=2).reshape(-1, 2):
            if inside_loops(around, after, uv + turns).mean() > 0.5:  # points on both loops may fall outside
                return uv + turns
        raise ValueError(f"loop {number}: lies outside the loop that encloses most")

    def box(self, around):
        """Box (4,) in the whole surface, and the corner (2,) of the loop that is its first."""
        low, high = around.min(axis=0), around.max(axis=0)
        for axis in (0, 1):
            if high[axis] - low[axis] > 1.0 + SNAP:
                raise ValueError(f"loops: run over {high[axis] - low[axis]:.3g} periods in {'uv'[axis]}")
        turns = np.where(self.closed, np.floor(low), 0.0)
        return np.array([low[0], high[0], low[1], high[1]]) - turns.repeat(2), low


def _on_line(x):
    return x == np.round(x)


def _snapped(uv):
    """Parameters at the border of the box to within rounding are put there."""
    near = np.clip(np.round(uv), 0.0, 1.0)
    return np.where(np.abs(uv - near) <= SNAP, near, uv)
