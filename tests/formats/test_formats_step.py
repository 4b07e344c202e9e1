"""STEP and IGES: what the reading side makes of the converter's result, and of a converter that fails."""

import os
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from lib.formats import artefact, step, step_result
from lib.nurbs.surface import NurbsSurface, bilinear
from lib.surfaces.measure import area
from tests.formats.reading import read, refused

DATA = Path(__file__).parents[1] / "data"
CUBE = DATA / "red_cube_blue_cylinder.step"
RECORDED = CUBE.with_suffix(".npz")
CHORDS = 4e-5  # a circle's polygon of 512 corners lacks 2.5e-5 of its area


def converter(monkeypatch, code, seconds=60):
    """Let a line of Python stand in for the converter; `source` and `out` are its arguments."""
    head = "import os, shutil, signal, sys, time; source, out = sys.argv[1:]; "
    monkeypatch.setattr(step, "COMMAND", (sys.executable, "-c", head + code))
    monkeypatch.setattr(step, "SECONDS", seconds)


@pytest.fixture
def recorded(monkeypatch):
    converter(monkeypatch, f"shutil.copy({str(RECORDED)!r}, out)")


# --- a converter that fails


@pytest.mark.skipif(find_spec("OCP") is not None, reason="the extra `step` is there")
def test_without_the_extra_one_line_says_what_to_type():
    assert refused(CUBE) == f'{CUBE.name}: file: needs the extra: .venv/bin/pip install ".[step]"'


def test_an_extra_that_is_missing_is_told_from_other_failures(monkeypatch):
    converter(monkeypatch, "sys.path.clear(); sys.modules['OCP'] = None; raise ImportError(\"No module named 'OCP'\")")
    assert "needs the extra" in refused(CUBE)
    converter(monkeypatch, "raise ImportError('libGL.so.1: cannot open shared object file')")
    assert refused(CUBE).endswith(
        "file: its conversion failed: ImportError: libGL.so.1: cannot open shared object file"
    )


def test_a_crash_is_refused_and_says_where(monkeypatch):
    code = "print('at face 2 of 3: Cylinder', file=sys.stderr, flush=True); os.kill(os.getpid(), signal.SIGSEGV)"
    converter(monkeypatch, code)
    assert refused(CUBE) == f"{CUBE.name}: file: its conversion crashed (SIGSEGV, at face 2 of 3: Cylinder)"


