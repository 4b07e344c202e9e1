"""Trimmed faces of Rhino files: counts of real files, areas in closed form, borders shared bit for bit."""

from pathlib import Path

import numpy as np
import pytest
import rhino3dm

from lib.formats import threedm_faces
from lib.nurbs.evaluate import frame, point
from lib.nurbs.surface import NurbsSurface
from lib.surfaces.loops import signed_area
from lib.surfaces.measure import area, collapsed_sides
from lib.surfaces.trimmed import TrimmedSurface
from tests.formats.reading import read, refused

DATA = Path(__file__).parents[1] / "data"
TOLERANCE = 0.01  # mm within which the edges of these files lie on their surfaces


def loops(surface):
    return [surface.uv[a:b] for a, b in zip(surface.loop_start, surface.loop_start[1:], strict=False)]


def written(path, *things):
    model = rhino3dm.File3dm()
    layer = rhino3dm.Layer()
    layer.Name = "Default"
    model.Layers.Add(layer)
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Millimeters
    for thing in things:
        model.Objects.Add(thing)
    model.Write(str(path), 7)
    return path


@pytest.mark.parametrize(
    "file, total, trimmed, holed, bodies_whole",
    [("v5_extrusions.3dm", 48, 8, 6, 10), ("v3_MatchSrf.3dm", 14, 9, 1, 1), ("v3_HumanHead2.3dm", 10, 0, 0, 10)],
)
def test_every_face_of_real_files_is_read(file, total, trimmed, holed, bodies_whole):
    content = read(DATA / file)
    assert len(content.patches) == content.total == total
    assert len(read(DATA / file, trimmed="skip").trimmed) == trimmed
    kinds = [type(patch.surface) for patch in content.patches]
    assert kinds.count(NurbsSurface) == bodies_whole  # faces of bodies without any trimmed face
    made = [patch.surface for patch in content.patches if isinstance(patch.surface, TrimmedSurface)]
    assert sum(len(surface.loop_start) > 2 for surface in made) == holed
    for surface in made:
        outer, *inner = loops(surface)
        assert signed_area(outer) > 0 and all(signed_area(hole) < 0 for hole in inner)
        assert surface.uv.min() == 0.0 and surface.uv.max() == 1.0
        assert np.linalg.norm(point(surface.base, *surface.uv.T) - surface.S, axis=1).max() < TOLERANCE


def test_the_bird_has_poles_and_closed_bodies():
    patches = read(DATA / "v3_MatchSrf.3dm").patches
    rational = [p for p in patches if np.ptp(getattr(p.surface, "base", p.surface).w) > 0]
    assert len(rational) == 4
    assert sum(collapsed_sides(p.surface).any() for p in patches) == 5  # of 7, two of them cut away
    assert {p.labels[0] for p in patches} == {"08 finished model"}


def test_neighbours_share_their_border_points_bit_for_bit():
    """Each border point but poles and open edges is held by two faces, or twice by one along a seam."""
    bodies = {}
    for patch in read(DATA / "v5_extrusions.3dm").patches:
        if isinstance(patch.surface, TrimmedSurface) and patch.solid:
            bodies.setdefault(patch.material, []).append(patch.surface)
    for surfaces in bodies.values():
        inner = np.concatenate([s.S[np.isfinite(s.significance)] for s in surfaces])
        value = np.concatenate([s.significance[np.isfinite(s.significance)] for s in surfaces])
        _, count = np.unique(np.column_stack([inner, value]), axis=0, return_counts=True)
        assert (count % 2 == 0).all() and len(count) > 100


def ring(radius, x=0.0, y=0.0):
    return rhino3dm.NurbsCurve.CreateFromCircle(rhino3dm.Circle(rhino3dm.Point3d(x, y, 0), radius))


def pipe(height=3.0, y=1.5):
    """A thick pipe as an extrusion: outer radius 2, a round hole of radius 1 off the middle.

    Inner profiles count from the start of the outer one, turned by 90 degrees: y = 2 is the middle.
    """
    body = rhino3dm.Extrusion.Create(ring(2.0), height, True)
    assert body.AddInnerProfile(ring(1.0, y=y))
    return body


def test_a_pipe_has_the_areas_of_a_pipe(tmp_path):
    patches = read(written(tmp_path / "a.3dm", pipe())).patches
    assert all(patch.solid for patch in patches)
    areas = sorted(area(patch.surface) for patch in patches)
    caps, walls = [3 * np.pi] * 2, [2 * np.pi * 3, 4 * np.pi * 3]
    assert areas == pytest.approx(sorted(caps + walls), rel=1e-4)  # edges are polylines within 1e-5 of their size
    lit = []  # of the two caps: outwards both
    for patch in patches:
        if area(patch.surface) == pytest.approx(3 * np.pi, rel=1e-4):
            S, N = frame(patch.surface.base, np.array([0.5]), np.array([0.5]))
            lit.append(N[0, 2] * (-1 if patch.flip else 1) * np.sign(S[0, 2] - 1.5))
    assert lit == [1.0, 1.0]


def test_a_sphere_next_to_nothing_stays_whole(tmp_path):
    ball = rhino3dm.Brep.CreateFromSphere(rhino3dm.Sphere(rhino3dm.Point3d(0, 0, 0), 2.0))
    [patch] = read(written(tmp_path / "a.3dm", ball)).patches
    assert isinstance(patch.surface, NurbsSurface) and patch.solid


def test_a_trimmed_disc_is_cropped_to_it(tmp_path):
    disc = rhino3dm.Brep.CreateTrimmedPlane(rhino3dm.Plane.WorldXY(), ring(2.0))
    [patch] = read(written(tmp_path / "a.3dm", disc)).patches
    assert area(patch.surface) == pytest.approx(4 * np.pi, rel=1e-4)
    [outer] = loops(patch.surface)
    assert outer.min() == 0.0 and outer.max() == 1.0
    assert np.abs(np.linalg.norm(patch.surface.S[:, :2], axis=1) - 2).max() < 1e-9


def test_a_face_that_does_not_close_is_named(tmp_path, monkeypatch):
    invert = threedm_faces._Face._invert

    def broken(face):
        invert(face)
        for trim in face.trims[1] if len(face.trims) > 1 else []:
            trim.uv = trim.uv[: len(trim.uv) // 2]

    monkeypatch.setattr(threedm_faces._Face, "_invert", broken)
    message = refused(written(tmp_path / "a.3dm", pipe()))
    assert len(message.splitlines()) == 2
    assert message.startswith(
        "a.3dm: surface part/3: loop 2: does not close in u, v: edge 1 to edge 1 leaves a gap of 2"
    )
    assert message.endswith("(on layer Default; `trimmed: skip` leaves trimmed faces out)")


def test_an_edge_off_its_face_is_named(tmp_path):
    message = refused(written(tmp_path / "a.3dm", pipe(y=0.0)))  # half outside the caps
    assert "a.3dm: surface part/3: loop 2: edge 3 leaves the surface by 0.5 (on layer Default" in message
    content = read(tmp_path / "a.3dm", trimmed="skip")
    assert content.trimmed == [3, 4] and len(content.patches) == 2
