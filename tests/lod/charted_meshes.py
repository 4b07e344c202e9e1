"""Meshes with charts made by hand: corners typed as grids, positions equal bit for bit where grids meet."""

import numpy as np

from lib.surfaces.mesh import Mesh
from lib.surfaces.mesh_build import welded

TURN = np.array([[2, -2, 1], [1, 2, 2], [-2, -1, 2]]) / 3  # a rotation: nothing is parallel to an axis


def grid(P):
    """Corners (m, 3, c) of the triangles, two a cell, of points P (r, c, k)."""
    a, b, c, d = P[:-1, :-1], P[:-1, 1:], P[1:, 1:], P[1:, :-1]
    return np.concatenate([np.stack(each, axis=2).reshape(-1, 3, P.shape[2]) for each in ((a, b, c), (a, c, d))])


def mesh(charts, round_=False):
    """Mesh of charts (corners (m, 3, 3), uv (m, 3, 2)); normals of the triangles, or as on a sphere."""
    X, uv = (np.concatenate(each) for each in zip(*charts, strict=True))
    number = np.repeat(np.arange(len(charts), dtype=np.int32), [len(x) for x, _ in charts])
    V, F = welded(X.reshape(-1, 3), np.arange(3 * len(X)).reshape(-1, 3))
    N = X if round_ else np.repeat(np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])[:, None], 3, axis=1)
    return Mesh(V, F.astype(np.int32), N / np.linalg.norm(N, axis=2, keepdims=True), None, uv, number, 6)


def sheet(n, turn=TURN):
    """Two charts side by side, each n x n cells of a plane, (x, y) in [0, 2] x [0, 1], and uv = (0.4 x + 0.05, 0.8 y +
    0.1) in the left one, (0.4 x + 0.15, 0.8 y + 0.1) in the right one.
    """
    y, x = np.meshgrid(np.arange(n + 1) / n, np.arange(2 * n + 1) / n, indexing="ij")
    P = np.stack([x, y, np.zeros_like(x)], axis=2) @ np.asarray(turn).T
    uv = np.stack([0.4 * x, 0.8 * y], axis=2) + [0.05, 0.1]
    left, right = np.s_[:, : n + 1], np.s_[:, n:]
    return mesh([(grid(P[left]), grid(uv[left])), (grid(P[right]), grid(uv[right] + [0.1, 0.0]))])


def sphere(n):
    """A sphere of radius 1 whose six charts are the sides of a cube, each n x n cells, n even: 12 n^2 triangles."""
    t = np.arange(-(n // 2), n // 2 + 1) / (n // 2)
    t = np.sign(t) * np.tan(np.abs(t) * np.pi / 4)
    t[[0, -1]] = -1, 1  # tan(pi / 4) is not quite
    a, b = np.meshgrid(t, t)
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    charts = []
    for k in range(6):
        axis, side = k // 2, 1 - 2 * (k % 2)
        P = np.empty((n + 1, n + 1, 3))
        P[..., axis], P[..., (axis + 1) % 3], P[..., (axis + 2) % 3] = side, a, b * side
        P /= np.sqrt(np.sort(P**2, axis=2).sum(axis=2, keepdims=True))  # summed in one order, equal on both sides
        uv = np.stack([k % 3 / 3 + 0.02 + 0.28 * u, k // 3 / 2 + 0.03 + 0.4 * v], axis=2)
        charts.append((grid(P), grid(uv)))
    return mesh(charts, round_=True)


def split(whole, groups):
    """Meshes of the charts of a mesh: one of the charts groups[0], one of groups[1]..."""
    out = []
    for charts in groups:
        own = np.isin(whole.chart, charts)
        V, F = welded(whole.V, whole.F[own].astype(np.int64))
        out.append(Mesh(V, F.astype(np.int32), whole.N[own], None, whole.uv[own], whole.chart[own], whole.level))
    return out
