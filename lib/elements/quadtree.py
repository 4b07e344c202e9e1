"""An adaptive quadtree of samples over one surface's lattice: where to sample next, and when to stop.

Predicate (midpoint rule): a leaf is divided if one of the five midpoints measured in its PARENT departs from the
parent's bilinear prediction by more than tau.  At the base level, where no parent was measured, it is the contrast of
the four corners. Hidden samples take no part in it; a leaf with hidden and visible corners lies along a contact,
where light changes fast, and is divided for that.  A leaf that is wide beside the free space above one of its corners
is divided as well, for a few levels: light that bounces changes within such distances (Ward et al. 1988), and a
contact can lie between samples that agree.  The tree is kept balanced, and corners that balancing adds are measured
like any other.
"""

import numpy as np

from lib.elements.balance import balance, children, grow
from lib.elements.tree_kernels import contrasts, mark_crossings, residuals

CONTACT_CELL = 1 / 1000  # of the scene's largest side: cells along a contact are divided down to this
WIDE, WIDE_LEVELS = 1.0, 2  # root-cell widths; levels below the base

SMALLEST_CELL = 1e-3  # of the scene's largest side: no finer but where asked
NOISE = 1.0  # standard errors taken off a departure before it counts
FULL_CELL, SLACK = 1 / 16, 0.5


