"""Cosine directions and low-discrepancy points: densities in closed form, and the same draws every time."""

import numpy as np
import pytest

from lib.visibility import qmc
from lib.visibility.hemisphere import cosine_direction_each, rays_about
from lib.visibility.hidden import is_hidden
from lib.visibility.qmc import R2_STEP, path_steps, r2, shift, stream
from lib.visibility.tracer import Hits
from tests.tolerances import EXACT, FLOAT32, STANDARD_ERRORS

NORMALS = np.concatenate([np.eye(3), -np.eye(3), np.random.default_rng(3).normal(size=(40, 3))])
NORMALS /= np.linalg.norm(NORMALS, axis=1)[:, None]


def mean_and_error(values):
    """Mean over independent estimates (m,), and its standard error."""
    return values.mean(), values.std(ddof=1) / np.sqrt(len(values))


def cosine_directions(N, points, shift):
    """Directions about each normal, (m, K, 3)."""
    return rays_about(N, N, points, shift)[1].reshape(len(N), len(points), 3)


def plain_directions(N, points):
    """Malley's method, one normal and one point at a time, in any frame that is orthonormal: (m, 3)."""
    out = []
    for n, (r2_, turn) in zip(N, points, strict=True):
        sign = -1.0 if n[2] < -1e-5 else 1.0
        half = np.array([n[0], n[1], n[2] + sign])  # the pole is mirrored into n
        mirror = 2 * np.outer(half, half) / (half @ half) - np.eye(3)
        r, phi = np.sqrt(r2_), 2 * np.pi * turn
        x, y = r * np.cos(phi), r * np.sin(phi)
        out.append(mirror @ [-x, -sign * y, sign * np.sqrt(1 - r2_)])
    return np.array(out)


def test_directions_by_a_reflection():
    """Duff's frame is the reflection of the pole into the normal; poles and normals next to them among them."""
    near_pole = np.array([[1e-9, 0, -1.0], [0, -1e-9, -1.0], [1e-5, 1e-5, 1.0], [1, 0, -1e-6], [1, 0, -1e-4]])
    N = np.concatenate([NORMALS, near_pole / np.linalg.norm(near_pole, axis=1)[:, None]])
    points = np.random.default_rng(8).random((len(N), 2))
    expected = plain_directions(N, points)
    assert np.abs(cosine_directions(N, np.zeros((1, 2)), points)[:, 0] - expected).max() < FLOAT32
    assert np.abs(cosine_direction_each(N, points) - expected).max() < 4 * FLOAT32


