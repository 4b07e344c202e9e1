"""Charts: no overlap, room between them, true shapes, the same bytes each time; and a mesh's own coordinates."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xatlas
from scipy.ndimage import distance_transform_edt

from lib.surfaces.charts import (
    LEAST_LEVEL,
    MOST_LEVEL,
    PADDING,
    _cut,
    _next_density,
    charted,
    overlap,
    own_charts,
    stretch,
)
from lib.surfaces.mesh_build import mesh, normals_areas

FINE = 8  # points per cell at which gaps are measured
SLACK = 1.5 / FINE  # of that measure


def box(size, at=(0, 0, 0)):
    """A box of 12 triangles, lit outside: V (8, 3), F (12, 3)."""
    V = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * size + at
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return V.astype(float), np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def sphere(n=24):
    """A sphere of latitude and longitude, closed."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, n // 2 + 1), np.linspace(0, 2 * np.pi, n + 1), indexing="ij")
    phi[:, -1] = 0.0  # equal positions, bit for bit
    P = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=2)
    P[0], P[-1] = [0, 0, 1], [0, 0, -1]
    k = np.arange(P.shape[0] * P.shape[1]).reshape(P.shape[:2])
    a, b, c, d = (x.ravel() for x in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    return mesh(P.reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))[0]


def many_boxes(n=40):
    rng = np.random.default_rng(3)
    parts = [box(rng.uniform(0.05, 1.0, 3), rng.uniform(0, 30, 3)) for _ in range(n)]
    V = np.concatenate([V for V, _ in parts])
    F = np.concatenate([F + 8 * k for k, (_, F) in enumerate(parts)])
    return mesh(V, F)[0]


def least_gap(m):
    """The least distance between two charts, in cells of the finest level, along the borders of all triangles."""
    side = FINE * 2**m.level
    picture = np.full((side + 1, side + 1), -1)
    for k in range(3):
        a, b = m.uv[:, k], m.uv[:, (k + 1) % 3]
        n = np.ceil(np.abs(b - a).max(axis=1) * side * 1.5).astype(int) + 1
        which = np.repeat(np.arange(len(a)), n)
        f = np.concatenate([np.linspace(0, 1, count) for count in n])[:, None]
        x, y = np.round((a[which] * (1 - f) + b[which] * f) * side).astype(int).T
        picture[y, x] = m.chart[which]
    distance, (j, i) = distance_transform_edt(picture < 0, return_indices=True)
    nearest = picture[j, i]
    gaps = [np.inf]
    for one, other in (((slice(None), slice(1, None)), (slice(None), slice(-1))), ((slice(1, None),), (slice(-1),))):
        at = nearest[one] != nearest[other]
        gaps.append((distance[one][at] + distance[other][at]).min(initial=np.inf) / FINE)
    return min(gaps)


def hold(m):
    """What every charted mesh keeps to."""
    assert m.uv.shape == (len(m.F), 3, 2)
    side = 2**m.level
    assert PADDING - 1e-9 <= m.uv.min() * side
    assert m.uv.max() * side <= side - PADDING + 1e-9
    assert overlap(m) == 0
    assert least_gap(m) >= PADDING - SLACK
    # Inside a chart a position has one place.
    key = m.chart.astype(np.int64)[:, None] * len(m.V) + m.F
    first = np.unique(key, return_index=True)[1]
    place = dict(zip(key.ravel()[first].tolist(), m.uv.reshape(-1, 2)[first].tolist(), strict=True))
    assert all(place[k] == uv for k, uv in zip(key.ravel().tolist(), m.uv.reshape(-1, 2).tolist(), strict=True))
    assert sorted(set(m.chart.tolist())) == list(range(m.chart.max() + 1))