class Quadtree:
    """State of one tree.

    lattice : Lattice; side : length of a root cell in the scene's frame; smallest : cells this large are not divided
    level : of the arrays below, which hold the whole lattice of that level
    value (h, w, C) float32, known, hidden (h, w) bool, noise (h, w) float32 standard error of the sample, 0 if it has
    none,
        reach (h, w) float32 free space above it in the scene's frame, inf where nobody asked
    divided : list of (n_v 2^l, n_u 2^l) bool for l < level

    cover(level) -> (needed, straddling) cells of a level (n_v 2^l, n_u 2^l) bool, where the surface does not fill its
    map: only needed cells are divided; those that straddle two charts always, down to `finest`, the tree's own top.
    """

    def __init__(self, lattice, base, channels, side=1.0, cover=None, finest=None, smallest=SMALLEST_CELL):
        self.lattice, self.base, self.level, self.side, self.smallest = lattice, base, base, side, smallest
        self._cover, self._finest = cover, finest
        shape = lattice.shape(base)
        self.value = np.zeros((*shape, channels), dtype=np.float32)
        self.noise = np.zeros(shape, dtype=np.float32)
        self.reach = np.full(shape, np.inf, dtype=np.float32)
        self.known = np.zeros(shape, dtype=bool)
        self.hidden = np.zeros(shape, dtype=bool)
        self._sure = np.zeros(shape, dtype=bool)
        self.divided = [np.ones(lattice.cells(level), dtype=bool) for level in range(base)]
        self._wanted = lattice.is_own(base)

    def wanted(self):
        """Crossings j, i (m,) of the current level that must be measured next."""
        return np.nonzero(self._wanted)

    def put(self, at, value, hidden, noise, reach):
        """Store samples at crossings `at` (j, i): value (m, C); hidden, noise, reach (m,) or numbers."""
        self.value[at], self.hidden[at], self.noise[at], self.reach[at], self.known[at] = (
            value,
            hidden,
            noise,
            reach,
            True,
        )
        self._wanted[at] = False
        for array in (self.value, self.hidden, self.noise, self.reach, self.known):
            self.lattice.copy_own(array)

    def doubtful(self):
        """Crossings j, i (m,) measured without noise beside one with noise, each named once.

        A few shadow rays agree by chance at the rim of a penumbra; more of them draw the rim smoothly.
        """
        noisy = self.noise > 0
        if not noisy.any():
            return np.nonzero(np.zeros_like(noisy))
        beside = self._beside(noisy)
        if min(noisy.shape) > 4:
            beside[::2, ::2] |= self._beside(noisy[::2, ::2])
        doubt = beside & ~noisy & self.known & ~self.hidden & ~self._sure & self.lattice.is_own(self.level)
        self._sure |= doubt
        return np.nonzero(doubt)

    def _beside(self, crossings):
        """Crossings (h, w) bool and their eight neighbours; a seam's last line, a copy of the first, is left out."""
        u, v = (int(c) for c in self.lattice.closed)
        own = crossings[: len(crossings) - v, : crossings.shape[1] - u]
        return np.pad(grow(own, self.lattice.closed), ((0, v), (0, u)), mode="wrap")

    def split(self, tau, top):
        """Divide leaves above the threshold tau, up to level `top`; balance.  Returns True when new samples are
        wanted.
        """
        top = top if self._finest is None else self._finest
        divided = [
            *(level.copy() for level in self.divided),
            *(np.zeros(self.lattice.cells(self.level), dtype=bool) for _ in range(self.level < top)),
        ]
        for level in range(self.base, len(divided)):
            cell = self.side * 2.0**-level
            needed, straddling = self._cover(level) if self._cover else (True, False)
            if cell > self.smallest:
                slack = max(1.0, (FULL_CELL / cell) ** SLACK)
                divided[level] |= self._exceeds(level, tau * slack) & self._exists(level) & needed
            divided[level] |= straddling & self._exists(level)
        divided = balance(divided, self.lattice.closed)
        if not any((new & ~old).any() for new, old in zip(divided, self._padded(divided), strict=True)):
            return False
        fresh = [new & ~old for new, old in zip(divided, self._padded(divided), strict=True)]
        if len(divided) > len(self.divided):
            if divided[-1].any():
                self._deepen()
            else:
                divided, fresh = divided[:-1], fresh[:-1]
        self.divided = divided
        self._want(fresh)
        return bool(self._wanted.any())

    def _padded(self, divided):
        return [*self.divided, *(np.zeros_like(d) for d in divided[len(self.divided) :])]

    def _exists(self, level):
        return children(self.divided[level - 1]) if level else np.ones(self.lattice.cells(0), dtype=bool)

    def _exceeds(self, level, tau):
        exceeds = self.contrast(level) > tau if level == self.base else self._departs(level - 1, tau)
        if level < self.base + WIDE_LEVELS:
            exceeds |= self._is_wide(level)
        if self.side * 2.0**-level > CONTACT_CELL:
            exceeds |= self._is_contact(level)
        return exceeds

    def _departs(self, level, tau):
        """Children of cells of a level whose midpoints depart from prediction; of a cell that held two charts, those
        with contrast of their own."""
        departs = self.residual(level) > tau
        if not self._cover or not self._cover(level)[1].any():
            return children(departs)
        straddles = self._cover(level)[1]
        return children(departs & ~straddles) | (children(straddles) & (self.contrast(level + 1) > tau))

    def _is_contact(self, level):
        """Cells with hidden and visible corners: along the line where another object touches, (rows, columns)."""
        hidden = self.hidden[:: 2 ** (self.level - level), :: 2 ** (self.level - level)]
        corners = np.stack([hidden[:-1, :-1], hidden[:-1, 1:], hidden[1:, :-1], hidden[1:, 1:]])
        return corners.any(axis=0) & ~corners.all(axis=0)

    def _is_wide(self, level):
        """Cells wider than WIDE times the free space above one of their corners: (rows, columns)."""
        step = 2 ** (self.level - level)
        reach = self.reach[::step, ::step]
        least = np.minimum.reduce([reach[:-1, :-1], reach[:-1, 1:], reach[1:, :-1], reach[1:, 1:]])
        return self.side * 2.0**-level > WIDE * least

    def contrast(self, level):
        """Largest difference between visible corners of each cell of a level, over channels: (rows, columns)."""
        out = np.empty(self.lattice.cells(level), dtype=np.float32)
        contrasts(self.value, self.hidden, 2 ** (self.level - level), out)
        return out

    def residual(self, level):
        """Largest departure of the five midpoints from bilinear prediction, for each divided cell of a level: (rows,
        columns).
        """
        out = np.empty(self.lattice.cells(level), dtype=np.float32)
        residuals(self.value, self.hidden, self.noise, self.divided[level], 2 ** (self.level - level), NOISE, out)
        return out

    def _deepen(self):
        self.level += 1
        shape = self.lattice.shape(self.level)
        for name in ("value", "noise", "reach", "known", "hidden", "_sure"):
            old = getattr(self, name)
            new = np.zeros((*shape, *old.shape[2:]), dtype=old.dtype)
            new[::2, ::2] = old
            setattr(self, name, new)

    def _want(self, fresh):
        required = np.zeros_like(self.known)
        for level, cells in enumerate(fresh):
            mark_crossings(np.ascontiguousarray(cells), 2 ** (self.level - level - 1), required)
        self._wanted = required & ~self.known
        # A copy across the seam asks for the sample it repeats.
        if self.lattice.closed[0]:
            self._wanted[:, 0] |= self._wanted[:, -1]
        if self.lattice.closed[1]:
            self._wanted[0] |= self._wanted[-1]
        self._wanted &= self.lattice.is_own(self.level) & ~self.known

    def is_leaf(self, level):
        """Cells of a level that are leaves: (rows, columns) bool."""
        own = self._exists(level)
        return own & ~self.divided[level] if level < len(self.divided) else own

    def shares(self):
        """Area of the map each sample answers for, a quarter of every leaf it is a corner of: (h, w), sum 1 a root
        cell.
        """
        out = np.zeros(self.known.shape)
        for level in range(self.level + 1):
            own = self.is_leaf(level)
            corners = out[:: 2 ** (self.level - level), :: 2 ** (self.level - level)]
            for part in (np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, :-1], np.s_[1:, 1:]):
                corners[part] += own * 4.0 ** -(level + 1)
        return out

    def leaves(self):
        """Leaves as rows (level, j, i), coarse to fine: (m, 3) int32."""
        rows = []
        for level in range(self.level + 1):
            j, i = np.nonzero(self.is_leaf(level))
            rows.append(np.stack([np.full(j.size, level), j, i], axis=1))
        return np.concatenate(rows).astype(np.int32)