def test_rays_of_groups_share_their_shift_and_each_has_its_points():
    """Normal i takes points[i % P] and shift[i // P]; rays of a normal lie together and leave from its point."""
    rng = np.random.default_rng(6)
    x, points, shifts = rng.random((6, 3)), rng.random((3, 5, 2)), rng.random((2, 2))
    origins, D = rays_about(x, NORMALS[:6], points, shifts)
    assert np.array_equal(origins, np.repeat(x.astype(np.float32), 5, axis=0))
    for i in range(6):
        alone = rays_about(x[i : i + 1], NORMALS[i : i + 1], points[i % 3], shifts[i // 3 : i // 3 + 1])[1]
        assert np.array_equal(D[5 * i : 5 * i + 5], alone)


def test_directions_are_unit_and_above_the_plane():
    D = cosine_directions(NORMALS, r2(500), np.random.default_rng(1).random((len(NORMALS), 2)))
    assert D.dtype == np.float32 and D.shape == (len(NORMALS), 500, 3)
    assert np.abs(np.linalg.norm(D, axis=2) - 1).max() < FLOAT32
    assert (np.einsum("mkc,mc->mk", D.astype(float), NORMALS) > 0).all()


@pytest.mark.parametrize("power, truth", [(1, 2 / 3), (2, 1 / 2), (3, 2 / 5)])
def test_moments_of_the_cosine(power, truth):
    """With density cos / pi the mean of cos^k is 2 / (k + 2)."""
    shifts = np.random.default_rng(power).random((len(NORMALS), 2))
    cosines = np.einsum("mkc,mc->mk", cosine_directions(NORMALS, r2(256), shifts).astype(float), NORMALS)
    mean, error = mean_and_error((cosines**power).mean(axis=1))
    assert abs(mean - truth) < STANDARD_ERRORS * error + FLOAT32
    assert error < 0.01 / np.sqrt(len(NORMALS))  # random points would have 0.02 at best


def test_directions_have_no_side():
    """The mean direction is 2/3 N."""
    shifts = np.random.default_rng(9).random((len(NORMALS), 2))
    mean = cosine_directions(NORMALS, r2(1024), shifts).astype(float).mean(axis=1)
    assert np.abs(mean - NORMALS * 2 / 3).max() < 0.01


@pytest.mark.parametrize("up", [np.array([0, 0, 1.0]), np.array([0.6, 0, 0.8])])
def test_irradiance_under_a_gradient(up):
    """Radiosity 1 + d.g from direction d gives the irradiance 1 + 2/3 N.g: the form is linear in N."""
    g = 0.5 * up
    shifts = np.random.default_rng(4).random((len(NORMALS), 2))
    D = cosine_directions(NORMALS, r2(256), shifts).astype(float)
    H = (1 + D @ g).mean(axis=1)
    off, error = mean_and_error(H - (1 + 2 / 3 * NORMALS @ g))
    assert abs(off) < STANDARD_ERRORS * error + FLOAT32
    assert np.abs(H - (1 + 2 / 3 * NORMALS @ g)).max() < 0.02


def test_shifted_directions_are_those_of_shifted_points():
    points, q = r2(50), np.array([[0.3, 0.9]])
    turned = cosine_directions(NORMALS[:1], (points + q) % 1, np.zeros((1, 2)))
    assert np.abs(cosine_directions(NORMALS[:1], points, q) - turned).max() < 1e-5


def test_r2_by_its_definition():
    g = 1.0 / R2_STEP[0]
    assert g**3 == pytest.approx(g + 1, rel=EXACT) and R2_STEP[1] == pytest.approx(1 / g**2, rel=EXACT)
    assert np.abs(r2(3) - (0.5 + np.arange(1, 4)[:, None] * R2_STEP) % 1).max() < EXACT
    assert np.array_equal(r2(100)[60:], r2(40, first=61))


def test_r2_fills_the_square():
    """Star discrepancy over boxes at the origin: below that of random points by far."""
    p = r2(1000)
    corners = np.random.default_rng(5).random((200, 2))
    inside = (p[None] < corners[:, None]).all(axis=2).mean(axis=1)
    assert np.abs(inside - corners.prod(axis=1)).max() < 0.006


def test_shifts_are_a_function_of_place_seed_and_name():
    j, i = (a.ravel() for a in np.indices((33, 65)))
    q = shift(stream(1, "wall"), i, j)
    assert q.shape == (33 * 65, 2) and (q >= 0).all() and (q < 1).all()
    some = np.random.default_rng(2).permutation(len(i))[:100]
    assert np.array_equal(shift(stream(1, "wall"), i[some], j[some]), q[some])
    for other in (stream(2, "wall"), stream(1, "wall 2")):
        assert (shift(other, i, j) != q).mean() > 0.99
    assert len(np.unique(q, axis=0)) == len(q)


def test_shifts_are_uniform_and_uncorrelated():
    j, i = (a.ravel() for a in np.indices((100, 100)))
    q = shift(stream(7, "floor"), i, j)
    error = 1 / np.sqrt(12 * len(q))
    assert np.abs(q.mean(axis=0) - 0.5).max() < STANDARD_ERRORS * error
    columns = np.stack([q[:, 0], q[:, 1], np.roll(q[:, 0], 1), np.roll(q[:, 0], 100)])
    off_diagonal = np.corrcoef(columns)[np.triu_indices(4, 1)]
    assert np.abs(off_diagonal).max() < STANDARD_ERRORS / np.sqrt(len(q))


def test_the_mixer_is_splitmix64():
    """First output of SplitMix64 from state 0, as its authors' code prints it."""
    assert hex(int(qmc._mix(np.array([0x9E3779B97F4A7C15], dtype=np.uint64))[0])) == "0xe220a8397b1dcdaf"


def test_streams_keep_seed_and_name_apart():
    assert len({stream(seed, name) for seed in (1, 11, "1 rows") for name in ("1", "floor", "1floor", "")}) == 12


def hits(back, shell):
    """One point's 20 rays: `back` of them meet back faces, `shell` of those inside a closed shell; the first of others
    miss.  With which faces are of a shell: Hits, (2,) bool."""
    number = np.arange(20)
    face = np.where(number < shell, 1, np.where((number >= back) & (number % 2 == 0), -1, 0)).astype(np.int32)
    none = np.zeros(20, dtype=np.float32)
    return Hits(face, none, none, number < back, none), np.array([False, True])


@pytest.mark.parametrize(
    "back, shell, expected",
    [
        (0, 0, False),
        (2, 2, False),
        (3, 3, True),
        (20, 20, True),
        (10, 0, False),
        (18, 0, False),
        (19, 0, True),
        (18, 2, False),
    ],
)
def test_hidden_by_shells_at_a_tenth_and_by_sheets_at_nine_tenths(back, shell, expected):
    assert is_hidden(*hits(back, shell), 20).tolist() == [expected]


def test_front_faces_of_shells_hide_nothing():
    none = np.zeros(20, dtype=np.float32)
    fronts = Hits(np.zeros(20, dtype=np.int32), none, none, np.zeros(20, dtype=bool), none)
    assert not is_hidden(fronts, np.array([True]), 20).any()


def test_steps_of_a_path_do_not_know_each_other():
    """Over all turns of a sample every pair of coordinates, the first direction's too, is uniform on the square."""
    turns = shift(stream(1, "path"), *(a.ravel() for a in np.indices((200, 200))))
    steps = (path_steps(number) for number in (1, 2, 3, 4))
    all_of_them = np.concatenate([turns, *((5 * step + turns @ turn.T) % 1 for step, turn in steps)], axis=1)
    for a in range(10):
        for b in range(a):
            cells = np.histogram2d(all_of_them[:, a], all_of_them[:, b], bins=8, range=[[0, 1], [0, 1]])[0]
            assert np.abs(cells - len(turns) / 64).max() < 5 * np.sqrt(len(turns) / 64), (a, b)