def test_a_box_becomes_rectangles_on_the_lattice():
    m = charted(mesh(*box((4, 2, 1)))[0], 0.1)
    hold(m)
    assert m.chart.max() + 1 <= 6
    side = 2**m.level
    for k in range(m.chart.max() + 1):
        corners = m.uv[m.chart == k].reshape(-1, 2) * side
        border = np.concatenate([corners.min(axis=0), corners.max(axis=0)])
        assert np.abs(border - np.round(border)).max() < 1e-9
    low, high = stretch(m.V, m.F, m.uv * side)
    assert high.max() / low.min() < 8 / 7  # stretched up to whole cells, of more than seven across the shortest side
    assert 0.1 / np.sqrt(2) * 0.9 < 1 / high.max() <= 1 / low.min() < 0.1 * np.sqrt(2) * 1.1


def test_a_sphere():
    ball = sphere()
    m = charted(ball, 0.05)
    hold(m)
    low, high = stretch(m.V, m.F, m.uv * 2**m.level)
    area = normals_areas(m.V, m.F)[1]
    assert area[high > 1.6 * low].sum() < 0.05 * area.sum()
    assert np.array_equal(m.V, ball.V) and np.array_equal(m.F, ball.F) and np.array_equal(m.N, ball.N)


def test_many_small_charts():
    m = charted(many_boxes(), 0.2)
    hold(m)
    assert m.chart.max() + 1 >= 40
    cells = (m.uv * 2**m.level).reshape(len(m.F), -1)
    width = [np.ptp(cells[m.chart == k].reshape(-1, 2), axis=0).min() for k in range(m.chart.max() + 1)]
    assert min(width) > 1 - 1e-9


def test_the_same_bytes_each_time_and_in_any_unit():
    ball = many_boxes(12)
    a = charted(ball, 0.2)
    for _ in range(3):
        b = charted(ball, 0.2)
        assert (a.uv.tobytes(), a.chart.tobytes(), a.level) == (b.uv.tobytes(), b.chart.tobytes(), b.level)
    c = charted(replace(ball, V=ball.V * 1024.0), 0.2 * 1024)
    assert (a.uv.tobytes(), a.level) == (c.uv.tobytes(), c.level)


def test_slivers_get_a_place():
    """A triangle 1e-7 high beside a square: xatlas ignores it in float32."""
    V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, -1e-7, 0], [3, 0, 0], [3.0001, 0, 0], [3, 1e-7, 0]])
    m = charted(mesh(V, [[0, 1, 2], [0, 2, 3], [0, 4, 1], [5, 6, 7]])[0], 0.05)
    hold(m)
    assert np.isfinite(m.uv).all()
    assert (stretch(m.V, m.F, m.uv)[0] > 0).all()


def test_levels_have_bounds():
    V, F = box((1, 1, 1))
    assert charted(mesh(V, F)[0], 1e3).level >= LEAST_LEVEL
    one = mesh(V[:3], [[0, 1, 2]])[0]
    assert charted(one, 1e3).level == 4  # a cell and twice the padding
    fine = charted(one, 1e-9)
    assert fine.level == MOST_LEVEL
    assert 0.9 * 2**MOST_LEVEL <= np.ptp(fine.uv.reshape(-1, 2), axis=0).max() * 2**MOST_LEVEL + 2 * PADDING
    assert PADDING <= fine.uv.min() * 2**MOST_LEVEL
    for texel in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="charts: a cell"):
            charted(one, texel)


def test_own_coordinates_that_serve():
    V = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=float)
    F = np.array([[0, 1, 2], [0, 2, 3]])
    T = (V[:, :2] * 0.3 + 5)[F]
    m = own_charts(mesh(V, F, T=T)[0], 0.05)
    hold(m)
    assert m.chart.tolist() == [0, 0]
    mirrored = own_charts(mesh(V, F, T=T * [-1, 1])[0], 0.05)
    assert mirrored.chart.tolist() == [0, 0]
    apart = own_charts(mesh(V, F, T=T + np.array([0, 3.0])[:, None, None])[0], 0.05)
    assert apart.chart.tolist() == [0, 1]


