"""The part of a map's [0, 1] x [0, 1] that belongs to a surface: triangles in (u, v), in charts.

A sample of the lattice may lie outside the part, or so near its border that half of what it sees is the wall that
stands there.  It is then taken at the nearest place a little inside, so that the bilinear lookup finds values on both
sides of the border and no texel stays empty there.  Samples of different charts have nothing to do with each other:
`straddles` tells which cells hold parts of two, or have a corner that belongs to another.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lib.surfaces.nearest import Nearest
from lib.surfaces.point_location import PointLocation, move_in
from lib.surfaces.rows import numbered

INSIDE = 1e-3  # in (u, v): samples keep this distance from the border, as far as the triangles are wide enough
SPACING = 0.5  # of a finest cell, between the places along the border that samples are moved to
PARTS, LEAST_SHARE = 4, 1 / 64  # of a cell along the border, each way, and of its area where none of them is inside
MOST_PLACES = 64  # along one edge of a triangle


@dataclass(frozen=True)
class Places:
    """Where samples of a domain are taken: uv (n, 2), face (n,) triangle of the domain, chart (n,) its chart,
    is_inside (n,) bool: not moved from outside."""

    uv: np.ndarray
    face: np.ndarray
    chart: np.ndarray
    is_inside: np.ndarray


class Domain:
    """The triangles uv (m, 3, 2) of a surface, chart (m,) int, border (m, 3) bool as `borders` has it; cells : of its
    finest lattice along (u, v)."""

    def __init__(self, uv, chart, cells, border=None):
        self.uv = np.ascontiguousarray(uv, dtype=np.float64)
        self.chart = np.ascontiguousarray(chart, dtype=np.int64)
        self.cells = cells
        self.is_border = np.ascontiguousarray(borders(self.uv, self.chart) if border is None else border)
        self._location = PointLocation(self.uv)

    @cached_property
    def is_single(self):
        """True if all triangles are of one chart: nothing can straddle."""
        return not len(self.chart) or bool((self.chart == self.chart[0]).all())

    @cached_property
    def _border(self):
        """Places along the border: uv (k, 2) on it, inner (k, 2) a little inside, face (k,)."""
        face, opposite = np.nonzero(self.is_border)
        a, b = self.uv[face, (opposite + 1) % 3], self.uv[face, (opposite + 2) % 3]
        length = np.abs(b - a) * self.cells
        count = np.clip(np.ceil(length.max(axis=1, initial=0.0) / SPACING), 1, MOST_PLACES).astype(np.int64)
        count = np.maximum(count, 2)
        row = np.repeat(np.arange(len(face)), count)
        t = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[row]
        on = a[row] + t[:, None] * (b - a)[row]
        inner = self._moved_in(on, face[row])
        return on, inner, face[row]

    def _moved_in(self, uv, face):
        """Places uv (n, 2) of triangles `face`, moved towards the middle where they lie within INSIDE of the border."""
        moved = np.empty_like(uv)
        move_in(self.uv, self.is_border, face, np.ascontiguousarray(uv), INSIDE, moved)
        return moved

    def locate(self, uv):
        """The Places of samples uv (n, 2)."""
        uv = np.asarray(uv, dtype=np.float64)
        face = self.face_at(uv)
        is_inside = face >= 0
        place = np.empty_like(uv)
        out = np.flatnonzero(~is_inside)
        if out.size:
            nearest = self._nearest(uv[out])
            _, inner, owner = self._border
            place[out], face[out] = inner[nearest], owner[nearest]
        inside = np.flatnonzero(is_inside)
        place[inside] = self._moved_in(uv[inside], face[inside])
        return Places(place, face, self.chart[face], is_inside)

    @cached_property
    def _nearest(self):
        return Nearest(self._border[0])

    def face_at(self, uv):
        """(n,) triangle at each of uv (n, 2), -1 outside."""
        return self._location.at(uv)

    def chart_at(self, uv):
        """(n,) chart at, or nearest to, each of uv (n, 2)."""
        face = self.face_at(uv)
        out = np.flatnonzero(face < 0)
        if out.size:
            face[out] = self._border[2][self._nearest(uv[out])]
        return self.chart[face]

    def coverage(self, rows, columns):
        """What the cells of a uniform grid hold: (chart of the first (rows, columns) int64, -1 where nothing; bool,
        more than one)."""
        on, _, owner = self._border
        return self._location.labels(self.chart, rows, columns, on, owner)

    def shares(self, rows, columns):
        """(chart (rows, columns) as in `coverage`, share (rows, columns) of each cell that is part of the surface)."""
        chart, _ = self.coverage(rows, columns)
        share = (chart >= 0).astype(np.float64)
        on = self._border[0]
        i = np.clip((on[:, 0] * columns).astype(np.int64), 0, columns - 1)
        j = np.clip((on[:, 1] * rows).astype(np.int64), 0, rows - 1)
        j, i = np.divmod(np.unique(j * columns + i), columns)
        if len(j):
            step = (np.arange(PARTS) + 0.5) / PARTS
            u = ((i[:, None, None] + step[None, None]) / columns).repeat(PARTS, axis=1)
            v = ((j[:, None, None] + step[None, :, None]) / rows).repeat(PARTS, axis=2)
            inside = self.face_at(np.stack([u.ravel(), v.ravel()], axis=1)).reshape(len(j), -1) >= 0
            share[j, i] = np.maximum(inside.mean(axis=1), LEAST_SHARE)
        return chart, share

    def cover(self, rows, columns):
        """(needed (rows, columns) bool: cells with a part of the surface; straddling (rows, columns) bool: needed ones
        with parts of two charts, or a corner that is taken from another)."""
        chart, is_mixed = self.coverage(rows, columns)
        needed = chart >= 0
        if self.is_single or not needed.any():
            return needed, np.zeros_like(needed)
        corner = corners_of(needed)
        j, i = np.nonzero(corner)
        owner = np.full(corner.shape, -1, dtype=np.int64)
        owner[j, i] = self.chart_at(np.stack([i / columns, j / rows], axis=1))
        straddling = is_mixed.copy()
        for dj in (0, 1):
            for di in (0, 1):
                straddling |= owner[dj : dj + rows, di : di + columns] != chart
        return needed, straddling & needed


def borders(uv, chart, corner=None):
    """(m, 3) bool: the edge opposite to corner k of the triangles uv (m, 3, 2) belongs to no other of its chart (m,).

    corner (m, 3) int : numbers of their corners, the same where place and chart are, if known
    """
    if corner is None:
        points = np.concatenate([uv.reshape(-1, 2), np.repeat(chart, 3)[:, None]], axis=1)
        corner = numbered(points)[0].reshape(-1, 3)
    corner = np.asarray(corner, dtype=np.int64)
    a, b = corner[:, [1, 2, 0]].ravel(), corner[:, [2, 0, 1]].ravel()
    edge = np.minimum(a, b) * (corner.max(initial=0) + 1) + np.maximum(a, b)
    number, first = numbered(edge[:, None])
    return (np.bincount(number, minlength=len(first)) == 1)[number].reshape(-1, 3)


def corners_of(cells):
    """(rows + 1, columns + 1) bool: corners of cells (rows, columns) that are True."""
    rows, columns = cells.shape
    corner = np.zeros((rows + 1, columns + 1), dtype=bool)
    for dj in (0, 1):
        for di in (0, 1):
            corner[dj : dj + rows, di : di + columns] |= cells
    return corner


def barycentric(corner, uv):
    """Weights (n, 3) of the corners (n, 3, 2) of triangles at uv (n, 2), at least 0, their sum 1."""
    e, f, p = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0], uv - corner[:, 0]
    double = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    double = np.where(np.abs(double) > 1e-300, double, 1e-300)
    second = (p[:, 0] * f[:, 1] - p[:, 1] * f[:, 0]) / double
    third = (e[:, 0] * p[:, 1] - e[:, 1] * p[:, 0]) / double
    weight = np.maximum(np.stack([1 - second - third, second, third], axis=1), 0.0)
    return weight / np.maximum(weight.sum(axis=1, keepdims=True), 1e-300)
