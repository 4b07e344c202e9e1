"""budget_reduce through its door: two chunks, one budget."""

import dataclasses
import json

import numpy as np
import pytest

from lib.formats import casters, textured_maps
from lib.formats.artefact import read_json
from lib.maps import budget
from lib.maps.mapset import pack
from stages import budget_reduce


def build(folder):
    """Write two chunks (surfaces 0 and 2; 1) and the casters; return the options but for the settings."""
    rng = np.random.default_rng(0)

    def chunk(names, surface, level, amount):
        light = pack(surface, [[1, 1]] * len(surface), [1] * len(surface), [rng.random((3, 3, 3)) for _ in surface])
        final = pack(
            surface,
            [[1, 1]] * len(surface),
            level,
            [rng.random((2**n + 1, 2**n + 1, 3)) * a for n, a in zip(level, amount, strict=True)],
        )
        m = len(names)
        return textured_maps.TexturedMaps(
            names, light, final, np.zeros((m, 3)), np.full((m, 3), 0.5), np.ones(m, bool), {"ab": [100, 50]}, {}
        )

    textured_maps.save(folder / "0.npz", chunk(["apple", "wall"], [0, 2], [4, 5], [1.0, 0.01]))
    textured_maps.save(folder / "1.npz", chunk(["table"], [1], [5], [0.1]))
    n = 3
    casters.save(
        folder / "casters.npz",
        casters.Casters(
            centre=np.zeros(3),
            scale=1.0,
            V=np.zeros((3, 3)),
            UV=np.zeros((3, 2)),
            F=np.array([[0, 1, 2]], np.int32),
            face_surface=np.zeros(1, np.int32),
            face_shell=np.zeros(1, bool),
            area=np.ones(n),
            extent=np.ones((n, 2)),
            sag=np.zeros(n),
            is_planar=np.ones(n, bool),
            is_closed=np.zeros((n, 2), bool),
            is_collapsed=np.zeros((n, 4), bool),
            is_back_to_back=np.zeros(n, bool),
            shell=np.full(n, -1, np.int32),
            borders=np.zeros((0, 5), np.int32),
            part_start=np.zeros((n + 1, 2), np.int64),
            part_uv=np.zeros((0, 3, 2)),
            part_border=np.zeros((0, 3), bool),
        ),
    )
    return [
        "--maps",
        str(folder / "0.npz"),
        str(folder / "1.npz"),
        "--casters",
        str(folder / "casters.npz"),
        "--out",
        str(folder / "textures.npz"),
        "--table",
        str(folder / "budget.json"),
    ]


def run(folder, options, **settings):
    status = budget_reduce.main([*options, "--settings", json.dumps(settings)])
    return status, *(
        (textured_maps.load(folder / "textures.npz"), read_json(folder / "budget.json"))
        if status == 0
        else (None, None)
    )


FULL = budget.gpu_bytes(17, 17) + 2 * budget.gpu_bytes(33, 33)


def test_a_budget_that_holds_changes_nothing(tmp_path):
    options = build(tmp_path)
    status, out, table = run(tmp_path, options, budget=FULL)
    assert status == 0 and out.names == ["apple", "table", "wall"] and out.final.level.tolist() == [4, 5, 5]
    assert np.array_equal(out.final.map(1), textured_maps.load(tmp_path / "1.npz").final.map(0))
    assert table["S_before"] == table["S_after"] == FULL and table["steps"] == [] and table["lost"] == 0


def test_the_least_detail_is_given_up_and_the_table_says_who(tmp_path):
    options = build(tmp_path)
    T = FULL - 1
    _, out, table = run(tmp_path, options, budget=T, profile="standard")
    assert out.final.level.tolist() == [4, 5, 4]  # the wall's texture is faint
    rows = {row["surface"]: row for row in table["surfaces"]}
    assert rows["wall"]["size_before"] == [33, 33] and rows["wall"]["size_after"] == [17, 17]
    assert rows["wall"]["D_given_up"] == rows["wall"]["D"] > 0 == rows["apple"]["D_given_up"]
    S = sum(budget.gpu_bytes(*row["size_after"]) for row in table["surfaces"])
    assert S == table["S_after"] == sum(row["bytes_after"] for row in table["surfaces"]) <= T
    w, h = out.final.sizes()
    assert S == sum(budget.gpu_bytes(int(a), int(b)) for a, b in zip(w, h, strict=True))
    assert [step["surface"] for step in table["steps"]] == ["wall"] and table["steps"][-1]["S"] == S


