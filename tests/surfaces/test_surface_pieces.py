"""Pieces of graphs: by hand, against scipy on random ones, and long chains in the worst order."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lib.surfaces.pieces import pieces


def test_nodes_without_edges_stand_alone():
    assert pieces(3, [], []).tolist() == [0, 1, 2]
    assert pieces(0, [], []).tolist() == []


def test_pieces_are_numbered_by_their_first_nodes():
    assert pieces(7, [5, 6, 2], [1, 5, 4]).tolist() == [0, 1, 2, 3, 2, 1, 1]


def test_loops_and_repeated_edges_change_nothing():
    assert pieces(3, [1, 0, 2, 0], [1, 2, 0, 2]).tolist() == [0, 1, 0]


@pytest.mark.parametrize("share", [0.2, 0.5, 1.0, 3.0])
def test_random_graphs_fall_apart_as_scipy_says(share):
    rng = np.random.default_rng(int(10 * share))
    n, m = 2000, int(2000 * share)
    a, b = rng.integers(0, n, (2, m))
    count, label = connected_components(coo_array((np.ones(m), (a, b)), shape=(n, n)), directed=False)
    mine = pieces(n, a, b)
    assert mine.max() + 1 == count
    assert len(np.unique(np.stack([label, mine]), axis=1).T) == count


@pytest.mark.parametrize("seed", [None, 4])
def test_a_chain_is_one_piece_in_whatever_order_its_links_come(seed):
    n = 5000
    order = np.arange(n) if seed is None else np.random.default_rng(seed).permutation(n)
    assert (pieces(n, order[:-1], order[1:]) == 0).all()
    assert pieces(n, order[1:-1], order[2:]).max() == 1
