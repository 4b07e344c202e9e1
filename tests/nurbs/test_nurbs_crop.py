"""Parts of surfaces are the surface itself; across the seam of a closed one too."""

import numpy as np
import pytest

from lib.nurbs.crop import cropped
from lib.nurbs.evaluate import point
from lib.nurbs.surface import NurbsSurface, from_points

RNG = np.random.default_rng(0)
HALF = np.sqrt(0.5)


def cylinder(radius=1.0, height=2.0):
    """Closed in u, four arcs; v runs up."""
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0.0]]) * radius
    P = np.array([[[x, y, 0.0], [x, y, height]] for x, y in ring])
    w = np.array([1, HALF] * 4 + [1])[:, None].repeat(2, axis=1)
    return from_points(2, 1, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], [0, 0, 1, 1], P, w)


@pytest.mark.parametrize("p, q, n, m", [(1, 1, 2, 2), (3, 3, 9, 5), (2, 5, 3, 12), (4, 1, 7, 6)])
@pytest.mark.parametrize("clamped", [True, False])
def test_the_part_is_the_surface(p, q, n, m, clamped):
    def knots(degree, count):
        inner = np.sort(RNG.random(count - degree - 1 if clamped else count + degree + 1))
        return np.concatenate([[0.0] * (degree + 1), inner, [1.0] * (degree + 1)]) if clamped else inner

    Pw = np.concatenate([RNG.normal(size=(n, m, 3)), RNG.uniform(0.5, 1, (n, m, 1))], axis=2)
    surface = NurbsSurface(p, q, knots(p, n), knots(q, m), Pw)
    a, b = RNG.random(200), RNG.random(200)
    for box in ((0.2, 0.9, 0.1, 0.35), (0.0, 0.5, 0.5, 1.0), (0.0, 1.0, 0.0, 1.0)):
        part = cropped(surface, *box)
        expected = point(surface, box[0] + a * (box[1] - box[0]), box[2] + b * (box[3] - box[2]))
        assert np.abs(point(part, a, b) - expected).max() < 1e-10 * np.abs(Pw).max()


def test_a_box_may_cross_the_seam_of_a_cylinder():
    surface = cylinder()
    a, b = RNG.random(200), RNG.random(200)
    for u0, u1 in ((0.9, 1.15), (0.3, 1.3), (1.2, 1.4)):
        part = cropped(surface, u0, u1, 0.25, 0.5)
        S = point(part, a, b)
        assert np.abs(np.hypot(S[:, 0], S[:, 1]) - 1).max() < 1e-12
        u = u0 + a * (u1 - u0)
        assert np.abs(S - point(surface, u - np.floor(u), 0.25 + b / 4)).max() < 1e-12


def test_a_seam_that_does_not_meet_is_refused():
    open_sheet = from_points(1, 1, [0, 0, 1, 1], [0, 0, 1, 1], [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]])
    with pytest.raises(ValueError, match="does not run on over its seam in u"):
        cropped(open_sheet, 0.5, 1.5, 0, 1)
