"""Beside a bar in a room eight times as long as it is wide, direct light is as at a contact edge of a short one."""

import numpy as np
import pytest

from benchmarks.hard_cases import contacts
from benchmarks.hard_cases.bench import Bench, worst


@pytest.mark.parametrize("texels, asked", contacts.AWAY.items())
def test_direct_light_beside_a_small_thing_in_a_long_room(long_room, texels, asked):
    once, lamp = long_room
    y = np.linspace(*contacts.MIDDLE, contacts.PLACES)
    segment, begin, direction = contacts.EDGES["floor left of the bar"]
    H, s = contacts.read(once[segment], begin, direction * texels, y)
    truth = contacts.direct("floor left of the bar", *contacts.beside(segment, s, contacts.LONG, y), lamp)
    assert worst(H.mean(), truth.mean()) < asked


@pytest.fixture(scope="module")
def long_room(tmp_path_factory):
    """(maps of direct light, lamp)."""
    surfaces, traced = contacts.room(contacts.LONG)
    rho = {name: 0.0 if name == "lamp" or "role" in facts else contacts.RHO for name, (_, facts) in surfaces.items()}
    bench = Bench(tmp_path_factory.mktemp("long"), is_cheap=True)
    return bench.maps(surfaces, rho, contacts.CHEAP, bounces=1), traced.lamp
