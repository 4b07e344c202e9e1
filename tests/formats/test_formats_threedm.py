"""Rhino files: units, layers, reversed, closed and periodic faces, trims; against the own evaluation of rhino3dm."""

from pathlib import Path

import numpy as np
import pytest
import rhino3dm

from lib import forks
from lib.nurbs.evaluate import evaluate, frame, point
from lib.nurbs.shape import collapsed_sides, is_closed
from lib.surfaces.trimmed import TrimmedSurface
from tests.formats.reading import read, refused

DATA = Path(__file__).parents[1] / "data"
UV = np.linspace(0.0, 1.0, 13)


def compare(surface, original):
    """Points of a surface against rhino3dm's over the whole domain, relative to the size."""
    u, v = (a.ravel() for a in np.meshgrid(UV, UV))
    domain_u, domain_v = original.Domain(0), original.Domain(1)
    expected = []
    for a, b in zip(u, v, strict=True):
        p = original.PointAt(
            domain_u.T0 + a * (domain_u.T1 - domain_u.T0), domain_v.T0 + b * (domain_v.T1 - domain_v.T0)
        )
        expected.append((p.X, p.Y, p.Z))
    S = point(surface, u, v)
    return np.abs(S - expected).max() / np.ptp(S, axis=0).max()


@pytest.mark.parametrize("file", ["v3_Speeder.3dm", "v3_HumanHead2.3dm", "v7_my_surfaces.3dm"])
def test_points_are_those_of_rhino(file):
    originals = []
    for item in rhino3dm.File3dm.Read(str(DATA / file)).Objects:
        geometry = item.Geometry
        if isinstance(geometry, rhino3dm.Brep):
            originals += [geometry.Faces[i].UnderlyingSurface() for i in range(len(geometry.Faces))]
        elif isinstance(geometry, rhino3dm.Surface):
            originals.append(geometry)
    patches = read(DATA / file).patches
    assert len(patches) == len(originals)
    assert max(compare(patch.surface, o) for patch, o in zip(patches, originals, strict=True)) < 1e-12


def test_speeder_is_two_mirrored_halves_one_of_them_reversed():
    content = read(DATA / "v3_Speeder.3dm")
    assert content.metres == 0.001
    assert [patch.flip for patch in content.patches].count(True) == 1
    assert content.notes == ["skipped: 15 curves, 8 text dots"]
    sides = []
    for patch in content.patches:
        assert collapsed_sides(patch.surface).sum() == 1
        S, N = frame(patch.surface, np.array([0.5]), np.array([0.5]))
        sides.append(N[0] * (-1 if patch.flip else 1))
    mirror = np.argmax(np.abs(np.ptp([patch.surface.P.mean(axis=(0, 1)) for patch in content.patches], axis=0)))
    sides[1][mirror] *= -1
    assert sides[0] == pytest.approx(sides[1], abs=1e-9)  # both lit sides look the same way, mirrored


def test_heads_are_closed_and_periodic_with_a_smooth_seam():
    content = read(DATA / "v3_HumanHead2.3dm")
    assert len(content.patches) == 10
    for patch in content.patches:
        assert is_closed(patch.surface) == (True, False)
        assert collapsed_sides(patch.surface).tolist() == [False, False, True, True]
        v = np.linspace(0.2, 0.8, 7)
        first, last = (evaluate(patch.surface, np.full(7, u), v) for u in (0.0, 1.0))
        size = np.ptp(patch.surface.P.reshape(-1, 3), axis=0).max()
        assert np.abs(first[0] - last[0]).max() < 1e-12 * size
        assert np.abs(first[1] - last[1]).max() < 1e-9 * np.abs(first[1]).max()


def test_the_bare_surface_is_read():
    [patch] = read(DATA / "v7_my_surfaces.3dm").patches
    assert (patch.surface.degree_u, patch.surface.degree_v) == (2, 3)
    assert patch.surface.Pw.shape == (3, 5, 4)


def test_trimmed_faces_are_refused_by_name_with_the_setting_that_skips_them():
    message = refused(DATA / "v5_extrusions.3dm", trimmed="refuse")
    assert len(message.splitlines()) == 8
    assert message.startswith("v5_extrusions.3dm: surface part/") and "`trimmed: skip`" in message
    content = read(DATA / "v5_extrusions.3dm", trimmed="skip")
    assert (len(content.patches), content.total) == (40, 48)
    assert content.notes[0] == "skipped: 10 curves, 8 trimmed faces"
    numbers = [patch.number for patch in content.patches]
    assert len(set(numbers)) == 40 and max(numbers) == 46  # names stay those of the whole file


