"""apply_base_texture through its door: a plain wall, a painted wall and a lamp in two light groups."""

import json
from dataclasses import replace

import numpy as np
import pytest

from lib.formats import light_maps, pictures, scene, textured_maps
from lib.maps import base_texture
from lib.maps.colour import srgb_to_linear
from lib.maps.mapset import pack
from lib.nurbs.surface import bilinear
from lib.surfaces.mesh import Mesh
from stages import apply_base_texture

ROUND = 1e-5  # float32 maps


def square(z):
    return bilinear([0, 0, z], [1, 0, z], [1, 1, z], [0, 1, z])


def build(folder, H=None, hidden=None, codes=None):
    """Write scene, maps of surfaces 1 (painted) and 2 (wall), materials and textures; return the stage's options."""
    rng = np.random.default_rng(0)
    names = ["lamp", "painted", "wall"]
    scene.save(
        folder / "scene.npz",
        scene.Scene(
            names=names,
            files=["000-lamp", "001-painted", "002-wall"],
            surfaces=[square(z) for z in (2, 0, 1)],
            front=np.full(3, -1, np.int32),
            flip=np.zeros(3, bool),
            role=["full"] * 3,
            E=np.array([[5, 4, 3], [2, 0, 1], [0, 1, 0]], float),
            group=np.array([1, 0, 0], np.int32),
            groups=["day", "night"],
            is_black=np.zeros(3, bool),
            material=names,
            up="z",
            warnings=[],
        ),
    )
    H = [rng.random((9, 9, 2, 3)), rng.random((3, 3, 2, 3))] if H is None else H
    maps = pack([1, 2], [[1, 1], [1, 1]], [3, 1], H, hidden)
    light_maps.save(folder / "light.npz", light_maps.LightMaps(maps, {"wall": {"depth": 1}}))
    codes = rng.integers(0, 256, (20, 30, 3), np.uint8) if codes is None else codes
    pictures.write_png8(folder / "paint.png", codes)
    rho = base_texture.rho_average(square(0), pictures.read_linear(folder / "paint.png"))
    (folder / "materials.json").write_text(
        json.dumps({"rho_avg": {"lamp": [0, 0, 0], "painted": rho.tolist(), "wall": [0.7, 0.5, 0]}})
    )
    (folder / "textures.json").write_text(
        json.dumps(
            {"textures": {"painted": {"file": str(folder / "paint.png"), "colour_space": "srgb", "repeat": [1, 1]}}}
        )
    )
    return (
        maps,
        rho,
        [
            "--scene",
            str(folder / "scene.npz"),
            "--maps",
            str(folder / "light.npz"),
            "--materials",
            str(folder / "materials.json"),
            "--textures",
            str(folder / "textures.json"),
            "--maps-folder",
            str(folder / "maps"),
            "--out",
            str(folder / "out.npz"),
        ],
    )


def run(folder, options, **settings):
    status = apply_base_texture.main([*options, "--settings", json.dumps(settings)])
    return status, textured_maps.load(folder / "out.npz") if status == 0 else None


def test_groups_are_summed_and_the_painted_wall_gets_its_picture(tmp_path):
    maps, rho_avg, options = build(tmp_path)
    status, out = run(tmp_path, options, texture_level=10)
    assert status == 0 and out.names == ["painted", "wall"] and out.textured.tolist() == [True, False]
    H = [maps.map(k).sum(axis=2) for k in range(2)]
    assert np.allclose(out.light.map(0), H[0] * rho_avg, rtol=ROUND)
    assert np.allclose(out.light.map(1), H[1] * [0.7, 0.5, 0], rtol=ROUND)
    assert np.array_equal(out.final.map(1), out.light.map(1))

    assert out.final.level.tolist() == [5, 1]  # 33 crossings hold 30 x 20 pixels
    H_fine = base_texture.upsample(H[0], np.zeros((9, 9), bool), 2)[0]
    rho = base_texture.evaluate_picture(pictures.read_linear(tmp_path / "paint.png"), (1, 1), 33, 33)
    assert np.allclose(out.final.map(0), H_fine * rho, rtol=ROUND, atol=1e-7)  # the other form of equation (1)
    # the painted wall also emits: its E is in neither map
    assert out.E.tolist() == [[2, 0, 1], [0, 1, 0]] and list(out.pictures.values()) == [[30, 20]]
    assert out.stats == {"wall": {"depth": 1}}


