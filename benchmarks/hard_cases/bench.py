"""What the hard cases share: a bake through the stages' doors, the figures they give, and closed forms of direct light.

A case is a function of a Bench that yields Figures. Every figure is an error: it holds when achieved <= asked.
"""

from contextlib import redirect_stderr
from dataclasses import dataclass
from io import StringIO

import numpy as np

from tests.rooms import Baked, scene_of

CHEAP = {  # enough for the figures to hold, and for a broken solver to break them
    "tolerance": 0.02,
    "max_level": 5,
    "elements": 300,
    "rays_per_element": 64,
    "gather_rays": 128,
    "shadow_rays": [16, 32],
}
STANDARD = {  # the defaults of config/bake.yaml
    "tolerance": 0.01,
    "max_level": 7,
    "elements": "auto",
    "rays_per_element": "auto",
    "gather_rays": "auto",
    "shadow_rays": "auto",
}
DENSE = 193  # points a side at which maps are compared, between their texels too
INSIDE = 0.002  # border samples look from this far inside, in parameters


@dataclass(frozen=True)
class Figure:
    """One line of the table: an error (relative unless `truth` says otherwise), the most that is allowed, and what it
    is measured against."""

    what: str
    truth: str
    asked: float
    achieved: float

    @property
    def holds(self):
        """False for NaN."""
        return bool(self.achieved <= self.asked)


class Bench:
    """Bakes scenes below `folder`, each in a folder of its own, at the default settings or at cheap ones."""

    def __init__(self, folder, is_cheap=False):
        self.folder, self.is_cheap, self._bakes = folder, is_cheap, 0

    def prepare(self, surfaces, rho, cheap=None, **changes):
        """A bake ready to run: tests.rooms.Baked.

        surfaces {name: (surface, facts)}, rho as Baked takes them; changes of the settings; cheap: changes at cheap
        settings alone.
        """
        self._bakes += 1
        settings = (CHEAP | (cheap or {})) if self.is_cheap else STANDARD
        folder = self.folder / f"bake_{self._bakes}"
        return Baked(folder, scene_of(surfaces), rho, **{**settings, **changes})

    def bake(self, surfaces, rho, cheap=None, **changes):
        """The same, done."""
        return self.prepare(surfaces, rho, cheap, **changes).all()

    def maps(self, surfaces, rho, cheap=None, **changes):
        """{name: (H (h, w, 3) summed over groups, hidden (h, w))}."""
        found = self.bake(surfaces, rho, cheap, **changes).maps()
        return {name: (H.sum(axis=2), hidden) for name, (H, hidden) in found.items()}

    def file(self, name, text):
        """Path of a new file below the folder."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path


def quietly(function, *args):
    """What a function returns, and what it said on the terminal."""
    said = StringIO()
    with redirect_stderr(said):
        result = function(*args)
    return result, said.getvalue()


def crossings(shape, origin, u, v):
    """Points (h, w, 3) of a rectangle that the samples of its map (h, w, ...) look from."""
    b, a = (np.clip(np.linspace(0, 1, n), INSIDE, 1 - INSIDE) for n in shape[:2])
    return np.asarray(origin) + a[None, :, None] * np.asarray(u, float) + b[:, None, None] * np.asarray(v, float)


def looked_up(H, shape):
    """A map (h, w, ...) looked up bilinearly at shape = (rows, columns) of uniform parameters, borders included."""
    for axis in (0, 1):
        x = np.linspace(0, H.shape[axis] - 1, shape[axis])
        i = np.minimum(x.astype(int), H.shape[axis] - 2)
        t = (x - i).reshape([-1 if k == axis else 1 for k in range(H.ndim)])
        H = np.take(H, i, axis=axis) * (1 - t) + np.take(H, i + 1, axis=axis) * t
    return H


def worst(value, truth):
    """Largest relative departure."""
    return float(np.max(np.abs(np.asarray(value, float) / truth - 1)))


def rms(value, truth, scale=None):
    """Root mean square departure, over the mean of the truth (or over `scale`)."""
    wrong = np.asarray(value, float) - truth
    return float(np.sqrt(np.mean(wrong**2)) / (np.mean(truth) if scale is None else scale))


def parallel_rectangle(x, low, high, height):
    """Form factors from points below a rectangle, both horizontal (Howell's catalogue, B-3, by superposition).

    x (..., 2) the points in the plane, low, high (..., 2) corners of the rectangle, `height` above them; empty where
    high <= low.
    """
    sides = [(np.asarray(corner) - x) / height for corner in (low, high)]
    a, b = ([side[..., k] for side in sides] for k in (0, 1))
    F = _corner(a[1], b[1]) - _corner(a[0], b[1]) - _corner(a[1], b[0]) + _corner(a[0], b[0])
    return np.where((np.asarray(high) > np.asarray(low)).all(axis=-1), F, 0.0)


def _corner(a, b):
    """From the point below a corner to the rectangle a x b at distance 1; odd in both."""
    p, q = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
    return (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi)


def numeric_rectangle(x, N, corner, u, v, normal, n=48):
    """Form factors from points x (k, 3) with normals N (k, 3) to a one-sided rectangle, by n x n points of it."""
    t, weight = np.polynomial.legendre.leggauss(n)
    t, weight = (t + 1) / 2, weight / 2
    y = np.asarray(corner) + t[:, None, None] * np.asarray(u, float) + t[None, :, None] * np.asarray(v, float)
    area = np.linalg.norm(np.cross(u, v)) * (weight[:, None] * weight).ravel()
    D = y.reshape(-1, 3)[None] - x[:, None]
    r2 = (D**2).sum(axis=2)
    cos_x, cos_y = np.einsum("kpc,kc->kp", D, N), -(D @ np.asarray(normal, float))
    return (np.maximum(cos_x, 0) * np.maximum(cos_y, 0) / (np.pi * r2 * r2)) @ area
