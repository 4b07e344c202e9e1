"""Packed maps: views, sizes, order."""

import numpy as np
import pytest

from lib.maps import mapset


def two_maps():
    first = np.arange(3 * 5 * 3, dtype=np.float32).reshape(3, 5, 3)
    second = -np.arange(2 * 2 * 3, dtype=np.float32).reshape(2, 2, 3)
    hidden = np.zeros((3, 5), bool)
    hidden[2, 4] = True
    packed = mapset.pack([4, 7], [[2, 1], [1, 1]], [1, 0], [first, second], [hidden, np.zeros((2, 2), bool)])
    return packed, first, second, hidden


def test_sides_are_roots_times_two_to_the_level_plus_one():
    packed, *_ = two_maps()
    w, h = packed.sizes()
    assert w.tolist() == [5, 2] and h.tolist() == [3, 2]
    assert packed.offsets().tolist() == [0, 15, 19]
    assert mapset.side_lengths([3, 1], 4) == (49, 17)


def test_a_packed_map_comes_back_as_a_view():
    packed, first, second, hidden = two_maps()
    assert np.array_equal(packed.map(0), first) and np.array_equal(packed.map(1), second)
    assert np.array_equal(packed.hidden_map(0), hidden)
    assert np.shares_memory(packed.map(1), packed.value)
    assert packed.position(7) == 1 and packed.position(5) == -1 and packed.position(9) == -1


def test_light_groups_keep_their_axis():
    grouped = mapset.pack([0], [[1, 1]], [0], [np.zeros((2, 2, 4, 3))])
    assert grouped.value.shape == (4, 4, 3) and grouped.map(0).shape == (2, 2, 4, 3)


def test_merge_orders_by_surface_whatever_the_chunks():
    packed, first, second, _ = two_maps()
    other = mapset.pack([5], [[1, 1]], [0], [np.full((2, 2, 3), 9.0)])
    one, two = mapset.merge([packed, other]), mapset.merge([other, packed])
    assert one.surface.tolist() == two.surface.tolist() == [4, 5, 7]
    assert np.array_equal(one.value, two.value) and np.array_equal(one.map(2), second)
    with pytest.raises(ValueError, match="surface"):
        mapset.merge([packed, packed])


def test_no_surface_at_all():
    empty = mapset.pack([], [], [], [], channels=(2, 3))
    assert len(empty) == 0 and empty.value.shape == (0, 2, 3) and mapset.merge([empty]).offsets().tolist() == [0]


@pytest.mark.parametrize(
    "field, value, message",
    [
        ("value", np.zeros((19, 3)), "value"),
        ("value", np.zeros((18, 3), np.float32), "value"),
        ("value", np.full((19, 3), np.nan, np.float32), "not finite .surface 4"),
        ("hidden", np.zeros(19), "hidden"),
        ("surface", np.array([7, 4], np.int32), "ascending"),
        ("level", np.array([1, -1], np.int32), "level"),
    ],
)
def test_check_names_the_broken_field(field, value, message):
    packed, *_ = two_maps()
    fields = {name: getattr(packed, name) for name in ("surface", "roots", "level", "value", "hidden")}
    with pytest.raises(ValueError, match=message):
        mapset.MapSet(**{**fields, field: value}).check()


def test_pack_refuses_a_map_of_another_size():
    with pytest.raises(ValueError, match="map 0: expected 3 x 3"):
        mapset.pack([0], [[1, 1]], [1], [np.zeros((3, 4, 3))])