def test_pictures_stand_upright_on_the_wall(tmp_path):
    codes = np.zeros((8, 8, 3), np.uint8)
    codes[:4, :4] = 255  # the top left quarter is white
    _, rho_avg, options = build(tmp_path, H=[np.ones((9, 9, 2, 3)), np.ones((3, 3, 2, 3))], codes=codes)
    out = run(tmp_path, options)[1]
    final = out.final.map(0)[..., 0]
    assert np.allclose(rho_avg, 0.25) and out.final.level[0] == 3
    assert np.allclose(final[[-1, -1, 0, 0], [0, -1, 0, -1]], [2, 0, 0, 0], atol=ROUND)  # H rho, H = 2


def test_intensity_scales_one_group_and_its_lamps(tmp_path):
    maps, rho_avg, options = build(tmp_path)
    out = run(tmp_path, options, intensity={"day": 2, "night": [0, 0.5, 1]})[1]
    H = 2 * maps.map(1)[:, :, 0] + maps.map(1)[:, :, 1] * [0, 0.5, 1]
    assert np.allclose(out.light.map(1), H * [0.7, 0.5, 0], rtol=ROUND)
    assert out.E.tolist() == [[4, 0, 2], [0, 2, 0]]


def test_exr_maps_hold_full_size_light_without_texture_filled_one_texel_deep(tmp_path):
    H, hidden = [np.ones((9, 9, 2, 3)), np.ones((3, 3, 2, 3))], [np.zeros((9, 9), bool), np.zeros((3, 3), bool)]
    hidden[0][:, 4:] = True
    H[0][:, 4:] = 1e6  # rubbish
    _, rho_avg, options = build(tmp_path, H, hidden)
    status, out = run(tmp_path, options)
    assert sorted(p.name for p in (tmp_path / "maps").iterdir()) == ["001-painted.exr", "002-wall.exr"]
    got, metadata = pictures.read_exr(tmp_path / "maps" / "001-painted.exr")
    assert np.allclose(got[:, :5], 2 * rho_avg, rtol=ROUND) and not got[:, 5:].any() and got.shape == (9, 9, 3)
    assert metadata["surface"] == "painted" and metadata["unit"] == "W/m^2" and metadata["uv_domain"] == (0, 1, 0, 1)
    assert np.allclose(metadata["rho_avg"], rho_avg)
    assert out.light.hidden_map(0)[:, 4:].all() and not out.light.map(0)[:, 4:].any()
    assert out.final.hidden_map(0)[:, 16:].all() and not out.final.hidden_map(0)[:, :16].any()
    assert out.final.map(0).max() < 3


def test_black_walls_and_pure_red_pictures(tmp_path):
    codes = np.zeros((4, 4, 3), np.uint8)
    codes[..., 0] = 188
    _, rho_avg, options = build(tmp_path, H=[np.ones((9, 9, 2, 3)), np.ones((3, 3, 2, 3))], codes=codes)
    out = run(tmp_path, options)[1]
    assert np.allclose(out.final.map(0), [2 * srgb_to_linear(188 / 255), 0, 0], rtol=ROUND)
    assert not out.final.map(1)[..., 2].any()


def test_chunks_and_their_order_do_not_matter(tmp_path):
    maps, _, options = build(tmp_path)
    run(tmp_path, options)
    whole = (tmp_path / "out.npz").read_bytes()
    for k, stats in enumerate(({}, {"wall": {"depth": 1}})):
        one = pack(maps.surface[k : k + 1], maps.roots[k : k + 1], maps.level[k : k + 1], [maps.map(k)])
        light_maps.save(tmp_path / f"{k}.npz", light_maps.LightMaps(one, stats))
    for order in ("01", "10"):
        files = [str(tmp_path / f"{k}.npz") for k in order]
        run(tmp_path, [*options[:3], *files, *options[4:]])
        assert (tmp_path / "out.npz").read_bytes() == whole


