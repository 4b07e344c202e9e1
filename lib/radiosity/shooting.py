"""Bounced light over the elements: progressive refinement, then gathering over the same rows.

Cohen et al. 1988 in batches (Southwell's method, Gortler et al. 1994), overshooting by Feda, Purgathofer 1992.

    P_i = area_i sum |dB_i|                      unshot power
    shoot every i with P_i >= 0.1 max P:   x_i = dB_i + c rho_i A_amb
    H_j += x_i F_ij area_i / area_j,  dB_j += rho_j (the same),  dB_i -= x_i
    A_amb = k / (1 - k rho_avg) sum dB_j area_j / sum area,   k the share of rays that meet an element

k is ours (the source is for closed rooms, k = 1): in an open scene most light never comes back, and overshooting as
if it did makes the unshot light swing for ever.

then  H_i = H_direct,i + sum_j F_ij rho_j H_j  until the change, summed as a geometric series, is small.
Shooting deposits light through single rays, and small elements collect noise that feeds back; the sweeps take it out
again.
"""

from dataclasses import dataclass

import numpy as np

from lib.radiosity.sparse_kernels import add_products

BRIGHT = 0.1  # elements with this share of the largest unshot power shoot in the same round
OVERSHOOT = 0.5  # c: halves the shots against 0; 1 is worse
MOST_GAIN = 100.0  # bound of 1 / (1 - rho_avg)
MOST_ROUNDS, MOST_SWEEPS = 5000, 20000
LEAST_SWEEPS = 6  # before the ratio of two changes tells how light dies
MOST_GROWTH = 1e3  # of the changes, beside the least there was: light that grows
DARK = 1e-9  # of the brightest element: what shooting left in a dark room dies out, and need not be waited for
STAGNANT = 100  # rounds without a hundredth of progress: the light does not die out


class DoesNotConverge(ValueError):
    """The light does not die out: reflectances too near 1 in a closed scene."""


@dataclass(frozen=True)
class Solution:
    """H (n, G, 3) irradiance of each element, direct and bounced; ambient (G, 3) the preview's ambient term at the
    end of shooting; history (rounds, 2) shots so far and unshot share of the direct light's first reflection; ledger
    of powers [W in frame units], each (G, 3): received, absorbed, escaped, unshot, residue; shots, sweeps."""

    H: np.ndarray
    ambient: np.ndarray
    history: np.ndarray
    ledger: dict
    shots: int
    sweeps: int