def test_a_hanging_converter_is_stopped(monkeypatch, tmp_path):
    converter(monkeypatch, f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(600)", seconds=3)
    assert refused(CUBE) == f"{CUBE.name}: file: its conversion was stopped after 3 s"
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_its_own_refusal_is_passed_on(monkeypatch):
    converter(monkeypatch, "print('refused: holds no part that can be converted', file=sys.stderr); sys.exit(2)")
    assert refused(CUBE) == f"{CUBE.name}: file: holds no part that can be converted"


@pytest.mark.parametrize("code", ["pass", "open(out, 'w').write('no')", f"shutil.copy({str(CUBE)!r}, out)"])
def test_success_without_a_result_is_refused(monkeypatch, code):
    converter(monkeypatch, code)
    assert "file: its conversion gave no result (" in refused(CUBE)


@pytest.mark.parametrize(
    "name, spoil",
    [
        ("edge", lambda a: a + 1000),
        ("colour", lambda a: a + 7),
        ("Pw", lambda a: a * np.nan),
        ("S", lambda a: a[:-1]),
        ("uv_first", lambda a: a[::-1]),
        ("use_first", lambda a: a[:-1]),
        ("count", lambda a: a + 1),
        ("body", lambda a: a - 5),
        ("is_trimmed", lambda a: a[:, None]),
        ("degree", lambda a: a * 1.5),
        ("knots", lambda a: a.astype("U9")),
        ("colours", lambda a: a - 1.0),
    ],
)
def test_a_result_that_contradicts_itself_is_refused(monkeypatch, tmp_path, name, spoil):
    header, arrays = artefact.read(RECORDED, step_result.KIND, step_result.VERSION)
    arrays[name] = spoil(arrays[name])
    artefact.write(tmp_path / "spoilt.npz", step_result.KIND, step_result.VERSION, header, arrays)
    converter(monkeypatch, f"shutil.copy({str(tmp_path / 'spoilt.npz')!r}, out)")
    assert "file: its conversion gave no result (" in refused(CUBE)


@pytest.mark.parametrize(
    "place", [{"shape": 9}, {"colour": 9}, {"matrix": [1.0] * 11}, {"matrix": "here"}, {"labels": 1}]
)
def test_instances_that_point_nowhere_are_refused(monkeypatch, tmp_path, place):
    header, arrays = artefact.read(RECORDED, step_result.KIND, step_result.VERSION)
    header["instances"][0] |= place
    artefact.write(tmp_path / "spoilt.npz", step_result.KIND, step_result.VERSION, header, arrays)
    converter(monkeypatch, f"shutil.copy({str(tmp_path / 'spoilt.npz')!r}, out)")
    assert "file: its conversion gave no result (" in refused(CUBE)


# --- a recorded result


def test_cube_and_cylinder_have_their_areas_colours_and_box(recorded):
    content = read(CUBE)
    assert (content.total, content.metres, content.notes, content.trimmed) == (9, 0.001, [], [])
    areas = [area(patch.surface) for patch in content.patches]
    assert areas == pytest.approx([25 * np.pi, 25 * np.pi, 100 * np.pi] + [100.0] * 6, rel=CHORDS)
    assert [patch.material for patch in content.patches] == ["colour #3b61b4"] * 3 + ["colour #dd5228"] * 6
    # The file's sRGB 0.8667 0.3216 0.1569, in linear light
    red = content.materials["colour #dd5228"]["reflectance"]
    assert red == pytest.approx([((c + 0.055) / 1.055) ** 2.4 for c in (0.8666667, 0.3215686, 0.1568628)], rel=1e-4)
    assert all(patch.solid for patch in content.patches)
    assert content.patches[0].labels == ("blue_cylinder", "colour #3b61b4", "1", "1")
    P = np.concatenate([patch.surface.P.reshape(-1, 3) for patch in content.patches[3:]])
    assert np.ptp(P, axis=0) == pytest.approx([10.0, 10.0, 10.0])


def test_normals_turned_by_flip_look_out_of_the_cube(recorded):
    cube = read(CUBE).patches[3:]
    centre = np.mean([patch.surface.P.mean(axis=(0, 1)) for patch in cube], axis=0)
    for patch in cube:
        P = patch.surface.P
        normal = np.cross(P[1, 0] - P[0, 0], P[0, 1] - P[0, 0]) * (-1 if patch.flip else 1)
        assert normal @ (P.mean(axis=(0, 1)) - centre) > 0


def test_a_body_without_trims_stays_plain_and_one_with_them_shares_its_edges(recorded):
    surfaces = [patch.surface for patch in read(CUBE).patches]
    assert all(isinstance(surface, NurbsSurface) for surface in surfaces[3:])
    bottom, top, side = surfaces[:3]
    for disc in (bottom, top):
        inner = ~np.isinf(disc.significance)
        assert {bytes(S) for S in disc.S} <= {bytes(S) for S in side.S}
        known = {bytes(S): s for S, s in zip(side.S, side.significance, strict=True)}
        assert [known[bytes(S)] for S in disc.S[inner]] == disc.significance[inner].tolist()


def test_only_selects_parts_colours_and_numbers(recorded):
    assert [patch.number for patch in read(CUBE, only="red_*").patches] == [4, 5, 6, 7, 8, 9]
    assert [patch.number for patch in read(CUBE, only="colour #3b61b4").patches] == [1, 2, 3]
    assert list(read(CUBE, only="3").materials) == ["colour #3b61b4"]
    message = refused(CUBE, only="green*")
    assert message.startswith(f"{CUBE.name}: only: no face matches 'green*'; names and colours: blue_cylinder, ")


def test_trimmed_faces_can_be_left_out_or_refused(recorded):
    content = read(CUBE, trimmed="skip")
    assert content.trimmed == [1, 2] and [patch.number for patch in content.patches] == [3, 4, 5, 6, 7, 8, 9]
    assert all(isinstance(patch.surface, NurbsSurface) for patch in content.patches)
    assert refused(CUBE, trimmed="refuse").count("is a trimmed face") == 2
    assert refused(CUBE, trimmed="skip", only="1").startswith(f"{CUBE.name}: trimmed: every face is trimmed")


def test_a_reading_is_kept_and_used_again(recorded, monkeypatch, tmp_path):
    first = read(CUBE, cache=tmp_path)
    (kept,) = tmp_path.iterdir()
    converter(monkeypatch, "sys.exit('a second conversion')")
    again = read(CUBE, cache=tmp_path)
    for a, b in zip(first.patches, again.patches, strict=True):
        assert (a.number, a.flip, a.labels, a.material, a.solid) == (b.number, b.flip, b.labels, b.material, b.solid)
        if isinstance(a.surface, NurbsSurface):
            assert (a.surface.Pw == b.surface.Pw).all()
        else:
            assert (a.surface.uv == b.surface.uv).all() and (a.surface.S == b.surface.S).all()
    assert (first.materials, first.total, first.notes) == (again.materials, again.total, again.notes)
    other = tmp_path / "other.step"
    other.write_bytes(CUBE.read_bytes() + b"\n")
    assert "a second conversion" in refused(other, cache=tmp_path)
    kept.write_bytes(kept.read_bytes()[:-100])
    assert "a second conversion" in refused(CUBE, cache=tmp_path)


# --- made by hand: two square faces that meet in an edge, one of them with a corner cut off


def square_faces(gap=0.0):
    """Faces z = 0 and x = 0 over unit squares, the first without the corner beyond u + v = 1.5, and their edges."""
    floor = bilinear([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0])
    wall = bilinear([0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1])
    corners = [[0, 0, 0], [1, 0, 0], [1, 0.5, 0], [0.5, 1, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]]
    ends = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0), (4, 5), (5, 6), (6, 0)]
    edges = [np.array([corners[a], corners[b]], dtype=float) for a, b in ends]
    first = [(k, False, edges[k][:, :2]) for k in range(5)]
    second = [(4, True, edges[4][:, 1:])] + [(k, False, edges[k][:, 1:]) for k in (5, 6, 7)]
    return [
        step_result.Face(0, False, False, 0, "Plane", True, gap, floor, [first]),
        step_result.Face(0, False, True, -1, "Plane", False, 0.0, wall, [second]),
    ], edges


