"""What thinning keeps of a mesh: where a vertex may not go, which normals stay, and what holds a locked vertex."""

import numpy as np
import pytest

from lib.lod import collapse, thinned
from lib.nurbs.facets import normals
from tests.lod.charted_meshes import sheet


def turned(degrees):
    """The unit vector (3,) that many degrees from z."""
    return np.array([np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))])


def test_normals_give_way_beyond_sixty_degrees():
    face = np.tile([0.0, 0.0, 1.0], (3, 1))
    given = np.array([[turned(d)] * 3 for d in (58.0, 62.0, 0.0)])
    given[2] = 0.0  # sums that cancel out
    N = thinned._facing(2 * given, face)
    assert np.allclose(N[0], turned(58.0)) and np.allclose(N[1:], [0.0, 0.0, 1.0])


def roof(at):
    """A fan about vertex 0, which stands `at` (3,), of a unit square's corners: base (5, 3), F (4, 3)."""
    base = np.array([at, [0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float64)
    return base, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]])


class Planes:
    """As much of a Thinned as it takes to place vertices: one plane pulls at vertex 0, none is locked."""

    locked = np.empty(0, dtype=np.int64)

    def __init__(self, n, through):
        pulled = np.array([[1.0], [0], [0], [0], [0]])
        self._planes = pulled * np.outer(n, n).ravel(), pulled * (-np.dot(n, through) * np.asarray(n)), np.ones((5, 1))

    def placed(self, base, F, given):
        return thinned.Thinned._placed(self, np.arange(len(base)), base, F, given)


@pytest.mark.parametrize(
    "x, stays",
    [
        (0.9, False),
        (0.97, False),  # the lowest triangle is 0.035 high on a base of 1
        (0.99, True),  # 0.015: flat
        (1.4, True),  # upside down
    ],
)
def test_a_vertex_goes_where_its_planes_meet_unless_that_flattens_a_triangle(x, stays):
    base, F = roof([0.5, 0.5, 0.0])
    given = normals(*(base[F[:, k]] for k in range(3)))[0]
    X = Planes([1.0, 0.0, 0.0], [x, 0.5, 0.0]).placed(base, F, given)
    share = 1 / (1 + thinned.PULL)
    expected = base[0] if stays else [0.5 + share * (x - 0.5), 0.5, 0.0]
    assert np.allclose(X[0], expected, atol=1e-12) and np.array_equal(X[1:], base[1:])


@pytest.mark.parametrize("z, stays", [(2.3, False), (2.6, True)])
def test_a_triangle_turns_by_no_more_than_the_library_lets_it(z, stays):
    """Raised to z above the middle, the four turn by arctan 2 z: 77.7 degrees at 2.3, 79.1 at 2.6; allowed are 78.5."""
    base, F = roof([0.5, 0.5, 0.0])
    given = np.tile([0.0, 0.0, 1.0], (4, 1))
    z_given = z * (1 + thinned.PULL)
    X = Planes([0.0, 0.0, 1.0], [0.5, 0.5, z_given]).placed(base, F, given)
    assert X[0, 2] == pytest.approx(0.0 if stays else z, abs=1e-12)


def test_a_locked_vertex_is_held_in_all_directions():
    """The planes of what is added about it, those of its two locks among them, are independent; else one is missing."""
    mesh = sheet(4, np.eye(3))
    locked = 6
    added = collapse.with_added(mesh.V, mesh.F, np.empty((0, 2), int), np.empty(0, int), np.array([locked]))
    own = added.T[len(mesh.F) :]
    own = own[(own == locked).any(axis=1)]
    N = normals(*(added.P[own[:, k]] for k in range(3)))[0]
    assert len(own) == 3  # its tag and two locks
    assert np.allclose(np.linalg.eigvalsh(N.T @ N), 1, atol=1e-4)
