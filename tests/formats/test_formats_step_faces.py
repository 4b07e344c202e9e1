"""The converter of STEP and IGES itself: real files, closed forms, what it leaves out; needs the extra `step`."""

import importlib
import subprocess
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from lib.formats import step, step_result
from lib.nurbs.shape import collapsed_sides, is_closed
from lib.surfaces.measure import area
from lib.surfaces.trimmed import TrimmedSurface
from tests.formats.reading import read, refused

pytestmark = pytest.mark.skipif(find_spec("OCP") is None, reason="needs the extra `step`")
DATA = Path(__file__).parents[1] / "data"
CUBE = DATA / "red_cube_blue_cylinder.step"
RECORDED = CUBE.with_suffix(".npz")
CHORDS = 4e-5  # a circle's polygon of 512 corners lacks 2.5e-5 of its area


def test_the_recorded_result_is_what_the_converter_makes_today(monkeypatch, tmp_path):
    out = tmp_path / "faces.npz"
    subprocess.run([*step.COMMAND, str(CUBE), str(out)], check=True, cwd=step.ROOT)
    made, kept = step_result.load(out), step_result.load(RECORDED)
    assert (made.shapes, made.kinds, made.instances) == (kept.shapes, kept.kinds, kept.instances)
    for name in step_result.ARRAYS:
        assert getattr(made, name) == pytest.approx(getattr(kept, name), abs=1e-9)
    assert made.gap.max() < 1e-12


def test_a_whole_sphere_is_one_closed_surface_with_two_poles():
    (patch,) = read(DATA / "revolved_sphere.step").patches
    assert area(patch.surface) == pytest.approx(4 * np.pi * 25, rel=1e-9)
    assert is_closed(patch.surface) == (True, False) and collapsed_sides(patch.surface).sum() == 2
    assert patch.material == "colour #cccccc" and patch.solid


def test_a_solid_with_holes_is_closed_bit_for_bit():
    content = read(DATA / "NIST_MBE_PMI_11.stp")
    surfaces = [patch.surface for patch in content.patches]
    assert len(surfaces) == 10 and all(isinstance(surface, TrimmedSurface) for surface in surfaces)
    assert sorted(len(surface.loop_start) - 1 for surface in surfaces)[-2:] == [2, 2]
    assert np.ptp(np.concatenate([surface.S for surface in surfaces]), axis=0) == pytest.approx([63, 63, 3], abs=1e-4)
    _, count = np.unique(np.concatenate([surface.S for surface in surfaces]), axis=0, return_counts=True)
    assert count.min() >= 2


def test_a_pipe_of_loose_iges_faces_comes_in_millimetres():
    content = read(DATA / "test_pipe.iges")
    assert content.total == 4 and {patch.solid for patch in content.patches} == {None}
    total = sum(area(patch.surface) for patch in content.patches)
    assert total == pytest.approx(2 * np.pi * 1000 * 10000 + 2 * np.pi * 1000**2, rel=CHORDS)


@pytest.mark.parametrize("name, source, share", [("cut.step", CUBE, 0.5), ("swapped.igs", CUBE, 1.0)])
def test_damaged_and_misnamed_files_are_refused(tmp_path, name, source, share):
    data = source.read_bytes()
    (tmp_path / name).write_bytes(data[: int(len(data) * share)])
    assert refused(tmp_path / name).startswith(f"{name}: file: is not a readable file of its kind")


def glass_in_two_places(ocp, path):
    """A see-through red box in an assembly, this in another one twice, where the second has the box in blue."""
    xcaf, explorer = ocp.XCAFDoc, ocp.TopExp.TopExp_Explorer
    document = ocp.TDocStd.TDocStd_Document(ocp.TCollection.TCollection_ExtendedString("XmlOcaf"))
    shapes = xcaf.XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colours = xcaf.XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    box = shapes.AddShape(ocp.BRepPrimAPI.BRepPrimAPI_MakeBox(1.0, 2.0, 3.0).Shape(), False)
    colours.SetColor(box, ocp.Quantity.Quantity_ColorRGBA(1.0, 0.0, 0.0, 0.4), xcaf.XCAFDoc_ColorSurf)
    inner, outer = shapes.NewShape(), shapes.NewShape()
    for whole, part, x in ((inner, box, 5.0), (outer, inner, 0.0), (outer, inner, 20.0)):
        move = ocp.gp.gp_Trsf()
        move.SetTranslation(ocp.gp.gp_Vec(x, 0.0, 0.0))
        placed = shapes.AddComponent(whole, part, ocp.TopLoc.TopLoc_Location(move))
        name = {5.0: "box here", 0.0: "left", 20.0: "right"}[x]
        ocp.TDataStd.TDataStd_Name.Set_s(placed, ocp.TCollection.TCollection_ExtendedString(name))
    shapes.UpdateAssemblies()
    solids = explorer(shapes.GetShape_s(outer), ocp.TopAbs.TopAbs_SOLID)
    solids.Next()
    blue = ocp.Quantity.Quantity_Color(0.0, 0.0, 1.0, ocp.Quantity.Quantity_TOC_RGB)
    assert colours.SetInstanceColor(solids.Current(), xcaf.XCAFDoc_ColorSurf, blue, True)
    writer = ocp.STEPCAFControl.STEPCAFControl_Writer()
    writer.SetColorMode(True)
    writer.SetNameMode(True)
    writer.SetSHUOMode(True)
    writer.Transfer(document, ocp.STEPControl.STEPControl_AsIs)
    writer.Write(str(path))


