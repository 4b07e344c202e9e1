"""Stage tessellate on a small scene: a box, a ball above it, a picture that only receives."""

import numpy as np
import pytest

from lib.formats import casters, scene
from lib.formats.artefact import ArtefactError, read_json
from lib.nurbs.shape import transformed
from stages import tessellate
from tests.rooms import cube_mesh, scene_of
from tests.shapes import box, disc, rectangle, sphere
from tests.surfaces.trimmed_shapes import SQUARE, circle, cut_out


def small_scene(scale=1.0, flip=()):
    lift = np.diag([0.3, 0.3, 0.3, 1.0])
    lift[:3, 3] = [0.5, 0.5, 1.6]
    surfaces = [transformed(sphere(), lift), *box(), rectangle([0, -1, 0], [1, 0, 0], [0, 0, 1])]
    surfaces = [transformed(s, np.diag([scale, scale, scale, 1.0])) for s in surfaces]
    names = ["ball", *(f"box/{k}" for k in range(1, 7)), "picture"]
    role = {"ball": "cast_only", "picture": "receive_only"}
    facts = [{"role": role.get(name, "full"), "flip": name in flip} for name in names]
    return scene_of(dict(zip(names, zip(surfaces, facts, strict=True), strict=True)))


def run(tmp_path, x, settings='{"sag": 0.001}', name="casters.npz"):
    scene.save(tmp_path / "scene.npz", x)
    argv = ["--scene", str(tmp_path / "scene.npz"), "--settings", settings, "--out", str(tmp_path / name)]
    status = tessellate.main([*argv, "--cost", str(tmp_path / "cost.json")])
    return status, tmp_path / name


def normals(x, s):
    A, B, C = (x.V[x.F[x.face_surface == s, k]] for k in range(3))
    return np.cross(B - A, C - A), (A + B + C) / 3


def test_the_contract_holds(tmp_path):
    status, path = run(tmp_path, small_scene())
    assert status == 0
    x = casters.load(path)
    assert np.abs(x.V).max() <= 0.5 + 1e-12 and x.scale == pytest.approx(2.0, abs=0.2)
    assert set(x.face_surface) == set(range(7))  # the picture does not block
    assert x.shell.tolist() == [0, 1, 1, 1, 1, 1, 1, -1]
    assert x.is_planar.tolist() == [False, *[True] * 7]
    assert x.sag[0] > 0 and (x.sag[1:] == 0).all() and x.sag[0] <= 2e-3 * np.pi * 0.6 / x.scale
    assert x.area[0] * x.scale**2 == pytest.approx(4 * np.pi * 0.09, rel=1e-6)
    assert x.extent[1] * x.scale == pytest.approx([1, 1])
    out, at = normals(x, 0)
    centre = (np.array([0.5, 0.5, 1.6]) - x.centre) / x.scale
    assert (np.einsum("kc,kc->k", out, at - centre) > 0).all()
    notes = read_json(tmp_path / "cost.json")["notes"]
    assert notes["triangles"] == len(x.F) and notes["shells"] == 2
    assert read_json(tmp_path / "cost.json")["rays"] == 0


def test_flat_surfaces_have_no_sag_though_their_outline_is_cut(tmp_path):
    x = small_scene()
    x.surfaces[1] = disc()
    _, path = run(tmp_path, x)
    made = casters.load(path)
    assert made.is_planar[1] and made.sag[1] == 0 and (made.face_surface == 1).sum() > 20


def test_flip_turns_the_faces(tmp_path):
    _, path = run(tmp_path, small_scene(flip=["ball"]))
    x = casters.load(path)
    out, at = normals(x, 0)
    centre = (np.array([0.5, 0.5, 1.6]) - x.centre) / x.scale
    assert (np.einsum("kc,kc->k", out, at - centre) < 0).all()


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_the_unit_does_not_matter(tmp_path, scale):
    _, path = run(tmp_path, small_scene())
    _, other = run(tmp_path, small_scene(scale), name="other.npz")
    a, b = casters.load(path), casters.load(other)
    assert np.array_equal(a.F, b.F) and np.allclose(a.V, b.V, atol=1e-9) and np.allclose(a.UV, b.UV, atol=1e-6)


