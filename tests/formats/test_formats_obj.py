"""Wavefront OBJ and MTL: indices of every form, polygons, materials, selection, and files that are broken."""

import math
from pathlib import Path

import numpy as np
import pytest

from lib.formats import geometry_file
from lib.formats.mesh_pictures import UNSEEN
from lib.refusal import Refusal
from lib.surfaces.mesh_build import normals_areas

DATA = Path(__file__).parents[1] / "data"
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.fixture
def read(tmp_path):
    """Write a text as an OBJ beside other files and read it."""

    def make(text, only=None, **files):
        for name, content in files.items():
            (tmp_path / name.replace("_DOT_", ".")).write_bytes(content)
        data = text if isinstance(text, bytes) else text.encode()
        (tmp_path / "part.obj").write_bytes(data)
        return geometry_file.read(tmp_path / "part.obj", "part.obj", "part", only)

    return make


def area(content):
    return sum(normals_areas(p.surface.V, p.surface.F)[1].sum() for p in content.patches)


def corners(patch):
    return patch.surface.V[patch.surface.F].tolist()


def test_the_original_cornell_box():
    """18 quadrangles, area 26.5477; two stand for the bottoms of the boxes but repeat other sides: 16 are left."""
    content = geometry_file.read(DATA / "CornellBox-Original.obj", "box.obj", "box")
    assert [len(p.surface.F) for p in content.patches] == [2, 2, 2, 2, 2, 10, 10, 2]
    assert area(content) == pytest.approx(25.4678, abs=1e-4)
    assert content.notes == ["left out: 4 triangles listed before"]
    assert content.materials["light"]["emission"] == pytest.approx([17 * math.pi, 12 * math.pi, 4 * math.pi])
    assert content.materials["leftWall"] == {"reflectance": [0.63, 0.065, 0.05]}
    assert content.patches[0].surface.V.tolist() == [[-1.01, 0, 0.99], [1, 0, 0.99], [1, 0, -1.04], [-0.99, 0, -1.04]]
    assert (content.metres, content.up) == (None, None)


@pytest.mark.parametrize("face", ["f 1 2 3 4", "f -4 -3 -2 -1", "f 1/1 2/2 3/3 4/4", "f 1//1 2//1 3//1 4//1",
                                  "f 1/1/1 2/2/1 3/3/1 4/4/1", "f -4/-4/-1 -3/-3/-1 -2/-2/-1 -1/-1/-1", "f 1/ 2/ 3/ 4/",
                                  "f 1/1 2 3//1 4/4/1", "f \\\n1 2 \\\n 3 4", "  f\t1 2 3 4 # all\r"])  # fmt: skip
def test_every_form_of_index(read, face):
    text = SQUARE + "vt 0.25 0\nvt 1 0 0\nvt 1 1\nvt 0 1\nvn 0 1 1\n" + face + "\n"
    surface = read(text).patches[0].surface
    assert surface.V[surface.F].tolist() == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
    if face.startswith(("f 1/1/1", "f -4/")):
        assert surface.T.tolist() == [[[0.25, 0], [1, 0], [1, 1]], [[0.25, 0], [1, 1], [0, 1]]]
    if "//" in face and "/4" not in face or face.startswith("f 1/1/1"):
        assert np.allclose(surface.N, [0, math.sqrt(0.5), math.sqrt(0.5)])
    else:
        assert np.allclose(surface.N[0, 0], [0, 0, 1]) or "-1/-1" in face


def test_a_relative_index_counts_from_where_it_stands(read):
    content = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nv 2 0 1\nv 0 2 1\nf -3 -2 -1\nf 1 -2 6\n")
    assert corners(content.patches[0])[1:] == [
        [[0, 0, 1], [2, 0, 1], [0, 2, 1]], [[0, 0, 0], [2, 0, 1], [0, 2, 1]]
    ]  # fmt: skip


def test_weights_and_unknown_words_are_passed_over(read):
    text = "v 0 0 0 1\nv 1 0 0 1\nv 0 1 0\ns 1\nl 1 2\nfrobnicate\ncurv 0 1 1 2\nf 1 2 3\n"
    content = read(text)
    assert len(content.patches[0].surface.F) == 1
    assert content.notes == ["passed over: 1 curve or surface, 1 line with an unknown word"]


def test_a_concave_polygon(read):
    assert area(read("v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nf 3 4 5 1 2\n")) == pytest.approx(10.0)


