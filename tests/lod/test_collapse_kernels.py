"""Compiled sums: by hand."""

import numpy as np

from lib.lod import collapse_kernels as kernels


def test_rows_are_added_to_those_of_their_numbers():
    out = np.zeros((3, 2))
    kernels.sum_rows(np.array([2, 0, 2]), np.array([[1.0, 2], [3, 4], [5, 6]]), out)
    assert out.tolist() == [[3, 4], [0, 0], [6, 8]]


def test_rows_of_triangles_are_added_at_each_corner():
    out = np.zeros((4, 1))
    kernels.sum_at_corners(np.array([[0, 1, 2], [2, 1, 3]], dtype=np.int32), np.array([[1.0], [10.0]]), out)
    assert out.ravel().tolist() == [1, 11, 11, 10]