class FormFactors:
    """The sparse matrix F of rows with entries (n, R); escaped, absorbed (n,) the shares that meet no element, met (n,)
    others.

    area : (n, p) that each of the points of an element stands for, which send R / p rays each: all means are by area.
        Default: all the same
    """

    def __init__(self, entries, area=None):
        n, R = entries.shape
        self.n = n
        weight = (entries != -3).astype(np.float64)
        if area is not None:
            weight *= np.repeat(area, R // area.shape[1], axis=1)
        weight /= np.where((total := weight.sum(axis=1)) > 0, total, 1.0)[:, None]
        self._row, self._ray = np.divmod(np.flatnonzero(entries >= 0), R)
        self._column = entries[self._row, self._ray].astype(np.int64)  # as often as rays meet it: sorting costs more
        self._F = weight[self._row, self._ray]
        self.escaped = np.where(entries == -1, weight, 0.0).sum(axis=1)
        self.absorbed = np.where(entries == -2, weight, 0.0).sum(axis=1)
        self.met = 1 - self.escaped - self.absorbed

    def gather(self, B):
        """sum_j F_ij B_j for B (n, C): (n, C)."""
        return self._sum(self._row, self._column, B)

    def gather_points(self, B, met):
        """What the rays bring of B (n, 16, C), which differs over the 16 points of an element, met (n, R) at which:
        (n, C).
        """
        found = B[self._column, met[self._row, self._ray]] * self._F[:, None]
        return np.stack([np.bincount(self._row, c, minlength=self.n) for c in found.T], axis=1)

    def scatter(self, power):
        """sum_i F_ij power_i for power (n, C): (n, C)."""
        return self._sum(self._column, self._row, power)

    def spread(self, B):
        """Standard deviation over each row's rays of the radiosity they meet, largest channel: B (n, C) -> (n,)."""
        mean, square = self.gather(B), self.gather(B * B)
        return np.sqrt(np.maximum(square - mean * mean, 0).max(axis=1, initial=0.0))

    def _sum(self, to, source, values):
        out = np.zeros(values.shape)
        add_products(self._F, to, source, np.ascontiguousarray(values, dtype=np.float64), out)
        return out


def solve(H_direct, rho, area, F, residual=1e-3, bounces=None, first=None):
    """Irradiance of all elements.

    Parameters
    ----------
    H_direct : (n, G, 3) float64 direct irradiance; rho (n, 3); area (n,) visible area, > 0 where the element takes part
    F : FormFactors
    residual : stop shooting at this unshot share, and sweeping at this relative change
    bounces : None to converge, or n >= 1 reflections: 1 is direct light alone
    first : (n, G, 3) the first reflection as gathered from light known finer than by elements; default: by them

    Raises DoesNotConverge when light does not die out.
    """
    n, G = H_direct.shape[:2]
    flat = H_direct.reshape(n, G * 3).astype(np.float64)
    rho_flat = np.tile(rho, (1, G)).astype(np.float64)
    coarse = F.gather(rho_flat * flat)
    first = coarse if first is None else first.reshape(n, G * 3)
    if bounces is not None:
        return _reflect(flat, first, rho_flat, area, F, bounces, G)
    H, dB, history, ledger, shots = _shoot(flat, rho_flat, area, F, residual)
    ambient = _ambient(dB, rho_flat, area, F)
    H, sweeps = _sweep(flat, flat + (first - coarse), H, rho_flat, area, F, residual)
    gathered, shot = (rho_flat * H * area[:, None]).sum(axis=0), ledger.pop("reflected")
    ledger["residue"] = gathered - shot
    ledger = {name: value.reshape(G, 3) for name, value in ledger.items()}
    return Solution(H.reshape(n, G, 3), ambient.reshape(G, 3), history, ledger, shots, sweeps)


def _reflect(H_direct, first, rho, area, F, bounces, G):
    """A fixed number of reflections: the final gather is the last but one, so bounces - 2 sweeps from direct light."""
    column = area[:, None]
    received = (H_direct * column).sum(axis=0)
    H, term = H_direct.copy(), H_direct
    absorbed, escaped = ((1 - rho) * term * column).sum(axis=0), np.zeros_like(received)
    for bounce in range(bounces - 2):
        escaped += (rho * term * column * (F.escaped + F.absorbed)[:, None]).sum(axis=0)
        term = F.gather(rho * term) if bounce else first
        absorbed += ((1 - rho) * term * column).sum(axis=0)
        H = H + term
    unshot = (rho * term * column).sum(axis=0)
    ledger = {"received": received, "absorbed": absorbed, "escaped": escaped, "unshot": unshot}
    ledger["residue"] = received - absorbed - escaped - unshot
    ledger = {name: value.reshape(G, 3) for name, value in ledger.items()}
    return Solution(H.reshape(-1, G, 3), np.zeros((G, 3)), np.zeros((0, 2)), ledger, 0, max(0, bounces - 2))


def _shoot(H_direct, rho, area, F, residual):
    """Progressive refinement; returns H, dB, history, ledger and the number of shots."""
    H, dB = H_direct.copy(), rho * H_direct
    column = area[:, None]
    inverse = np.where(column > 0, 1 / np.where(column > 0, column, 1.0), 0.0)
    received = (H_direct * column).sum(axis=0)
    absorbed = ((1 - rho) * H_direct * column).sum(axis=0)
    escaped = np.zeros_like(received)
    start = np.abs(dB * column).sum()
    history, shots, share = [(0, 1.0)], 0, 1.0
    for _ in range(MOST_ROUNDS):
        if share <= residual or start == 0:
            break
        power = np.abs(dB * column).sum(axis=1)
        bright = power >= BRIGHT * power.max()
        x = np.where(bright[:, None], dB + OVERSHOOT * rho * _ambient(dB, rho, area, F), 0.0)
        sent = x * column
        arrived = F.scatter(sent)
        arrived *= inverse > 0
        H += arrived * inverse
        dB += rho * arrived * inverse - x
        absorbed += ((1 - rho) * arrived).sum(axis=0)
        escaped += sent.sum(axis=0) - arrived.sum(axis=0)
        shots += int(bright.sum())
        share = np.abs(dB * column).sum() / start
        history.append((shots, share))
        if not np.isfinite(share) or share > 1e6:
            raise DoesNotConverge("light grows with every bounce")
        if len(history) > STAGNANT and share > 0.99 * history[-STAGNANT][1]:
            raise DoesNotConverge(f"{STAGNANT} rounds took away less than a hundredth of the unshot light")
    else:
        raise DoesNotConverge(f"{shots} shots leave {share:.3g} of the light unshot; asked {residual:g}")
    unshot = (dB * column).sum(axis=0)
    ledger = {
        "received": received,
        "absorbed": absorbed,
        "escaped": escaped,
        "unshot": unshot,
        "reflected": (rho * H * column).sum(axis=0),
    }
    return H, dB, np.array(history), ledger, shots


def _ambient(dB, rho, area, F):
    """Irradiance the unshot light will still bring, on the mean over the elements, (C,)."""
    total = max(area.sum(), 1e-300)
    met = (F.met * area).sum() / total
    return met / np.maximum(1 - _round_trip(rho, area, F), 1 / MOST_GAIN) * (dB * area[:, None]).sum(axis=0) / total


def _round_trip(rho, area, F):
    """Share of light that is still there after one more bounce, on the mean over the elements, (C,)."""
    total = max(area.sum(), 1e-300)
    return (F.met * area).sum() / total * (rho * area[:, None]).sum(axis=0) / total


def _sweep(H_direct, source, H, rho, area, F, residual):
    """Gather H = source + sum_j F_ij rho_j H_j until what is to come, summed as a geometric series, is below
    `residual`, on the mean of all lit elements.

    Changes count relative to the light of each element: a dim room converges like the bright one beside it.  The first
    of them are the noise of shooting, gone after a few sweeps; light that goes round a room dies slowest, by about the
    mean reflectance a sweep.  So the series is summed with the slowest of that ratio, the last one seen and the one it
    rises to.  After each sweep the light is scaled by what leaves least to change (least squares): (1 + t) H leaves
    change + t (change - source).  Where it ends stays the same, and what is dark stays dark.
    """
    column = area[:, None]
    slow = float(_round_trip(rho, area, F).max(initial=0.0))
    change = source + F.gather(rho * H) - H
    previous, before = _relative(change, H), 0.0
    least = previous
    for sweep in range(1, MOST_SWEEPS + 1):
        H, change = H + change, F.gather(rho * change)
        turn = change - source
        t = -(column * change * turn).sum(axis=0) / np.maximum((column * turn * turn).sum(axis=0), 1e-300)
        H, change = H * (1 + t), change + t * turn
        size = _relative(change, H)
        q = size / previous if previous else 0.0
        bound = max(q, 2 * q - before, slow)  # the ratio rises while faster light dies
        previous, before = size, q
        if size == 0 or (sweep >= LEAST_SWEEPS and bound < 1 and size / (1 - bound) < residual):
            return np.maximum(H, H_direct), sweep
        least = min(least, size)
        if not np.isfinite(size) or size > MOST_GROWTH * least:
            raise DoesNotConverge("light grows with every bounce")
    raise DoesNotConverge(f"{MOST_SWEEPS} sweeps still change the light by {size:.3g}")


def _relative(change, H):
    """Mean of |change| over the light of each element, of those that have any; DARK counts as none."""
    size = np.abs(change)
    lit = size + np.abs(H)
    floor = DARK * lit.max(initial=0.0)
    return float((size / np.maximum(lit, max(floor, 1e-300))).sum() / max((lit > floor).sum(), 1))
