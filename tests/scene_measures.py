"""What the tests of the scenes measure: volumes, lowest points, distances between surfaces of a scene as baked."""

import re
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from lib.formats import scene_model
from lib.nurbs.evaluate import evaluate, evaluate_grid, frame
from lib.surfaces.loops import inside
from lib.surfaces.measure import hull
from lib.surfaces.measure import points as some_points
from lib.surfaces.mesh import Mesh
from lib.surfaces.trimmed import TrimmedSurface

SCENES = Path(__file__).parents[1] / "data" / "scenes"
FLOAT, SINK = 2e-5, 2e-4  # an object may hang 0.02 mm above what it stands on, or sink 0.2 mm into it: neither shows
GAUSS = np.polynomial.legendre.leggauss(8)  # exact for polynomials of degree 15 in each knot span


@cache
def load(name):
    """(settings, Scene) of a scene folder, as a bake reads it."""
    model = scene_model.read(SCENES / name)
    return model.settings, model.scene


def surfaces(name, pattern):
    """(surface, flip) of the surfaces whose whole name matches a regular expression; at least one."""
    scene = load(name)[1]
    found = [
        (surface, flip)
        for full, surface, flip in zip(scene.names, scene.surfaces, scene.flip, strict=True)
        if re.fullmatch(pattern, full)
    ]
    assert found, f"{name}: nothing is called {pattern}"
    return found


def surface(name, pattern):
    """The one surface whose whole name matches."""
    [(one, _)] = surfaces(name, pattern)
    return one


def nodes(knots):
    """Gauss nodes and weights over every knot span of [0, 1]."""
    spans = np.unique(np.concatenate([knots[(knots > 0) & (knots < 1)], [0, 1]]))
    pairs = [((a + b) / 2 + (b - a) / 2 * GAUSS[0], (b - a) / 2 * GAUSS[1]) for a, b in pairwise(spans)]
    return np.concatenate([x for x, _ in pairs]), np.concatenate([w for _, w in pairs])


def volume(parts):
    """Signed volume within surfaces, 1/3 of the integral of S . N dA: > 0 where the lit side is outside."""
    total = 0.0
    centre = np.mean([evaluate(s, [0.5], [0.5])[0][0] for s, _ in parts], axis=0)
    for s, flip in parts:
        (u, w_u), (v, w_v) = nodes(s.knots_u), nodes(s.knots_v)
        S, S_u, S_v = evaluate_grid(s, u, v)
        flux = np.einsum("jik,jik->ji", S - centre, np.cross(S_u, S_v))
        total += (-1 if flip else 1) * float(w_v @ flux @ w_u) / 3
    return total


def points(s, n=257):
    """Points on an n x n grid of parameters, (n n, 3); of a trimmed surface or a mesh the few that say where it is."""
    if isinstance(s, TrimmedSurface | Mesh):
        return some_points(s)
    t = np.linspace(0, 1, n)
    return evaluate_grid(s, t, t)[0].reshape(-1, 3)


def lowest(*parts):
    """Least z over surfaces: the best of a grid of parameters, three times refined about it."""
    floor = [float(hull(s)[:, 2].min()) for s in parts]
    best = np.inf
    for index in np.argsort(floor):  # none lies below its control points
        if floor[index] < best:
            best = min(best, _lowest(parts[index]))
    return best


def _lowest(s):
    if isinstance(s, Mesh):
        return float(s.V[:, 2].min())
    if isinstance(s, TrimmedSurface):
        return min(float(s.S[:, 2].min()), _lowest_within(s.base, lambda uv: inside(s, uv)))
    return _lowest_within(s, None)


def _lowest_within(s, is_inside):
    """Least z of a NurbsSurface where is_inside of (n, 2) parameters says so; None: everywhere."""
    u = v = np.linspace(0, 1, 257)
    for _ in range(4):
        z = evaluate_grid(s, u, v)[0][..., 2]
        if is_inside is not None:
            uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
            z = np.where(is_inside(uv).reshape(z.shape), z, np.inf)
        j, i = np.unravel_index(z.argmin(), z.shape)
        u = np.linspace(u[max(i - 1, 0)], u[min(i + 1, len(u) - 1)], 33)
        v = np.linspace(v[max(j - 1, 0)], v[min(j + 1, len(v) - 1)], 33)
    return float(z.min())


def signed_distances(P, s, flip=False):
    """Distance of points to a closed surface, < 0 within it: nearest sample, then Gauss-Newton on (u, v)."""
    t = np.linspace(0, 1, 201)
    v, u = (a.ravel() for a in np.meshgrid(t, t, indexing="ij"))
    near = cKDTree(points(s, 201)).query(P)[1]
    u, v = u[near], v[near]
    for _ in range(12):
        S, S_u, S_v = evaluate(s, u, v)
        r = P - S
        a, b, c = ((x * y).sum(axis=1) for x, y in ((S_u, S_u), (S_u, S_v), (S_v, S_v)))
        f, g = (S_u * r).sum(axis=1), (S_v * r).sum(axis=1)
        det = np.maximum(a * c - b * b, 1e-12 * a * c + 1e-300)
        u, v = np.clip(u + 0.8 * (c * f - b * g) / det, 0, 1), np.clip(v + 0.8 * (a * g - b * f) / det, 0, 1)
    S, N = frame(s, u, v)
    r = P - S
    side = (r * N).sum(axis=1) * (-1 if flip else 1)
    return np.where(side < 0, -1, 1) * np.linalg.norm(r, axis=1)


def gap(a, b, reach=0.004):
    """Smallest signed distance of surface a to the closed surface b, over the points of a within reach of b."""
    P = points(a)
    rough = cKDTree(points(b, 129)).query(P)[0]
    close = rough < max(reach, 1.5 * rough.min())
    return float(signed_distances(P[close], b).min())
