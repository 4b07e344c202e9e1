"""Filling hidden texels: pictures small enough to see."""

import numpy as np

from lib.maps.fill import one_deep, push_pull


def drawn(text):
    """'1 . 3 / 2 . .' to (value (h, w, 3), hidden (h, w)): dots are hidden and hold rubbish."""
    rows = [row.split() for row in text.split("/")]
    hidden = np.array([[cell == "." for cell in row] for row in rows])
    value = np.array([[777.0 if cell == "." else float(cell) for cell in row] for row in rows], np.float32)
    return np.repeat(value[..., None], 3, axis=2), hidden


def test_one_deep_takes_the_mean_of_visible_neighbours_and_zero_beyond():
    value, hidden = drawn("1 . . . / 3 . . . / 2 . . .")
    assert one_deep(value, hidden)[..., 0].tolist() == [[1, 2, 0, 0], [3, 2, 0, 0], [2, 2.5, 0, 0]]


def test_one_deep_goes_round_a_closed_direction():
    value, hidden = drawn(". . . 4 . . / . . . 4 . .")  # the last column is the first again
    open_map, closed_map = one_deep(value, hidden), one_deep(value, hidden, (True, False))
    assert open_map[0, :, 0].tolist() == closed_map[0, :, 0].tolist() == [0, 0, 4, 4, 4, 0]
    value, hidden = drawn("9 4 . . . 9 / 9 4 . . . 9")
    assert one_deep(value, hidden, (True, False))[0, :, 0].tolist() == [9, 4, 4, 0, 9, 9]
    value, hidden = drawn(". 4 . . . . / . 4 . . . .")
    assert one_deep(value, hidden, (True, False))[0, :, 0].tolist() == [4, 4, 4, 0, 0, 4]


def test_a_buried_pole_is_filled_with_one_value():
    value, hidden = drawn("1 3 5 / . . . / . . .")
    below, above = (False, False, False, True), (False, False, True, False)
    assert one_deep(value, hidden, collapsed=below)[1:, :, 0].tolist() == [[2, 3, 4], [0, 0, 0]]
    assert one_deep(value[:2], hidden[:2], collapsed=below)[1, :, 0].tolist() == [3, 3, 3]
    assert one_deep(value[:2], hidden[:2], collapsed=above)[:, :, 0].tolist() == [[1, 3, 5], [2, 3, 4]]


def test_push_pull_keeps_visible_bits_and_fills_within_their_range():
    rng = np.random.default_rng(3)
    value = rng.random((33, 17, 3)).astype(np.float32)
    hidden = rng.random((33, 17)) < 0.8
    value[hidden] = np.nan
    filled = push_pull(value, hidden)
    assert np.array_equal(filled[~hidden], value[~hidden])
    assert filled.min() >= np.nanmin(value) and filled.max() <= np.nanmax(value)


def test_push_pull_spreads_a_single_texel_everywhere():
    for shape in [(1, 1), (2, 2), (5, 3), (9, 33)]:
        value, hidden = np.zeros((*shape, 3), np.float32), np.ones(shape, bool)
        value[-1, 0], hidden[-1, 0] = 0.3, False
        assert np.allclose(push_pull(value, hidden), 0.3)


def test_nothing_visible_or_nothing_hidden():
    value, _ = drawn("1 2 / 3 4")
    assert np.array_equal(push_pull(value, np.zeros((2, 2), bool)), value)
    assert not push_pull(value, np.ones((2, 2), bool)).any()
    assert not one_deep(value, np.ones((2, 2), bool)).any()
    assert np.array_equal(one_deep(value, np.zeros((2, 2), bool)), value)


def test_what_lies_between_visible_texels_is_filled_bilinearly():
    """Half the size holds 0 and 3 at the middles of two texels each: a quarter and three quarters of the way."""
    for text in ("0 . . 3", "0 / . / . / 3"):
        value, hidden = drawn(text)
        assert push_pull(value, hidden)[..., 0].ravel().tolist() == [0, 0.75, 2.25, 3]
    value, hidden = drawn("0 . . 4 / . . . . / . . . . / 8 . . 12")
    assert push_pull(value, hidden)[1:3, 1:3, 0].tolist() == [[3, 5], [7, 9]]
