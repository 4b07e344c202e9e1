"""Triangles cut along a quadtree: nothing lost, nothing moved, nothing turned over."""

import numpy as np
import pytest

from lib.surfaces import boxes
from tests.tolerances import EXACT

QUARTERS = np.array([[0, 0.5, 0, 0.5], [0.5, 1, 0, 0.5], [0, 0.5, 0.5, 1], [0.5, 1, 0.5, 1.0]])


def area(V, F):
    """Signed, of triangles in the plane z = 0."""
    a, b, c = (V[F[:, k]] for k in range(3))
    return np.cross(b - a, c - a)[:, 2] / 2


def flat(UV):
    """Points (n, 3) at twice their (u, v)."""
    return np.column_stack([2 * UV, np.zeros(len(UV))])


def test_a_square_of_two_triangles_in_quarters():
    UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    parts = boxes.cut(flat(UV), UV, np.array([[0, 1, 2], [0, 2, 3]]), QUARTERS)
    for (V, F), (u0, u1, v0, v1) in zip(parts, QUARTERS, strict=True):
        assert area(V, F).sum() == pytest.approx(1.0, rel=EXACT) and (area(V, F) >= 0).all()
        low, high = V[F].reshape(-1, 3).min(axis=0), V[F].reshape(-1, 3).max(axis=0)
        assert low[:2].tolist() == [2 * u0, 2 * v0] and high[:2].tolist() == [2 * u1, 2 * v1]


def test_random_triangles_of_uneven_leaves_keep_place_area_and_winding():
    rng = np.random.default_rng(1)
    UV, F = rng.random((300, 2)), np.arange(300).reshape(-1, 3)
    eighth = np.array([[0.5, 0.75, 0, 0.25], [0.75, 1, 0, 0.25], [0.5, 0.75, 0.25, 0.5], [0.75, 1, 0.25, 0.5]])
    leaves = np.concatenate([QUARTERS[[0, 2, 3]], eighth])
    parts = boxes.cut(flat(UV), UV, F, leaves)
    whole = area(flat(UV), F)
    for sign in (-1, 1):
        found = sum(np.where(sign * a > 0, a, 0).sum() for a in (area(*part) for part in parts))
        assert found == pytest.approx(np.where(sign * whole > 0, whole, 0).sum(), rel=1e-9)
    for (V, _), (u0, u1, v0, v1) in zip(parts, leaves, strict=True):
        inside = V[:, :2] / 2
        assert (inside >= np.array([u0, v0]) - EXACT).all() and (inside <= np.array([u1, v1]) + EXACT).all()


def test_no_triangles_and_one_leaf():
    empty = boxes.cut(np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 3), int), QUARTERS)
    assert [len(F) for _, F in empty] == [0] * 4
    UV = np.array([[0, 0], [1, 0], [1, 1.0]])
    ((V, F),) = boxes.cut(flat(UV), UV, np.array([[0, 1, 2]]), np.array([[0, 1, 0, 1.0]]))
    assert (V[F][0] == flat(UV)).all()