def test_same_bytes_twice(tmp_path):
    _, a = run(tmp_path, small_scene())
    _, b = run(tmp_path, small_scene(), name="b.npz")
    assert a.read_bytes() == b.read_bytes()


def test_finer_sag_makes_more_triangles(tmp_path):
    _, a = run(tmp_path, small_scene(), '{"sag": 0.001}')
    _, b = run(tmp_path, small_scene(), '{"sag": 0.0001}', "b.npz")
    assert casters.load(b).sag.max() <= 1e-4 < casters.load(a).sag.max()


@pytest.mark.parametrize("sag", ["0", "-1", "NaN", "1"])
def test_a_sag_out_of_range_is_refused(tmp_path, sag, capsys):
    status, path = run(tmp_path, small_scene(), f'{{"sag": {sag}}}')
    assert status == 1 and not path.exists()
    assert "sag" in capsys.readouterr().err


def test_damage_is_noticed(tmp_path):
    _, path = run(tmp_path, small_scene())
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(ArtefactError, match="casters.npz"):
        casters.load(path)
    x = casters.Casters(**{**vars(load_good(tmp_path, data)), "sag": np.array([-1.0] * 8)})
    with pytest.raises(ArtefactError, match="sag"):
        casters.save(tmp_path / "bad.npz", x)


def load_good(tmp_path, data):
    (tmp_path / "good.npz").write_bytes(data)
    return casters.load(tmp_path / "good.npz")


def plate_with_a_hole(radius, n=40):
    """A plate of side 1 with a round hole; all of it fills the map but for the hole."""
    base = rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0])
    return cut_out(base, [SQUARE, circle((0.5, 0.5), radius, n, is_hole=True)])


def test_which_part_of_its_map_a_surface_fills_is_kept():
    """A plate with a hole, its back, a mesh of six squares, and a surface that fills its map."""
    surfaces = [
        plate_with_a_hole(0.25),
        plate_with_a_hole(0.25),
        cube_mesh(),
        rectangle([3, 0, 0], [1, 0, 0], [0, 1, 0]),
    ]
    x = tessellate.make(surfaces, [False, True, False, False], ["full"] * 4, 1e-3, [-1, 0, -1, -1])
    uv, border = x.part(0)
    e, f = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    hole = 40 / 2 * 0.25**2 * np.sin(2 * np.pi / 40)
    assert (e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]).sum() / 2 == pytest.approx(1 - hole, rel=1e-12)
    side = np.linalg.norm(np.roll(uv, -1, axis=1) - np.roll(uv, 1, axis=1), axis=2)  # opposite to each corner
    assert side[border].sum() == pytest.approx(4 + 40 * 2 * 0.25 * np.sin(np.pi / 40), rel=1e-12)
    assert [len(part) for part in x.part(1)] == [0, 0]
    uv, border = x.part(2)
    assert len(uv) == 0 and border.sum(axis=1).tolist() == [2] * 12  # each square is cut in two
    assert [len(part) for part in x.part(3)] == [0, 0]


def test_a_damaged_part_is_noticed(tmp_path):
    good = vars(tessellate.make([plate_with_a_hole(0.25)], [False], ["full"], 1e-3))
    casters.save(tmp_path / "good.npz", casters.Casters(**good))
    for damage in ({"part_uv": good["part_uv"][1:]}, {"part_start": good["part_start"][::-1]}):
        with pytest.raises(ArtefactError, match="part_start"):
            casters.save(tmp_path / "bad.npz", casters.Casters(**good | damage))


def test_cores_change_no_byte(tmp_path):
    """Sixty plates, each with a hole of its own size: more than one process is worth."""
    plates = {f"plate{k:02}": (plate_with_a_hole(0.2 + 0.004 * k), {}) for k in range(60)}
    scene.save(tmp_path / "scene.npz", scene_of(plates))
    argv = ["--scene", str(tmp_path / "scene.npz"), "--settings", "{}"]
    for threads in ("1", "3"):
        assert tessellate.main([*argv, "--out", str(tmp_path / f"{threads}.npz"), "--threads", threads]) == 0
    assert (tmp_path / "1.npz").read_bytes() == (tmp_path / "3.npz").read_bytes()
