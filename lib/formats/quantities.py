"""Lengths with units and sizes in bytes, as scene.yaml writes them."""

import re

METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
_BYTES = {"B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30}
_WITH_UNIT = re.compile(r"([0-9.]+(?:[eE][-+]?[0-9]+)?) *([A-Za-z%]+)")


def metres(length, scene_unit, largest_side):
    """A length in metres.

    length : number in the scene's unit, or text like `0.5 mm`, or `0.01 %` of the scene's largest side
    scene_unit : key of METRES;  largest_side : of the scene's bounding box [m]

    >>> metres(2, "cm", 5.0), metres("1 mm", "cm", 5.0), metres("50 %", "cm", 5.0)
    (0.02, 0.001, 2.5)
    """
    if not isinstance(length, str):
        return float(length) * METRES[scene_unit]
    number, unit = _WITH_UNIT.fullmatch(length).groups()
    return float(number) * (largest_side / 100 if unit == "%" else METRES[unit])


def n_bytes(size):
    """A size in bytes, int: a whole number, or text like `64 MiB`.

    >>> n_bytes(1000), n_bytes("64 MiB"), n_bytes("1.5kB")
    (1000, 67108864, 1500)
    """
    if not isinstance(size, str):
        return int(size)
    number, unit = _WITH_UNIT.fullmatch(size).groups()
    return int(float(number) * _BYTES[unit])
