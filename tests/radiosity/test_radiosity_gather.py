"""The loops of the final gather against plain numpy, on maps, meshes and hits drawn at random."""

from dataclasses import dataclass

import numpy as np
import pytest

from lib.elements.lattice import OFFSET
from lib.radiosity import gather_kernels
from lib.radiosity.gather import NEAR, LookupTable, indirect_light
from lib.radiosity.radiosity_maps import RadiosityMaps, weighted
from lib.visibility.mesh_lookup import MeshLookup
from lib.visibility.qmc import path_steps
from lib.visibility.tracer import Hits, Tracer
from tests.tolerances import FLOAT32

C = 6  # two light groups
V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 2], [0, 1, 2.0]])
UV = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [0, 1], [1, 1.0]])
F = np.array([[0, 1, 2], [3, 2, 1], [0, 2, 4], [5, 4, 2]], dtype=np.int32)
SURFACE = [0, 0, 1, 2]  # the last has no map


@dataclass
class Map:
    value: np.ndarray
    direct: np.ndarray
    weight: np.ndarray
    rho: np.ndarray
    width: float


def a_map(rng, h, w, width):
    shape = h, w, C
    weight = (rng.random((h, w)) > 0.3).astype(np.float32)
    value, direct = (rng.random(shape).astype(np.float32) for _ in range(2))
    return Map(value, direct, weight, rng.random(C).astype(np.float32), width)


def table_of(maps, mesh, n):
    """LookupTable of {surface: Map}, packed last one first, as files of chunks may lie."""
    parts = []
    for s, m in sorted(maps.items(), reverse=True):
        texels = (weighted(x.reshape(*m.weight.shape, -1, 3), m.weight == 0) for x in (m.value, m.direct))
        parts.append(RadiosityMaps(np.array([s], np.int32), np.array([m.weight.shape], np.int32), *texels))
    rho, width = np.ones((n, len(m.rho))), np.ones(n)  # of surfaces without a map nothing counts
    for s, m in maps.items():
        rho[s], width[s] = m.rho, m.width
    return LookupTable(parts, mesh, rho, width)


@pytest.fixture
def scene():
    """maps, mesh, table and 400 hits."""
    rng = np.random.default_rng(11)
    maps = {0: a_map(rng, 5, 9, 0.1), 1: a_map(rng, 3, 3, 0.02)}
    mesh = MeshLookup(V, F, UV, SURFACE, np.zeros(4, dtype=bool))
    n = 400
    barycentric = rng.dirichlet([1, 1, 1], n).astype(np.float32)
    hits = Hits(
        rng.integers(-1, 4, n).astype(np.int32),
        np.ascontiguousarray(barycentric[:, 1]),
        np.ascontiguousarray(barycentric[:, 2]),
        rng.random(n) < 0.2,
        rng.random(n).astype(np.float32),
    )
    return maps, mesh, table_of(maps, mesh, 3), hits


def plain_look_up(maps, field, face, a, b):
    """Bilinear value of a map's field by its weights: (C,)."""
    m = maps.get(SURFACE[face])
    if m is None:
        return np.zeros(C)
    corner = UV[F[face]]
    u, v = corner[0] + a * (corner[1] - corner[0]) + b * (corner[2] - corner[0])
    h, w = m.weight.shape
    s, t = u * (w - 1), v * (h - 1)
    i, j = min(int(s), w - 2), min(int(t), h - 2)
    total, weight = np.zeros(C), 0.0
    for dj, di in np.ndindex(2, 2):
        share = (s - i if di else 1 - s + i) * (t - j if dj else 1 - t + j) * m.weight[j + dj, i + di]
        total += share * getattr(m, field)[j + dj, i + di]
        weight += share
    return total / weight if weight > 0 else total


def of_hit(hits, r):
    return hits.face[r], float(hits.a[r]), float(hits.b[r])


def test_rays_see_the_maps_by_their_weights(scene):
    maps, _, table, hits = scene
    seen, near = table.see(hits, False)
    assert seen.shape == (400, C) and not len(near)
    front = (hits.face >= 0) & ~hits.is_back
    assert (seen[~front] == 0).all() and front.sum() > 200
    for r in np.flatnonzero(front):
        assert seen[r] == pytest.approx(plain_look_up(maps, "value", *of_hit(hits, r)), abs=20 * FLOAT32), r


def test_near_hits_are_named_and_get_direct_light_and_what_they_reflect(scene):
    maps, _, table, hits = scene
    seen, near = table.see(hits, True)
    far, _ = table.see(hits, False)
    width = np.array([maps[s].width if s in maps else 0.0 for s in (*SURFACE, 2)])[hits.face]
    expected = (hits.face >= 0) & ~hits.is_back & (hits.t < (NEAR * width).astype(np.float32))
    assert np.array_equal(near, np.flatnonzero(expected)) and 10 < len(near) < 100
    assert np.array_equal(seen[~expected], far[~expected])
    H = np.random.default_rng(3).random((len(near), C)).astype(np.float32)
    table.reflect(hits, near, H, seen)
    for k, r in enumerate(near):
        direct = plain_look_up(maps, "direct", *of_hit(hits, r))
        assert seen[r] == pytest.approx(direct + maps[SURFACE[hits.face[r]]].rho * H[k], abs=20 * FLOAT32)
    assert np.array_equal(seen[~expected], far[~expected])


