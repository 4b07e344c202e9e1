"""The scenes of other people's models: a conference room as a mesh, parts out of STEP files."""

from importlib.util import find_spec

import numpy as np
import pytest

from lib.formats import geometry_file
from lib.nurbs.evaluate import frame
from lib.surfaces import measure
from tests.scene_measures import FLOAT, SCENES, SINK, load, lowest, points, surface, surfaces

needs_ocp = pytest.mark.skipif(find_spec("OCP") is None, reason="needs the extra `step`")


# The conference room


def test_the_conference_room_has_all_its_triangles():
    file = SCENES / "conference" / "conference.glb"
    content = geometry_file.read(file, file.name, "room")
    assert len(content.patches) == len(content.materials) == 35 and not content.notes
    assert sum(len(patch.surface.F) for patch in content.patches) == 331179
    assert sum(measure.area(patch.surface) for patch in content.patches) == pytest.approx(2.37e7, rel=2e-3)


def test_the_lamps_hang_under_the_ceiling_and_shine_down():
    _, scene = load("conference")
    ceiling = next(
        s
        for s in scene.surfaces
        if isinstance(s, measure.Mesh) and len(s.F) == 2 and np.ptp(s.V[:, 1]) < 1e-9 and s.V[0, 1] > 1
    )
    panels = surfaces("conference", r"panel\.\d")
    assert len(panels) == 6
    for s, flip in panels:
        S, N = frame(s, [0.5], [0.5])
        assert N[0] @ [0, -1, 0] == pytest.approx(1) and not flip
        assert 0 < ceiling.V[0, 1] - S[0, 1] < 0.01
        low, high = ceiling.V.min(axis=0), ceiling.V.max(axis=0)
        assert ((points(s, 2) > low)[:, [0, 2]] & (points(s, 2) < high)[:, [0, 2]]).all()


# The parts out of STEP files


@needs_ocp
def test_parts_stand_on_the_cabinet():
    top = points(surface("cad_part", "top"), 2)[:, 2].max()
    for pattern, count in ((r"part/\d+", 120), (r"blocks/\d", 9)):
        parts = [s for s, _ in surfaces("cad_part", pattern)]
        assert len(parts) == count
        assert -SINK < lowest(*parts) - top < FLOAT
        S = np.concatenate([points(s) for s in parts])
        assert (S[:, :2] > [0.57, 0.97]).all() and (S[:, :2] < [1.83, 1.73]).all()


@needs_ocp
def test_blocks_keep_the_colours_of_their_faces():
    settings, scene = load("cad_part")
    names = [m for n, m in zip(scene.names, scene.material, strict=True) if n.startswith("blocks/")]
    red, blue = (settings["materials"][name]["reflectance"] for name in (names[-1], names[0]))
    assert len(set(names)) == 2 and red[0] > 3 * red[2] and blue[2] > 3 * blue[0]