def test_materials_become_surfaces_and_groups_labels(read):
    text = (
        "mtllib my room.mtl\n"
        + SQUARE
        + "v 0 0 1\no house\ng north wall\nusemtl paint\nf 1 2 3\nusemtl wood\nf 1 3 4\n"
        "g roof\nusemtl paint\nf 1 2 5\n"
    )
    mtl = b"newmtl paint\nKd 0.5 0.25 0.125 # linear\nKe 1\nnewmtl wood\n\tKd 2 0 0\n"
    files = {"my room_DOT_mtl": mtl}
    content = read(text, **files)
    assert [(p.number, p.material, len(p.surface.F)) for p in content.patches] == [(1, "paint", 2), (2, "wood", 1)]
    assert content.patches[0].labels == ("paint", "1", "house", "north wall", "north", "wall", "roof")
    assert content.materials["paint"] == {"reflectance": [0.5, 0.25, 0.125], "emission": pytest.approx([math.pi] * 3)}
    assert content.materials["wood"] == {"reflectance": [1.0, 0, 0]}
    chosen = read(text, "roof", **files)
    assert [(p.number, p.material, len(p.surface.F)) for p in chosen.patches] == [(1, "paint", 1)]
    assert chosen.total == 2
    assert [p.number for p in read(text, "wood", **files).patches] == [2]
    assert [len(p.surface.F) for p in read(text, "nor*", **files).patches] == [1, 1]
    with pytest.raises(Refusal, match="nothing matches 'cellar'; materials, groups and objects: paint, house"):
        read(text, "cellar", **files)


def test_textures_with_options_and_blanks(read):
    text = "mtllib a.mtl\n" + SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nusemtl m\nf 1/1 2/2 3/3\nusemtl n\nf 1/1 3/2 4/3\n"
    mtl = b"newmtl m\nKd 0.8 0.8 0.8\nmap_Kd -s 2 3 1 -o 0.5 -clamp on -bm 1 my wall.png\n"
    mtl += b"newmtl n\nKd 1 0.5 0.5\nmap_Kd x.PNG"
    png = b"\x89PNG"
    content = read(text, **{"a_DOT_mtl": mtl, "my wall_DOT_png": png, "x_DOT_PNG": png})
    assert content.materials["m"] == {"texture": "my wall.png", "repeat": [2.0, 3.0]}
    assert content.materials["n"] == {"reflectance": [1.0, 0.5, 0.5], "texture": "x.PNG"}
    assert content.notes == []


def test_textures_that_are_not_there_are_named_in_one_sentence(read):
    lines = {"a": "gone.png", "b": "lfs.png", "c": "WALL.png", "d": "../up.png", "e": "C:\\\\x.png", "f": "wall.png"}
    text = "mtllib a.mtl\n" + SQUARE + "".join(f"usemtl {name}\nf 1 2 3\n" for name in lines)
    mtl = "".join(f"newmtl {name}\nKd .8 .8 .8\nmap_Kd {file}\n" for name, file in lines.items()).encode()
    lfs = b"version https://git-lfs.github.com/spec/v1\noid"
    content = read(text, **{"a_DOT_mtl": mtl, "lfs_DOT_png": lfs, "wall_DOT_png": b"\x89PNG"})
    assert all(content.materials[name] == {"reflectance": [UNSEEN] * 3} for name in lines)
    (note,) = content.notes
    for part in (
        "gone.png (no such file)",
        "lfs.png (a Git LFS pointer",
        "WALL.png (no such file, but there is wall.png)",
        "../up.png (outside the file's folder)",
        "wall.png (the mesh has no texture coordinates)",
    ):
        assert part in note


def test_colours_of_vertices_and_see_through_materials_are_told(read):
    mtl = b"newmtl a\nd 0.5\nnewmtl b\nd 1.0\nTr 0\nnewmtl c\nmap_d leaf.png\nnewmtl d\nd -halo 0.9\n"
    text = "mtllib a.mtl\nv 0 0 0 .2 .4 0\nv 1 0 0 .2 .4 0\nv 1 1 0 .2 .4 0\nv 0 0 1\nv 1 0 1 .5\nv 0 1 1\n"
    content = read(text + "usemtl a\nf 1 2 3\nusemtl b\nf 4 5 6\n", a_DOT_mtl=mtl)
    assert content.notes == ["a.mtl: see-through materials are opaque: a, c, d", "vertex colours are not used: part/1"]


def test_missing_libraries_and_materials_are_noted(read):
    content = read("mtllib no.mtl also.mtl\nmtllib a.mtl\n" + SQUARE + "usemtl x\nf 1 2 3\n", a_DOT_mtl=b"newmtl y\n")
    assert content.notes == ["no file no.mtl also.mtl: its materials are grey",
                             "materials that no library defines, grey instead: x"]  # fmt: skip
    assert content.materials == {}