def test_rays_go_on_from_the_places_that_were_hit(scene):
    """Origins a hair above the hits; directions of density cos / pi whose coordinates are (k step + turn shift)."""
    _, mesh, _, hits = scene
    rng = np.random.default_rng(4)
    K, n = 16, 400
    origins, D = (rng.random((n, 3)).astype(np.float32) for _ in range(2))
    shift, chosen = rng.random((n // K, 2)), np.flatnonzero(hits.face >= 0)
    x, onward = np.empty((len(chosen), 3), np.float32), np.empty((len(chosen), 3), np.float32)
    ray, ray_on = np.arange(n), np.empty(len(chosen), dtype=np.int64)
    for number in (1, 4):
        step, turn = path_steps(number)
        gather_kernels.onward(
            chosen, hits.face, hits.t, mesh.normal, origins, D, ray, K, shift, step, turn, x, onward, ray_on
        )
        N = mesh.normal[hits.face[chosen]]
        assert np.array_equal(ray_on, chosen)
        assert np.abs(x - (origins + hits.t[:, None] * D)[chosen] - OFFSET * N).max() < FLOAT32
        points = ((chosen % K)[:, None] * step + shift[chosen // K] @ turn.T) % 1
        assert np.abs(np.linalg.norm(onward, axis=1) - 1).max() < FLOAT32
        cosine = np.einsum("ij,ij->i", N, onward)
        assert np.abs(cosine**2 - (1 - points[:, 0])).max() < 10 * FLOAT32
        # About one normal the angles turn as the second coordinates do.
        for f in range(4):
            mine = np.flatnonzero(hits.face[chosen] == f)
            across = onward[mine] - cosine[mine, None] * N[mine]
            across /= np.linalg.norm(across, axis=1)[:, None]
            right = np.cross(N[mine], across)
            angle = np.arctan2(-right @ across[0], across @ across[0])
            expected = 2 * np.pi * (points[mine, 1] - points[mine[0], 1])
            assert np.abs(np.exp(1j * angle) - np.exp(1j * expected)).max() < 1e-3


def test_sums_over_the_rays_of_a_sample():
    rng = np.random.default_rng(5)
    n, K = 7, 32
    seen, t = rng.random((n * K, C)).astype(np.float32), rng.random(n * K).astype(np.float32)
    t[3] = 0.0
    H, deviation, reach = np.empty((n, C), np.float32), np.empty(n, np.float32), np.empty(n, np.float32)
    gather_kernels.summed(seen, t, K, H, deviation, reach)
    rays = seen.reshape(n, K, C).astype(float)
    assert np.abs(H - rays.mean(axis=1)).max() < FLOAT32
    groups = rays[..., :3] + rays[..., 3:]
    assert np.abs(deviation - groups.std(axis=1).max(axis=1)).max() < FLOAT32
    expected = K / (1 / np.maximum(t.reshape(n, K).astype(float), 1e-6)).sum(axis=1)
    assert reach == pytest.approx(expected, rel=1e-5)
    gather_kernels.summed(np.full((K, 3), 0.25, np.float32), t[:K], K, H[:1, :3].copy(), deviation[:1], reach[:1])
    assert deviation[0] == 0


def test_a_ceiling_of_known_light():
    """Above a point at the middle of the unit square, a ceiling at height 1 whose map is 2: F 2, F = 0.23948."""
    corners = np.array([[0, 0, 1], [0, 1, 1], [1, 0, 1], [1, 1, 1.0]])
    faces = np.array([[0, 1, 2], [3, 2, 1]], dtype=np.int32)
    mesh = MeshLookup(corners, faces, corners[:, :2], [0, 0], np.zeros(2, dtype=bool))
    flat = np.full((2, 2, 3), 2.0, np.float32)
    table = table_of({0: Map(flat, flat, np.ones((2, 2), np.float32), np.ones(3), 0.01)}, mesh, 1)
    x, N = np.full((4, 3), (0.5, 0.5, 0.0)), np.tile([0, 0, 1.0], (4, 1))
    shift = np.random.default_rng(6).random((4, 2))
    light = indirect_light(x, N, shift, 4096, Tracer(corners, faces), mesh, table, 3)
    A = 0.5
    F_quarter = A / np.sqrt(1 + A * A) * np.arctan(A / np.sqrt(1 + A * A)) / np.pi
    assert light.H == pytest.approx(np.full((4, 3), 2 * 4 * F_quarter), rel=2e-3)
    assert not light.hidden.any() and (light.noise > 0).all()
