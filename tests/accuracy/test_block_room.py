"""The path tracer that contact edges are measured against, on rooms whose light is known."""

import numpy as np

from benchmarks.hard_cases.bench import parallel_rectangle
from benchmarks.hard_cases.block_room import BlockRoom
from tests.tolerances import STANDARD_ERRORS

SIZE = np.array([2.0, 3.0, 1.5])
BLOCK = np.array([[0.5, 0.7, 0.0], [1.1, 1.5, 0.6]])
LAMP = np.array([[1.2, 1.6], [1.21, 1.61]])  # so small that it absorbs nothing


def on_boxes(rng, n):
    """n points (n, 3), even over the walls of the room and the sides of the block but its bottom, and normals."""
    sides = []
    for low, high, inwards in ((np.zeros(3), SIZE, 1.0), (*BLOCK, -1.0)):
        for axis in range(3):
            for end in (0, 1):
                size = np.delete(high - low, axis)
                if inwards > 0 or axis < 2 or end:
                    sides.append((low, high, axis, end, inwards, size.prod()))
    area = np.array([side[-1] for side in sides])
    # The floor below the block is no part of the room.
    floor = next(k for k, side in enumerate(sides) if side[2:5] == (2, 0, 1.0))
    which = rng.choice(len(sides), size=n, p=area / area.sum())
    x, N = np.empty((n, 3)), np.zeros((n, 3))
    for k, (low, high, axis, end, inwards, _) in enumerate(sides):
        mine = np.flatnonzero(which == k)
        x[mine] = low + rng.random((len(mine), 3)) * (high - low)
        x[mine, axis] = (low, high)[end][axis]
        N[mine, axis] = inwards * (1 - 2 * end)
    below = (which == floor) & ((x > BLOCK[0] - 1e-12) & (x < BLOCK[1])).all(axis=1)
    return x[~below], N[~below], area.sum() - (BLOCK[1] - BLOCK[0])[:2].prod()


def test_what_a_lamp_sends_is_absorbed():
    room, rng = BlockRoom(SIZE, BLOCK, LAMP, 1.4, 0.5), np.random.default_rng(1)
    x, N, area = on_boxes(rng, 60000)
    H = room.direct(x, N, rng) + room.bounced(x, N, rng)
    truth = np.prod(LAMP[1] - LAMP[0]) / (area * (1 - room.rho))
    assert abs(H.mean() - truth) < STANDARD_ERRORS * H.std() / np.sqrt(len(H))
    assert H.std() / np.sqrt(len(H)) < 0.02 * truth


def test_direct_light_of_the_open_floor_is_the_closed_form_and_the_block_hides_it():
    lamp = np.array([[1.2, 1.6], [1.9, 2.4]])
    room, rng = BlockRoom(SIZE, BLOCK, lamp, 1.0, 0.5), np.random.default_rng(1)
    up, n = np.array([[0.0, 0, 1]]), 20000
    found = room.direct(np.tile([1.5, 2.5, 0.0], (n, 1)), np.tile(up, (n, 1)), rng)
    truth = parallel_rectangle(np.array([1.5, 2.5]), *lamp, 1.0)
    assert abs(found.mean() - truth) < STANDARD_ERRORS * found.std() / np.sqrt(n)
    behind = room.direct(np.tile([0.4, 0.6, 0.0], (n, 1)), np.tile(up, (n, 1)), rng)
    assert behind.max() == 0