def placed(monkeypatch, tmp_path, faces, edges, places, notes=(), see_through=()):
    """A file whose one part stands in several places, each a 3 x 4 matrix and a colour."""
    instances = [{"shape": 0, "matrix": M, "labels": ["sheet"], "colour": c} for M, c in places]
    colours = [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    made = step_result.packed([("sheet", faces, edges)], colours, list(see_through), instances, list(notes))
    step_result.save(tmp_path / "made.npz", made)
    converter(monkeypatch, f"shutil.copy({str(tmp_path / 'made.npz')!r}, out)")
    shutil.copy(CUBE, tmp_path / "made.step")
    return tmp_path / "made.step"


HERE = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]
TURNED = [0.6, -0.8, 0, 1 / 3, 0.8, 0.6, 0, 0.1, 0, 0, 1, 7]
MIRRORED = [-1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]


def test_parts_stand_in_their_places_with_the_nearest_colour(monkeypatch, tmp_path):
    path = placed(monkeypatch, tmp_path, *square_faces(), [(HERE, -1), (TURNED, 1), (MIRRORED, 1)], ["3 curves"])
    content = read(path)
    assert content.notes == ["skipped: 3 curves"]
    red, blue = "colour #ff0000", "colour #0000ff"
    assert [patch.material for patch in content.patches] == [red, None, red, blue, red, blue]
    assert [patch.flip for patch in content.patches] == [False, True, False, True, True, False]
    assert [patch.solid for patch in content.patches] == [None] * 6
    assert [area(patch.surface) for patch in content.patches] == pytest.approx([0.875, 1.0] * 3)
    for first, second in zip(content.patches[::2], content.patches[1::2], strict=True):
        assert len({bytes(S) for S in first.surface.S} & {bytes(S) for S in second.surface.S}) == 2
    turned = np.reshape(TURNED, (3, 4))
    expected = content.patches[0].surface.S @ turned[:, :3].T + turned[:, 3]
    assert content.patches[2].surface.S == pytest.approx(expected, abs=1e-12)


def test_colours_that_let_light_through_are_named_if_something_has_them(monkeypatch, tmp_path):
    path = placed(monkeypatch, tmp_path, *square_faces(), [(HERE, -1)], see_through=[0, 1])
    assert read(path).notes == ["see-through colours are opaque: colour #ff0000"]
    assert read(path, only="2").notes == []


@pytest.mark.parametrize("see_through", [[2], ["0"], 1])
def test_see_through_colours_that_are_not_there_are_refused(monkeypatch, tmp_path, see_through):
    header, arrays = artefact.read(RECORDED, step_result.KIND, step_result.VERSION)
    header["see_through"] = see_through
    artefact.write(tmp_path / "spoilt.npz", step_result.KIND, step_result.VERSION, header, arrays)
    converter(monkeypatch, f"shutil.copy({str(tmp_path / 'spoilt.npz')!r}, out)")
    assert "file: its conversion gave no result (" in refused(CUBE)


def test_a_face_that_could_not_be_converted_is_named_with_its_kind(monkeypatch, tmp_path):
    faces, edges = square_faces()
    faces[1] = step_result.Face(0, False, False, -1, "SurfaceOfRevolution", why="Standard_DomainError")
    path = placed(monkeypatch, tmp_path, faces, edges, [(HERE, -1)])
    what = "a surface of revolution that can not be converted (Standard_DomainError)"
    assert refused(path).startswith(f"made.step: surface part/2: {what}; `only` selects")
    assert [patch.number for patch in read(path, only="1").patches] == [1]


def test_edges_off_their_surface_are_told_and_refused_if_far(monkeypatch, tmp_path):
    path = placed(monkeypatch, tmp_path, *square_faces(gap=2e-3), [(HERE, -1)])
    assert read(path).notes == ["edges lie off their surface in faces: 1, most in 1: 2.0e-03 of its size"]
    path = placed(monkeypatch, tmp_path, *square_faces(gap=0.05), [(HERE, -1)])
    assert refused(path) == "made.step: surface part/1: a plane whose edges lie 0.05 of its size off it"


def test_a_file_without_faces_is_refused(monkeypatch, tmp_path):
    path = placed(monkeypatch, tmp_path, [], [], [(HERE, -1)], ["2 curves"])
    assert refused(path) == "made.step: holds no face; it holds 2 curves"
