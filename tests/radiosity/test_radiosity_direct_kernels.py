"""The loops of direct light against plain numpy: which facets are chosen, what points weigh, what is seen."""

import numpy as np
import pytest

from lib.radiosity import direct_kernels
from lib.radiosity.direct_kernels import LAST
from tests.tolerances import EXACT, FLOAT32

FIRST = np.array([0, 3, 4, 8])  # facets of three emitters
MAKE = np.random.default_rng(21)
M, K = 50, 8
F = MAKE.random((M, K)) * (MAKE.random((M, K)) > 0.2)
RUNNING = np.cumsum(F, axis=1)
X, N, SHIFT = MAKE.random((M, 3)), MAKE.normal(size=(M, 3)), MAKE.random((M, 2))
N /= np.linalg.norm(N, axis=1)[:, None]
ORIGIN, E1, E2, NORMAL = (MAKE.normal(size=(K, 3)) for _ in range(4))
NORMAL /= np.linalg.norm(NORMAL, axis=1)[:, None]
IS_TRIANGLE, AREA = MAKE.random(K) < 0.5, MAKE.random(K)


def plain_choice(row, l, p):
    """The facet in whose stretch of [0, 1) p lies, and where in it; the first of an emitter without light."""
    own = F[row, FIRST[l] : FIRST[l + 1]]
    ends = np.cumsum(own) / own.sum()
    facet = int(np.searchsorted(ends, p, side="right"))
    return FIRST[l] + facet, (p - ends[facet]) * own.sum() / own[facet] + 1


def cast(points, asked, l, alike):
    """What shadow_rays gives, cut to the rays there are."""
    most = len(asked) * len(points)
    out = np.empty((most, 3), np.float32), np.empty((most, 3), np.float32), np.empty(most), np.empty(most, np.int64)
    facets = ORIGIN, E1, E2, NORMAL, IS_TRIANGLE, AREA, alike
    first = np.arange(K + 1) if alike else FIRST
    n = direct_kernels.shadow_rays(X, N, SHIFT, points, asked, l, F, RUNNING, first, *facets, *out)
    return tuple(array[:n] for array in out)


@pytest.mark.parametrize("alike", [False, True])
def test_points_on_emitters_and_their_weights(alike):
    """Point k of a pair: facet by its share of F, then uniform on it; weight cos cos' / r^4 over the density."""
    points = np.random.default_rng(22).random((5, 2))
    emitters = K if alike else 3
    asked, l = (a.ravel() for a in np.indices((M, emitters)))
    first = np.arange(K + 1) if alike else FIRST
    lit = np.array([F[row, first[e] : first[e + 1]].sum() > 0 for row, e in zip(asked, l, strict=True)])
    asked, l = asked[lit], l[lit]
    origins, D, w, pair = cast(points, asked, l, alike)
    expected = []
    for k, (row, e) in enumerate(zip(asked, l, strict=True)):
        for a, b in (points + SHIFT[row]) % 1:
            facet, a = (e, a) if alike else plain_choice(row, e, a)
            if IS_TRIANGLE[facet] and a + b > 1:
                a, b = 1 - a, 1 - b
            d = ORIGIN[facet] + a * E1[facet] + b * E2[facet] - X[row]
            cosines = max(N[row] @ d, 0) * max(-NORMAL[facet] @ d, 0)
            if cosines > 0:
                density = 1.0 if alike else F[row, facet] / AREA[facet]
                expected.append((k, cosines / (d @ d) ** 2 / density, *d))
    expected = np.array(expected)
    assert 100 < len(pair) == len(expected) < len(asked) * 5
    assert np.array_equal(pair, expected[:, 0]) and w == pytest.approx(expected[:, 1], rel=1e-9)
    assert np.abs(D - expected[:, 2:]).max() < 5 * FLOAT32
    assert np.array_equal(origins, X[asked[pair]].astype(np.float32))


def test_a_facet_without_light_is_never_chosen():
    points = np.stack([np.linspace(0, 1, 64, endpoint=False), np.full(64, 0.5)], axis=1)
    for row in range(M):
        for l in range(3):
            if F[row, FIRST[l] : FIRST[l + 1]].any():
                chosen = [direct_kernels.chosen(RUNNING, F, row, FIRST[l], FIRST[l + 1], p)[0] for p in points[:, 0]]
                assert (F[row, chosen] > 0).all()


def test_what_is_left_of_the_number_lies_within_the_facet():
    for p in (0.0, 0.3, 1 - 1e-16):
        facet, left = direct_kernels.chosen(RUNNING, F, 0, 4, 8, p)
        assert 4 <= facet < 8 and 0 <= left <= LAST
    assert direct_kernels.chosen(np.zeros((1, 2)), np.zeros((1, 2)), 0, 0, 2, 0.5)[1] == 0.5


def test_sums_of_what_is_seen():
    w, pair = np.array([1.0, 2, 4, 8]), np.array([0, 0, 2, 2])
    seen, total = np.array([0.0, 0, 0]), np.array([0.5, 0, 0])
    direct_kernels.seen_and_total(w, pair, np.array([True, False, False]), seen, total)  # the last was never cast
    assert seen.tolist() == [2, 0, 4] and total.tolist() == [3.5, 0, 4]


def test_the_highest_corner():
    corners = np.array([[[0, 0, 1], [1, 0, 3], [1, 1, 2], [0, 1, 1.0]]])
    D = np.empty((2, 3), dtype=np.float32)
    x, n = np.array([[0.5, 0, 0], [0.5, 0, 0]]), np.array([[0, 0, 1.0], [0, 1.0, 0]])
    one, asked = np.ones((2, 1)), np.arange(2)
    direct_kernels.to_highest_corners(x, n, asked, np.zeros(2, np.int64), one, one, np.array([0, 1]), corners, D)
    assert np.abs(D - [[0.5, 0, 3], [0.5, 1, 2]]).max() < EXACT
