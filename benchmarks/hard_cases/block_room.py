"""Path tracing of a room with a block and a lamp, all boxes along the axes: light that owes nothing to the baker.

The room is lit inside, the block outside, the lamp is a black rectangle that looks down; all else reflects rho.
"""

from dataclasses import dataclass

import numpy as np

LEAST = 1e-9  # ways shorter than this are a ray's own origin


@dataclass(frozen=True)
class BlockRoom:
    """size (3,) of the room, a corner in the origin; block (2, 3) low and high corner; lamp (2, 2) low and high x, y;
    height of the lamp; rho of walls and block; the lamp's E is 1."""

    size: np.ndarray
    block: np.ndarray
    lamp: np.ndarray
    height: float
    rho: float

    def direct(self, x, N, rng):
        """Irradiance (k,) at points x, N (k, 3) from one random point of the lamp each: right on average."""
        low, high = self.lamp
        y = np.empty_like(x)
        y[:, :2] = low + rng.random((len(x), 2)) * (high - low)
        y[:, 2] = self.height
        D = y - x
        r2 = (D**2).sum(axis=1)
        cosines = np.maximum((D * N).sum(axis=1), 0) * np.maximum(D[:, 2], 0) / r2
        entry, _, inside = self._block(x, D)
        blocked = inside & (entry > LEAST) & (entry < 1)
        return np.prod(high - low) * np.where(blocked, 0.0, cosines / (np.pi * r2))

    def bounced(self, x, N, rng, bounces=24):
        """Reflected irradiance (k,) at points x, N (k, 3) by one path each: right on average."""
        total, weight = np.zeros(len(x)), 1.0
        alive = np.arange(len(x))
        for _ in range(bounces):
            x, N, met = self._next(x, _cosine_directions(N, rng))
            x, N, alive = x[met], N[met], alive[met]
            weight *= self.rho
            total[alive] += weight * self.direct(x, N, rng)
        return total

    def _next(self, x, D):
        """What rays meet: places, normals, and which do not end on the lamp."""
        with np.errstate(divide="ignore"):
            t = np.where(D != 0, (np.where(D > 0, self.size, 0.0) - x) / D, np.inf)
        axis = t.argmin(axis=1)
        way = t[np.arange(len(x)), axis]
        N = -np.sign(D) * np.eye(3)[axis]
        entry, side, inside = self._block(x, D)
        nearer = inside & (entry > LEAST) & (entry < way)
        N = np.where(nearer[:, None], -np.sign(D) * np.eye(3)[side], N)
        way = np.where(nearer, entry, way)
        with np.errstate(divide="ignore", invalid="ignore"):
            up = (self.height - x[:, 2]) / D[:, 2]
            at = x[:, :2] + up[:, None] * D[:, :2]
        on_lamp = (up > LEAST) & (up < way) & ((at > self.lamp[0]) & (at < self.lamp[1])).all(axis=1)
        return x + way[:, None] * D, N, ~on_lamp

    def _block(self, x, D):
        """Where rays enter the block: way, axis of the side, and whether they meet it at all."""
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (self.block[:, None] - x) / D
        first, last = np.fmin(*t), np.fmax(*t)
        entry = first.max(axis=1)
        return entry, first.argmax(axis=1), entry < last.min(axis=1)


def _cosine_directions(N, rng):
    """Directions about normals along the axes, cosine distributed."""
    a, square = 2 * np.pi * rng.random(len(N)), rng.random(len(N))
    local = np.stack([np.sqrt(square) * np.cos(a), np.sqrt(square) * np.sin(a), np.sqrt(1 - square)], axis=1)
    axis = np.abs(N).argmax(axis=1)[:, None]
    turned = np.take_along_axis(local, (np.arange(3)[None] - axis - 1) % 3, axis=1)
    return np.where(np.arange(3)[None] == axis, turned * N.sum(axis=1, keepdims=True), turned)