def test_emission_textures(read):
    """With Ke, without it (1), beside a base texture, and one that repeats otherwise."""
    mtl = b"newmtl a\nKe 9 9 3\nmap_Ke -s 2 3 -clamp on e.png\nnewmtl b\nmap_Ke e.png\nmap_Kd w.png\n"
    mtl += b"newmtl c\nKe 1 1 1\nmap_Kd w.png\nmap_Ke -s 2 2 e.png\nnewmtl d\nKe 0 0 0\nmap_Ke e.png\n"
    text = "mtllib a.mtl\n" + SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\n"
    text += "".join(f"usemtl {name}\nf 1/1 2/2 3/3\n" for name in "abcd")
    content = read(text, **{"a_DOT_mtl": mtl, "e_DOT_png": b"\x89PNG", "w_DOT_png": b"\x89PNG"})
    nine = pytest.approx([9 * math.pi, 9 * math.pi, 3 * math.pi])
    a = {"reflectance": [0.0] * 3, "emission": nine, "emission_texture": "e.png", "repeat": [2.0, 3.0]}
    assert content.materials["a"] == a
    one = pytest.approx([math.pi] * 3)
    assert content.materials["b"] == {"texture": "w.png", "emission": one, "emission_texture": "e.png"}
    assert content.materials["c"] == {"texture": "w.png"} and "emission" not in content.materials["d"]
    assert content.notes == ["a.mtl: emission textures that can not be used; no light comes from c"]


@pytest.mark.parametrize("file", ["gone.png", "e.png"])
def test_emission_textures_without_a_place_do_not_glow_all_over(read, file):
    """The picture is not there, or the mesh has no texture coordinates."""
    mtl = f"newmtl x\nKe 9 9 9\nmap_Ke {file}\n".encode()
    content = read("mtllib a.mtl\n" + SQUARE + "usemtl x\nf 1 2 3\n", **{"a_DOT_mtl": mtl, "e_DOT_png": b"\x89PNG"})
    assert content.materials["x"] == {"reflectance": [0.0] * 3}
    assert file in content.notes[-1]


@pytest.mark.parametrize("text, what", [
    ("hello\n", "holds no face"),
    (SQUARE, "holds no face"),
    (SQUARE + "f 1 2 9\n", r"`v` 9 is not there; allowed: 1 to 4 \(line 5\)"),
    (SQUARE + "\nf 1 2 0\n", r"`v` 0 is not there; allowed: 1 to 4 \(line 6\)"),
    (SQUARE + "f 1 2 -5\n", r"`v` -5 is not there"),
    (SQUARE + "f 1/1 2/1 3/1\n", "`vt` 1 is not there; allowed: there is no `vt`"),
    (SQUARE + "f 1 2\n", r"a face has at least 3 corners, found 'f 1 2' \(line 5\)"),
    (SQUARE + "f 1 2 x\n", "expected corners like 1, 1/2, 1//3 or 1/2/3, found 'x'"),
    (SQUARE + "f 1 2 3.5\n", "expected corners like"),
    (SQUARE + "f 1 2/3/4/5 3\n", "expected corners like"),
    (SQUARE + "f 1 2 99999999999999999999\n", "expected corners like|is not there"),
    (SQUARE + "v 1 nan 1\nf 1 2 3\n", r"expected finite numbers within 1e100, found 'v 1 nan 1' \(line 5\)"),
    (SQUARE + "v 1 1\nf 1 2 3\n", r"expected 3 numbers after `v`, found 'v 1 1' \(line 5\)"),
    (SQUARE + "v 1 1 x\nf 1 2 3\n", "expected 3 numbers after `v`, found 'x'"),
    (SQUARE + "v 1 1 \\\n 1e999\nf 1 2 3\n", r"expected finite numbers.*\(line 5\)"),
    (SQUARE + "f 1 1 2\n", "no triangle has an area"),
    (SQUARE.encode("utf-16"), "is not text"),
    (b"\x00\x01", "is not text"),
])  # fmt: skip
def test_broken_files_are_refused(read, text, what):
    with pytest.raises(Refusal, match=what):
        read(text)


def test_archives_are_refused(tmp_path):
    (tmp_path / "a.zip").write_bytes(b"PK")
    with pytest.raises(Refusal, match="is packed .* unpack it"):
        geometry_file.read(tmp_path / "a.zip", "a.zip", "a")


def test_names_may_hold_a_hash_and_other_alphabets(read):
    content = read("mtllib a.mtl\n" + SQUARE + "usemtl Material #25\nf 1 2 3 # one\n",
                   a_DOT_mtl="newmtl Material #25\nKd 0.1 0.2 0.3\n# Öl\n".encode("latin-1"))  # fmt: skip
    assert content.materials == {"Material #25": {"reflectance": [0.1, 0.2, 0.3]}}