def test_transparency_and_colours_for_one_place_of_a_part_are_told(tmp_path):
    glass_in_two_places(importlib.import_module("OCP"), tmp_path / "a.step")
    content = read(tmp_path / "a.step")
    assert {patch.material for patch in content.patches} == {"colour #ff0000"} and content.total == 12
    assert content.notes == [
        "skipped: colours of single parts in right", "see-through colours are opaque: colour #ff0000"
    ]  # fmt: skip


def torus(ocp, axis):
    return ocp.BRepPrimAPI.BRepPrimAPI_MakeTorus(axis, 5.0, 2.0), 4 * np.pi**2 * 5 * 2


def cone(ocp, axis):
    return ocp.BRepPrimAPI.BRepPrimAPI_MakeCone(axis, 3.0, 0.0, 4.0), np.pi * 3 * 5 + np.pi * 9


def drilled_sphere(ocp, axis):
    prim = ocp.BRepPrimAPI
    ball = prim.BRepPrimAPI_MakeSphere(axis, 3.0).Shape()
    drill = prim.BRepPrimAPI_MakeCylinder(axis.Translated(ocp.gp.gp_Vec(axis.Direction()) * -9), 1.0, 20.0).Shape()
    return ocp.BRepAlgoAPI.BRepAlgoAPI_Cut(ball, drill), 2 * np.pi * (3 + 1) * 2 * np.sqrt(8)


def drilled_cylinder(ocp, axis):
    """A bar of radius 1, a hole of radius 0.5 across it: the hole's wall is gained, two windows of the side lost."""
    prim = ocp.BRepPrimAPI
    across = ocp.gp.gp_Ax2(axis.Location(), axis.XDirection())
    bar = prim.BRepPrimAPI_MakeCylinder(axis.Translated(ocp.gp.gp_Vec(axis.Direction()) * -4), 1.0, 8.0).Shape()
    drill = prim.BRepPrimAPI_MakeCylinder(across.Translated(ocp.gp.gp_Vec(across.Direction()) * -4), 0.5, 8.0).Shape()
    t = np.linspace(0.0, 2 * np.pi, 4001)[:-1]
    chord = np.sqrt(1.0 - 0.25 * np.cos(t) ** 2)  # half the length of the hole along each of its lines
    hole = 0.5 * 2 * chord.mean() * 2 * np.pi
    lost = 2 * (0.5**2 * np.sin(t) ** 2 / chord).mean() * 2 * np.pi
    return ocp.BRepAlgoAPI.BRepAlgoAPI_Cut(bar, drill), 2 * np.pi + 16 * np.pi + hole - lost


@pytest.mark.parametrize("suffix", [".step", ".igs"])
@pytest.mark.parametrize("make", [torus, cone, drilled_sphere, drilled_cylinder])
def test_areas_of_solids_with_closed_forms(tmp_path, make, suffix):
    ocp = importlib.import_module("OCP")
    axis = ocp.gp.gp_Ax2(ocp.gp.gp_Pnt(1, 2, 3), ocp.gp.gp_Dir(1, 2, 2))
    shape, expected = make(ocp, axis)
    path = str(tmp_path / f"made{suffix}")
    if suffix == ".step":
        writer = ocp.STEPControl.STEPControl_Writer()
        writer.Transfer(shape.Shape(), ocp.STEPControl.STEPControl_AsIs)
        writer.Write(path)
    else:
        writer = ocp.IGESControl.IGESControl_Writer("MM", 1)
        writer.AddShape(shape.Shape())
        writer.ComputeModel()
        writer.Write(path)
    content = read(Path(path))
    assert sum(area(patch.surface) for patch in content.patches) == pytest.approx(expected, rel=CHORDS)
    assert not content.notes