def test_maps_of_surfaces_the_scene_no_longer_has_are_removed(tmp_path):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "003-gone.exr").write_bytes(b"")
    run(tmp_path, build(tmp_path)[2])
    assert sorted(path.name for path in (tmp_path / "maps").iterdir()) == ["001-painted.exr", "002-wall.exr"]


def test_textures_lie_below_the_folder_of_the_scene(tmp_path):
    options = build(tmp_path)[2]
    run(tmp_path, options)
    whole = (tmp_path / "out.npz").read_bytes()
    textures = tmp_path / "textures.json"
    textures.write_text(textures.read_text().replace(str(tmp_path / "paint.png"), "paint.png"))
    (tmp_path / "folder.json").write_text(json.dumps({"folder": str(tmp_path)}))
    run(tmp_path, options)
    assert (tmp_path / "out.npz").read_bytes() == whole


def charted_mesh():
    """A unit square, two triangles in the middle of its map; its picture lies turned by 90 degrees, T = (v, 1 - u)."""
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    F = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    T = np.stack([corner[:, 1], 1 - corner[:, 0]], axis=1)
    V, N = np.concatenate([corner, np.zeros((4, 1))], axis=1), np.tile([0, 0, 1.0], (2, 3, 1))
    return Mesh(V, F, N, T[F], (0.25 + corner / 2)[F], np.zeros(2, np.int32), 3)


def test_a_painted_mesh(tmp_path):
    """Its picture is white in the top left quarter, T (0..1/2, 1/2..1): u 0..1/2, v 0..1/2 of the square."""
    codes = np.zeros((16, 16, 3), np.uint8)
    codes[:8, :8] = 255
    hidden = [np.ones((9, 9), bool), np.zeros((3, 3), bool)]
    hidden[0][2:7, 2:7] = False
    H = [np.where(hidden[0][..., None, None], 1e6, np.ones((9, 9, 2, 3))), np.ones((3, 3, 2, 3))]
    _, rho_avg, options = build(tmp_path, H, hidden, codes)
    x = scene.load(tmp_path / "scene.npz")
    scene.save(tmp_path / "scene.npz", replace(x, surfaces=[x.surfaces[0], charted_mesh(), x.surfaces[2]]))
    out = run(tmp_path, options)[1]
    assert np.allclose(rho_avg, 0.25) and out.final.level.tolist() == [5, 1]  # 16 pixels on half of the map
    final, away = out.final.map(0)[..., 0], out.final.hidden_map(0)
    assert not away[8:25, 8:25].any() and away[:7].all() and away[:, 26:].all()
    assert np.allclose(final[9:16, 9:16], 2, rtol=ROUND)  # H rho, H = 2
    assert not final[17:24, 9:24].any() and not final[9:24, 17:24].any()


def test_same_input_same_bytes(tmp_path):
    _, _, options = build(tmp_path)
    files = ["out.npz", "maps/001-painted.exr", "maps/002-wall.exr"]
    run(tmp_path, options)
    first = [(tmp_path / name).read_bytes() for name in files]
    run(tmp_path, options)
    assert [(tmp_path / name).read_bytes() for name in files] == first


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"texture_level": -1}, "texture_level: -1, allowed"),
        ({"texture_level": True}, "texture_level"),
        ({"intensity": {"dusk": 1}}, "intensity: dusk: no such light group, the scene has day, night"),
        ({"intensity": {"day": -1}}, "intensity"),
        ({"intensity": {"day": "bright"}}, "intensity: day: 'bright'"),
    ],
)
def test_unfit_settings_are_refused(settings, message, tmp_path, capsys):
    _, _, options = build(tmp_path)
    assert run(tmp_path, options, **settings)[0] == 1
    assert message in capsys.readouterr().err and not (tmp_path / "out.npz").exists()


def test_a_broken_picture_is_refused_with_surface_and_file(tmp_path, capsys):
    _, _, options = build(tmp_path)
    (tmp_path / "paint.png").write_bytes(b"")
    assert run(tmp_path, options)[0] == 1
    said = capsys.readouterr().err
    assert "painted" in said and "paint.png" in said and "empty" in said and not (tmp_path / "out.npz").exists()