def test_a_smaller_budget_does_not_change_the_brightness(tmp_path):
    options = build(tmp_path)
    whole, reduced = (run(tmp_path, options, budget=T)[2]["exposure"] for T in (FULL, FULL // 4))
    assert reduced == whole > 0


def test_the_light_map_profile_reduces_the_light_and_counts_pictures_as_fixed(tmp_path):
    options = build(tmp_path)
    fixed = budget.gpu_bytes(100, 50)  # one file on three surfaces counts once
    _, out, table = run(tmp_path, options, budget=fixed + 60, profile="lightmap")
    assert out.light.level.tolist() == [0] * 3 and out.final.level.tolist() == [4, 5, 5]
    assert table["fixed"] == fixed and table["S_after"] == fixed + 60


def test_chunks_and_their_order_do_not_matter(tmp_path):
    options = build(tmp_path)
    run(tmp_path, options, budget=5000)
    first = (tmp_path / "textures.npz").read_bytes(), (tmp_path / "budget.json").read_bytes()
    options[1], options[2] = options[2], options[1]
    run(tmp_path, options, budget=5000)
    assert ((tmp_path / "textures.npz").read_bytes(), (tmp_path / "budget.json").read_bytes()) == first


@pytest.mark.parametrize("T", [59, 0, -1, "64 MiB", True, None, float("nan")])
def test_an_unfit_budget_is_refused_with_the_smallest_total(T, tmp_path, capsys):
    options = build(tmp_path)
    assert run(tmp_path, options, budget=T)[0] == 1
    assert "60 bytes" in capsys.readouterr().err and not (tmp_path / "textures.npz").exists()


def test_an_unknown_profile_or_order_is_refused(tmp_path, capsys):
    assert run(tmp_path, build(tmp_path), budget=FULL, order="size")[0] == 1
    assert "order: 'size', allowed are loss and loss_per_byte" in capsys.readouterr().err
    assert run(tmp_path, build(tmp_path), budget=FULL, profile="fast")[0] == 1
    assert "profile: 'fast', allowed are standard and lightmap" in capsys.readouterr().err


@pytest.mark.parametrize("contrast, is_told", [(0.5, True), (0.04, False)])
def test_where_the_order_loses_much_a_warning_says_what_the_other_would(tmp_path, capsys, contrast, is_told):
    """A small apple of chess board, and a wall of faint noise that counts more in sum: by the paper's rule the apple
    gives up all of it for a few bytes, and the wall has to go down nevertheless."""
    options, rng = build(tmp_path), np.random.default_rng(2)
    board = 1 + contrast * (np.indices((5, 5)).sum(axis=0) % 2 * 2 - 1)[..., None] * np.ones(3)
    wall = 1 + 0.1 * rng.random((33, 33, 3))
    x = textured_maps.load(tmp_path / "0.npz")
    final = pack([0, 2], [[1, 1]] * 2, [2, 5], [board, wall])
    textured_maps.save(tmp_path / "0.npz", dataclasses.replace(x, final=final))
    x = textured_maps.load(tmp_path / "1.npz")
    textured_maps.save(tmp_path / "1.npz", dataclasses.replace(x, final=pack([1], [[1, 1]], [0], [np.ones((2, 2, 3))])))
    T = sum(budget.gpu_bytes(n, n) for n in (2, 5, 17))
    _, _, table = run(tmp_path, options, budget=T)
    said = capsys.readouterr().err
    assert ("export: {budget_order: loss_per_byte}" in said) == is_told == (table["lost"] > 0.03)
    _, out, by_bytes = run(tmp_path, options, budget=T, order="loss_per_byte")
    assert out.final.level.tolist() == [2, 0, 4] and 0 < by_bytes["lost"] < 0.01
    assert not capsys.readouterr().err
    if is_told:
        assert f"{100 * table['lost']:.2g} % off" in said and f"{100 * by_bytes['lost']:.2g} % with" in said