@pytest.mark.parametrize("change", ["none", "folded", "line", "stretched", "twice"])
def test_own_coordinates_that_do_not_serve(change):
    V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    F = np.array([[0, 1, 2], [0, 2, 3]])
    T = V[:, :2][F].copy()
    if change == "folded":
        T[1, 2] = T[0, 1]
    if change == "line":
        T[1, 2] = [0.5, 0.5]
    if change == "stretched":
        T[..., 0] *= 4
    m = mesh(V, F, T=None if change == "none" else T)[0]
    if change == "twice":  # a ring of 8 triangles around a point that goes round the picture's centre twice
        angle = np.arange(9) * np.pi / 2
        rim = np.stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle], axis=1)
        V = np.concatenate([[[0, 0, 0.0]], rim[:8]])
        F = np.array([[0, 1 + k, 1 + (k + 1) % 8] for k in range(8)])
        T = np.array(
            [[[0, 0], [np.cos(a), np.sin(a)], [np.cos(a + np.pi / 2), np.sin(a + np.pi / 2)]] for a in angle[:8]]
        )
        m = mesh(V, F, T=np.round(T, 12))[0]
    assert own_charts(m, 0.05) is None


def test_a_strip_a_thousand_million_times_as_long_as_wide():
    V = np.array([[0, 0, 0], [1e6, 0, 0], [1e6, 1e-3, 0], [0, 1e-3, 0], [1, 1, 1], [2, 1, 1], [1, 2, 1]])
    m = charted(mesh(V, [[0, 1, 2], [0, 2, 3], [4, 5, 6]])[0], 0.01)
    assert (m.level, m.chart.max()) == (MOST_LEVEL, 1)
    assert PADDING <= m.uv.min() * 2**MOST_LEVEL and m.uv.max() * 2**MOST_LEVEL <= 2**MOST_LEVEL - PADDING


def test_a_size_that_does_not_fit_is_met_along_the_line_of_those_tried():
    """Maps of 40 + 1000 x density cells a side, for one of 128; none where the cells would come out too coarse."""

    def tried(*densities):
        return [(d, 40 + 1000 * d, None) for d in densities]

    assert _next_density(tried(0.1, 0.095), 128) == pytest.approx((0.98 * 128 - 40) / 1000, rel=1e-12)
    assert _next_density(tried(0.2, 0.15), 128) is None
    assert _next_density(tried(0.088), 128) is None  # full enough
    flat = [(0.1, 3000.0, None), (0.09, 2950.0, None)]  # the line would end below nothing
    assert _next_density(flat, 2**MOST_LEVEL) == 0.25 * 0.09


class LaidOut:
    """An xatlas.Atlas that lays a mesh out as one chart, as it is seen along z but for one corner."""

    width = height = 1

    def __init__(self, drawn):
        self.drawn = drawn

    def add_mesh(self, V, F):
        self.F, self.uv = F, V[:, :2].copy()
        self.uv[V.sum(axis=1).argmax(), 0] += self.drawn - 1

    def generate(self, cutting, packing):
        pass

    def get_mesh(self, k):
        return np.arange(len(self.uv)), self.F, self.uv

    def get_mesh_chart_count(self, k):
        return 1

    def get_mesh_chart(self, mesh, k):
        return SimpleNamespace(faces=np.arange(len(self.F)), type=xatlas.ChartType.LSCM)


@pytest.mark.parametrize("drawn, n_charts", [(5.0, 1), (20.0, 2)])
def test_a_triangle_that_the_library_draws_out_gets_a_chart_of_its_own(monkeypatch, drawn, n_charts):
    """A strip of two hundred, whose last corner is laid so far out that one triangle is `drawn` long."""
    n = 100
    x = np.arange(n + 1.0)
    V = np.concatenate([np.stack([x, np.full(n + 1, y), np.zeros(n + 1)], axis=1) for y in (0.0, 1.0)])
    k = np.arange(n)
    F = np.concatenate([np.stack([k, k + 1, k + n + 1], axis=1), np.stack([k + 1, k + n + 2, k + n + 1], axis=1)])
    monkeypatch.setattr(xatlas, "Atlas", lambda: LaidOut(drawn))
    _, chart = _cut(mesh(V, F)[0], 1.0)
    assert chart.max() + 1 == n_charts and (np.bincount(chart)[1:] == 1).all()