def test_only_selects_layers_and_says_what_there_is():
    assert len(read(DATA / "v3_HumanHead2.3dm", only="Def*").patches) == 10
    assert [patch.number for patch in read(DATA / "v3_HumanHead2.3dm", only="10").patches] == [10]
    assert "no face matches 'Heads'; layers and objects: Default" in refused(DATA / "v3_HumanHead2.3dm", only="Heads")


def made(path, unit, *surfaces, layers=()):
    """Write a file with surfaces, one on each of the layers (name, visible, parent index)."""
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = unit
    for name, visible, parent in layers:
        layer = rhino3dm.Layer()
        layer.Name, layer.Visible = name, visible
        if parent is not None:
            layer.ParentLayerId = model.Layers[parent].Id
        model.Layers.Add(layer)
    for index, surface in enumerate(surfaces):
        attributes = rhino3dm.ObjectAttributes()
        attributes.LayerIndex = index if layers else 0
        attributes.Name = f"thing {index}"
        model.Objects.Add(surface, attributes)
    model.Write(str(path), 7)
    return path


def sphere():
    return rhino3dm.NurbsSurface.CreateFromSphere(rhino3dm.Sphere(rhino3dm.Point3d(0, 0, 0), 2.0))


def test_a_rational_sphere_keeps_its_radius(tmp_path):
    content = read(made(tmp_path / "a.3dm", rhino3dm.UnitSystem.Inches, sphere()))
    assert content.metres == 0.0254
    u, v = (a.ravel() for a in np.meshgrid(UV, UV))
    [patch] = content.patches
    assert np.abs(np.linalg.norm(point(patch.surface, u, v), axis=1) - 2).max() < 1e-12
    S, N = frame(patch.surface, u, v)
    assert np.abs((N * S).sum(axis=1) / 2 - 1).max() < 1e-6  # outwards, poles included


def test_hidden_layers_hide_what_lies_on_them_and_below(tmp_path):
    layers = [("shown", True, None), ("off", False, None), ("child of off", True, 1)]
    content = read(made(tmp_path / "a.3dm", rhino3dm.UnitSystem.Meters, *(sphere() for _ in layers), layers=layers))
    assert [patch.labels[0] for patch in content.patches] == ["shown"]
    assert content.notes == ["skipped: 2 objects on hidden layers"]
    assert "thing 0" in content.patches[0].labels


def test_a_file_without_unit_says_none(tmp_path):
    assert read(made(tmp_path / "a.3dm", getattr(rhino3dm.UnitSystem, "None"), sphere())).metres is None


def test_files_that_are_no_rhino_files_are_refused(tmp_path):
    (tmp_path / "a.3dm").write_bytes(b"nothing of the kind" * 100)
    assert "is not a readable .3dm file" in refused(tmp_path / "a.3dm")
    (tmp_path / "b.3dm").write_bytes((DATA / "v3_Speeder.3dm").read_bytes()[:100_000])
    assert refused(tmp_path / "b.3dm").startswith("b.3dm: ")
    curve = rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 0, 0))
    assert "holds no visible surface; it holds 1 curve" in refused(
        made(tmp_path / "c.3dm", rhino3dm.UnitSystem.Meters, curve)
    )


def test_cores_change_no_bit_of_what_is_read(three_cores):
    """A body of more faces than one process is given: each with its borders as read by one alone."""
    file = DATA.parents[1] / "data" / "scenes" / "fruit_room" / "v5_teapot.3dm"
    here = read(file).patches
    three_cores()
    found = read(file).patches
    assert len(found) == len(here) > 50
    for one, other in zip(here, found, strict=True):
        assert one.number == other.number and one.labels == other.labels and one.flip == other.flip
        assert isinstance(one.surface, TrimmedSurface)
        for name in ("uv", "S", "significance", "loop_start", "box"):
            assert getattr(one.surface, name).tobytes() == getattr(other.surface, name).tobytes()
        base, again = one.surface.base, other.surface.base
        assert base.Pw.tobytes() == again.Pw.tobytes() and base.knots_u.tobytes() == again.knots_u.tobytes()


@pytest.fixture
def three_cores():
    """Allows three processes from when it is called to the end of the test."""
    before = forks.allow(1)
    yield lambda: forks.allow(3)
    forks.allow(before)
