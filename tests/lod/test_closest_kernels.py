"""Closest places on a triangle, by hand."""

import numpy as np
import pytest

from lib.lod.closest_kernels import closest_weights
from tests.tolerances import EXACT

TRIANGLE = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]])


@pytest.mark.parametrize(
    ("point", "weight"),
    [
        ([0.5, 0.5, 3.0], [0.5, 0.25, 0.25]),
        ([-1.0, -1.0, 1.0], [1, 0, 0]),
        ([1.0, -1.0, 0.0], [0.5, 0.5, 0]),
        ([-1.0, 1.0, 0.0], [0.5, 0, 0.5]),
        ([3.0, 3.0, 0.0], [0, 0.5, 0.5]),
        ([3.0, 2.0, 0.0], [0, 0.75, 0.25]),
        ([5.0, -1.0, 0.0], [0, 1, 0]),
    ],
)
def test_of_one_triangle(point, weight):
    found = np.empty((1, 3))
    closest_weights(TRIANGLE[None], np.array([point]), found)
    assert np.allclose(found[0], weight, atol=EXACT)
