"""Geometry files as the tests of their readers read them: as the entry `part` of a scene."""

import pytest

from lib.formats import geometry_file
from lib.refusal import Refusal


def read(path, **options):
    """The GeometryFile of the file at `path`."""
    return geometry_file.read(path, path.name, "part", **options)


def refused(path, **options):
    """What the file is refused with."""
    with pytest.raises(Refusal) as caught:
        read(path, **options)
    return str(caught.value)
