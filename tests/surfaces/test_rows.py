"""Equal rows: numbered by first appearance, looked up, whatever their hashes do."""

import numpy as np
import pytest

from lib.surfaces import rows

ROWS = np.array([[1.0, 2.0], [2.0, 1.0], [1.0, 2.0], [0.0, 3.0], [-0.0, 3.0], [2.0, 1.0], [1.0, 1.0]])


@pytest.fixture
def full(monkeypatch):
    """Tables of four places for three or four rows: most are not where their hash says."""
    whole = np.full
    monkeypatch.setattr(rows.np, "full", lambda n, x: whole(min(n, 4), x))


@pytest.mark.parametrize("collide", [False, True])
def test_rows_are_numbered_as_they_first_stand(collide, request):
    if collide:
        request.getfixturevalue("full")
    number, first = rows.numbered(ROWS)
    assert number.tolist() == [0, 1, 0, 2, 2, 1, 3] and first.tolist() == [0, 1, 3, 6]


def test_many_rows_against_numpy():
    given = np.random.default_rng(3).integers(0, 12, (5000, 4)) / 7
    number, first = rows.numbered(given)
    assert np.array_equal(given[first][number], given)
    assert len(first) == len(np.unique(given, axis=0)) and (np.diff(first) > 0).all()


def test_rows_are_found_among_others(request):
    some = rows.Rows(ROWS[:4])
    asked = np.array([[2.0, 1.0], [-0.0, 3.0], [1.0, 1.0], [np.nan, 1.0]])
    assert some.holds(asked).tolist() == [True, True, False, False]
    assert some.holds(asked[:0]).tolist() == [] and rows.Rows(ROWS[:0]).holds(asked).tolist() == [False] * 4
    request.getfixturevalue("full")
    assert not rows.Rows(ROWS[:4]).holds(asked[2:]).any()  # never a row that is not there
