"""What elements read of the base lattice: bilinear, by visible corners alone."""

import numpy as np

from lib.radiosity.sampling import _bilinear
from tests.tolerances import EXACT


def test_linear_light_is_read_exactly():
    v, u = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 9), indexing="ij")
    value = np.stack([1 + 2 * u - 3 * v, u * v], axis=-1)
    at_u, at_v = np.array([0, 0.3, 0.99, 1]), np.array([0, 0.41, 1])
    found = _bilinear(value, np.zeros((5, 9), bool), at_u, at_v)
    expected = np.stack([1 + 2 * at_u[None] - 3 * at_v[:, None], at_u[None] * at_v[:, None]], axis=-1)
    assert found.shape == (3, 4, 2) and np.abs(found - expected).max() < EXACT


def test_hidden_corners_take_no_part():
    """A line of buried samples between a lit half and a dark one: each side reads its own."""
    value = np.ones((2, 5, 1))
    value[:, 3:] = 0
    value[:, 2] = 1e9
    hidden = np.zeros((2, 5), dtype=bool)
    hidden[:, 2] = True
    u = np.array([0.3, 0.49, 0.51, 0.7])
    assert _bilinear(value, hidden, u, np.array([0.5]))[0, :, 0].tolist() == [1, 1, 0, 0]
    assert not _bilinear(value, np.ones((2, 5), bool), u, np.array([0.5])).any()
