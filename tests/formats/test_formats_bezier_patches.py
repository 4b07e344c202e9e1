"""Both forms of the .bpt header, the teaset form, and what is wrong with broken ones."""

from pathlib import Path

import numpy as np
import pytest

from lib.nurbs.evaluate import frame, point
from lib.nurbs.shape import collapsed_sides
from tests.formats.reading import read, refused

DATA = Path(__file__).parents[1] / "data"
FLAT = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 5), (2, 1, 0)]  # 2 rows of 3 points


def write(tmp_path, text, name="a.bpt"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def bpt(*headers, points=FLAT):
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in points)
    return f"{len(headers)}\n" + "".join(f"{header}\n{rows}" for header in headers)


def test_bpt_and_teaset_hold_identical_patches():
    listed, indexed = read(DATA / "teapot.bpt"), read(DATA / "teapot.teaset.txt")
    assert len(listed.patches) == len(indexed.patches) == listed.total == 32
    for a, b in zip(listed.patches, indexed.patches, strict=True):
        assert np.array_equal(a.surface.Pw, b.surface.Pw) and a.number == b.number
        assert (a.surface.degree_u, a.surface.degree_v) == (3, 3)


def test_teapot_has_its_poles_size_and_outward_normals():
    patches = [patch.surface for patch in read(DATA / "teapot.bpt").patches]
    assert sum(collapsed_sides(surface).any() for surface in patches) == 8
    P = np.concatenate([surface.P.reshape(-1, 3) for surface in patches])
    assert np.ptp(P, axis=0) == pytest.approx([6.525, 4, 3.15])
    for surface in patches[4:12]:  # the body: away from the axis
        S, N = frame(surface, np.array([0.3, 0.7]), np.array([0.4, 0.6]))
        assert ((S * [1, 1, 0]) * N).sum(axis=1).min() > 0


def test_header_gives_degrees_or_points_per_side(tmp_path):
    patches = read(write(tmp_path, bpt("1 2", "2 3"))).patches
    assert np.array_equal(patches[0].surface.Pw, patches[1].surface.Pw)
    surface = patches[0].surface
    assert (surface.degree_u, surface.degree_v) == (2, 1)  # points run along u first
    assert np.array_equal(
        point(surface, np.array([0, 1, 0, 1.0]), np.array([0, 0, 1, 1.0])), [FLAT[i] for i in (0, 2, 3, 5)]
    )


def test_only_selects_patches_by_number():
    content = read(DATA / "teapot.bpt", only="0[1-4]")
    assert [patch.number for patch in content.patches] == [1, 2, 3, 4] and content.total == 32
    assert "no patch matches 'lid'" in refused(DATA / "teapot.bpt", only="lid")


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "is empty"),
        ("# only a comment\n", "is empty"),
        ("x\n", "expected the number of patches (1 whole number), found 'x' (line 1)"),
        ("0\n", "0 patches; allowed: 1 to"),
        ("9999999\n", "patches; allowed: 1 to"),
        ("2\n1 2\n" + "0 0 0\n" * 6, "surface part/2: ends before patch 2 of 2"),
        (
            "1\n1 2\n" + "0 0 0\n" * 5,
            "surface part/1: header 1 2 is followed by 5 points; expected 6 (degrees 1 2) or 2",
        ),
        ("1\n3 3\n0 0 0\n", "header 3 3 is followed by 1 points; expected 16 (degrees 3 3) or 9"),
        ("1\n0 5\n" + "0 0 0\n" * 6, "degrees 1 to 20"),
        ("1\n1 2\n" + "0 0 0\n" * 5 + "0 nan 0\n", "surface part/1: points: expected a point (3 finite numbers"),
        (
            "1\n1 2\n" + "0 0 0\n" * 5 + "0 1e101 0\n",
            "expected a point (3 finite numbers within 1e100), found '0 1e101 0' (line 8)",
        ),
        ("1\n1 2\n" + "0 0 0\n" * 5 + "a b c\n", "expected a point"),
        ("1\n1 2\n" + "0 0 0\n" * 6 + "5 5\n", "goes on after its 1 patches (line 9)"),
    ],
)
def test_broken_bpt_files_are_refused(tmp_path, text, said):
    message = refused(write(tmp_path, text))
    assert message.startswith("a.bpt: ") and said in message


TEASET = "1\n" + ",".join(str(i) for i in range(1, 17)) + "\n16\n"
VERTICES = "".join(f"{i % 4},{i // 4},0\n" for i in range(16))


@pytest.mark.parametrize(
    "text, said",
    [
        (TEASET + VERTICES[:-6], "16 vertices are announced, 15 follow (line 3)"),
        (TEASET.replace("16\n16", "17\n16") + VERTICES, "surface part/1: an index is outside 1 to 16 (line 2)"),
        (TEASET.replace("1,2,", "0,2,") + VERTICES, "an index is outside 1 to 16"),
        (TEASET.replace("1,2,", "1.5,2,") + VERTICES, "expected the indices (16 whole numbers)"),
        ("5\n1,2,3\n", "ends before its 5 patches"),
    ],
)
def test_broken_teaset_files_are_refused(tmp_path, text, said):
    assert said in refused(write(tmp_path, text, "a.txt"))
    assert len(read(write(tmp_path, TEASET + VERTICES, "good.txt")).patches) == 1


def test_files_that_are_none_are_refused_before_reading(tmp_path):
    (tmp_path / "folder.bpt").mkdir()
    assert "file: is not a file" in refused(tmp_path / "folder.bpt")
    assert "file: no such file" in refused(tmp_path / "none.bpt")
    assert "is empty" in refused(write(tmp_path, ""))
    (tmp_path / "a.bpt").write_bytes(b"\xff\xfe\x00")
    assert "is not text in UTF-8" in refused(tmp_path / "a.bpt")
    assert "files of kind '.dwg' are not read; allowed: .bpt" in refused(write(tmp_path, "v 0 0 0", "a.dwg"))
