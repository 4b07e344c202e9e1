"""Placements as 4 x 4 matrices."""

import numpy as np


def matrix(place):
    """The affine matrix (4, 4) of one placement: scale, then rotations in their order, then translation.

    place : {scale: number or [x, y, z], rotate: {axis, degrees} or a list of them, translate: [x, y, z]}, all optional.
    Raises ValueError (`FIELD: what`) for an axis without direction.

    >>> matrix({"scale": 2, "rotate": {"axis": [0, 0, 1], "degrees": 90}, "translate": [5, 0, 0]}) @ [1, 0, 0, 1]
    array([5., 2., 0., 1.])
    """
    M = np.diag([*np.broadcast_to(np.asarray(place.get("scale", 1.0), dtype=np.float64), 3), 1.0])
    rotations = place.get("rotate", [])
    for turn in rotations if isinstance(rotations, list) else [rotations]:
        R = np.eye(4)
        R[:3, :3] = rotation(turn["axis"], turn["degrees"])
        M = R @ M
    M[:3, 3] += np.asarray(place.get("translate", [0.0, 0.0, 0.0]), dtype=np.float64)
    return M


def rotation(axis, degrees):
    """Rotation (3, 3) about an axis through the origin (Rodrigues' formula); exact for quarter turns about x, y, z."""
    axis = np.asarray(axis, dtype=np.float64)
    largest = np.abs(axis).max()
    if not largest > 0:
        raise ValueError("place.rotate.axis: [0, 0, 0] has no direction")
    axis = axis / largest
    x, y, z = axis / np.linalg.norm(axis)
    quarter = np.fmod(degrees, 360.0) / 90.0
    if quarter == round(quarter):  # cos(pi/2) is 6e-17 in floating point: walls of a turned box would not close
        cos, sin = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][int(round(quarter)) % 4]
    else:
        cos, sin = np.cos(quarter * np.pi / 2), np.sin(quarter * np.pi / 2)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + sin * K + (1.0 - cos) * (K @ K)
