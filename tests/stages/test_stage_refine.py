"""Stage refine: trees that keep their first samples, chunks that agree, light that scales and adds up, refusals."""

from pathlib import Path

import numpy as np
import pytest

from lib.elements.balance import is_balanced
from lib.formats import artefact, radiosity_maps, samples, trees
from lib.nurbs.shape import transformed
from stages import refine
from tests.rooms import Baked, cube, cube_mesh, scene_of
from tests.shapes import cylinder, rectangle

FLOOR, LAMP, SCREEN, TUBE = 0, 1, 2, 3


def still_life(E=(3, 2, 1), second=None):
    """A floor under a lamp, a screen that throws a shadow on it, a tube in the light; by name in this order."""
    lift = np.eye(4)
    lift[:3, 3] = 0.75, 0.5, 0.3
    x = {
        "floor": (rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), {}),
        "lamp": (rectangle([0.4, 0.6, 1], [0.2, 0, 0], [0, -0.2, 0]), {"E": E, "is_black": True}),
        "screen": (rectangle([0.1, 0.1, 0.3], [0.3, 0, 0], [0, 0.8, 0]), {}),
        "tube": (transformed(cylinder(0.1, 0.3), lift), {}),
    }
    if second is not None:
        x["window"] = (
            rectangle([0, 1, 0.5], [0.3, 0, 0], [0, 0, 0.3]),
            {"E": second[0], "group": second[1], "is_black": True},
        )
    return x


LEVELS = {"base_direct": 3, "base_indirect": 2, "max_level": 5}
RHO = {"floor": 0.5, "screen": [0.8, 0.5, 0.2], "tube": 0.7}


def refined(folder, surfaces, chunks=1, halves=("direct", "indirect"), **changes):
    """A bake up to refine, and {half: {surface: Tree}} of all chunks."""
    bake = Baked(folder, scene_of(surfaces), RHO, chunks=chunks, **(LEVELS | changes))
    every = range(chunks)
    assert not any([bake.tessellate(), *(bake.sample(c) for c in every), bake.shoot()])
    assert not any(bake.refine(half, c) for half in halves for c in every)
    found = {}
    for half in halves:
        parts = [trees.load(bake.path(half, c), half)[0] for c in every]
        found[half] = {s: tree for part in parts for s, tree in part.items()}
        assert len(found[half]) == sum(len(part) for part in parts)
    return bake, found


def same(a, b):
    """Two trees, byte by byte."""
    fields = ("ji", "value", "hidden", "noise", "leaves")
    return (a.roots, a.level, a.error) == (b.roots, b.level, b.error) and all(
        getattr(a, f).tobytes() == getattr(b, f).tobytes() for f in fields
    )


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    return refined(tmp_path_factory.mktemp("one"), still_life())


def test_every_surface_with_a_map_has_both_trees(one):
    _, found = one
    assert sorted(found["direct"]) == sorted(found["indirect"]) == [FLOOR, SCREEN, TUBE]
    for half in found.values():
        for tree in half.values():
            assert (tree.value >= 0).all() and np.isfinite(tree.error) and tree.error >= 0


def test_leaves_tile_the_surface_and_their_corners_are_measured(one):
    for half in one[1].values():
        for tree in half.values():
            assert (4.0 ** -tree.leaves[:, 0]).sum() == tree.roots[0] * tree.roots[1]
            known = tree.dense()[1]
            for level, j, i in tree.leaves:
                n = 2 ** (tree.level - level)
                assert known[j * n : (j + 1) * n + 1 : n, i * n : (i + 1) * n + 1 : n].all()


def test_trees_are_balanced(one):
    for tree in one[1]["direct"].values():
        divided = [
            np.zeros((tree.roots[1] << level, tree.roots[0] << level), dtype=bool) for level in range(tree.level)
        ]
        for level, j, i in tree.leaves:
            for up in range(1, level + 1):
                divided[level - up][j >> up, i >> up] = True
        assert is_balanced(divided)


def test_the_shadow_is_refined_and_its_inside_is_not(one):
    tree = one[1]["direct"][FLOOR]
    sizes = np.bincount(tree.leaves[:, 0])
    assert tree.level == 5 and sizes[5] > 0 and sizes[3] > 0


def test_first_samples_are_kept(one):
    """The base lattice of sample stands in the direct tree, unless the rim of a penumbra was looked at again."""
    bake, found = one
    x = samples.load(bake.path("samples", 0))
    for k, s in enumerate(x.surface):
        tree = found["direct"][int(s)]
        step = 2 ** (tree.level - int(x.level[k]))
        value, known, _ = tree.dense()
        base = x.value[x.first[k] : x.first[k + 1]].reshape(*value[::step, ::step].shape)
        assert known[::step, ::step].all()
        assert (value[::step, ::step] == base).all(axis=(2, 3)).mean() > 0.8


def test_three_chunks_hold_what_one_holds(one, tmp_path):
    _, parts = refined(tmp_path, still_life(), chunks=3)
    for half, whole in one[1].items():
        assert sorted(whole) == sorted(parts[half])
        assert all(same(tree, parts[half][s]) for s, tree in whole.items())


def test_the_same_bytes_again(one, tmp_path):
    again, _ = refined(tmp_path, still_life())
    for half in ("direct", "indirect"):
        assert Path(again.path(half, 0)).read_bytes() == Path(one[0].path(half, 0)).read_bytes()


def test_light_that_is_doubled_doubles_everything_exactly(one, tmp_path):
    """A power of two only moves exponents: same trees, same draws, same bits."""
    _, found = refined(tmp_path, still_life(E=(3 * 2**20, 2 * 2**20, 2**20)))
    for half, whole in one[1].items():
        for s, tree in whole.items():
            assert np.array_equal(found[half][s].ji, tree.ji)
            assert np.array_equal(found[half][s].value, tree.value * np.float32(2**20))


def test_groups_add_up_to_all_lamps_at_once(tmp_path):
    """Decisions are taken on the sum over groups: both bakes have the same trees, but for rounding at a threshold."""
    apart = refined(tmp_path / "a", still_life(second=(2.0, 1)))[1]
    together = refined(tmp_path / "b", still_life(second=(2.0, 0)))[1]
    for half in ("direct", "indirect"):
        for s, tree in together[half].items():
            assert apart[half][s].value.shape[1:] == (2, 3) and tree.value.shape[1:] == (1, 3)
            assert np.array_equal(apart[half][s].ji, tree.ji)
            bound = 2e-3 if half == "indirect" else 1e-5  # elements: shooting stops on the sum over groups
            error = np.abs(apart[half][s].value.sum(axis=1) - tree.value[:, 0])
            assert error.max() < bound * tree.value.max()


def test_without_emission_all_is_zero(tmp_path):
    _, found = refined(tmp_path, cube())
    for half in found.values():
        assert not any(tree.value.any() or tree.error for tree in half.values())


def test_one_bounce_has_no_indirect_half(tmp_path):
    bake, found = refined(tmp_path, still_life(), bounces=1)
    assert found["indirect"] == {} and len(found["direct"]) == 3
    assert not len(radiosity_maps.load(bake.path("radiosity", 0)).surface)
    assert bake.refine("indirect", 0, log=["--cost", str(tmp_path / "cost.json")]) == 0
    assert artefact.read_json(tmp_path / "cost.json")["rays"] == 0


def test_tolerances_of_surfaces_count(tmp_path):
    """A floor with a hundred times the tolerance stays at its base; the screen is refined as before."""
    _, found = refined(tmp_path, still_life(), halves=("direct",), tolerances={"floor": 2.0})
    _, fine = refined(tmp_path / "fine", still_life(), halves=("direct",))
    assert len(found["direct"][FLOOR].leaves) < len(fine["direct"][FLOOR].leaves)
    assert len(found["direct"][SCREEN].leaves) == len(fine["direct"][SCREEN].leaves)


@pytest.mark.parametrize("name", ["solution", "samples_0", "casters"])
def test_damaged_files_are_refused_by_name(tmp_path, capsys, name):
    bake = Baked(tmp_path, scene_of(still_life()), RHO)
    assert not any([bake.tessellate(), bake.sample(0), bake.shoot()])
    path = tmp_path / f"{name}.npz"
    path.write_bytes(path.read_bytes()[:-50])
    assert bake.refine("direct", 0) == 1
    said = capsys.readouterr().err
    assert str(path) in said and len(said.strip().splitlines()) == 1
    assert not (tmp_path / "direct_0.npz").exists()


def test_the_other_half_is_refused(one, tmp_path, capsys):
    bake, _ = one
    files = {"casters": "casters", "solution": "solution", "direct": "indirect_0", "radiosity": "radiosity_0"}
    argv = ["--half", "indirect", "--chunk", "0", "--chunks", "1", "--out", str(tmp_path / "x.npz")]
    for name, stem in files.items():
        argv += [f"--{name}", bake.path(stem)]
    assert bake.run(refine, "refine", *argv) == 1
    assert "holds indirect trees, expected direct" in capsys.readouterr().err


def test_less_effort_takes_its_share_of_shadow_rays_and_the_root_of_it_of_gather_rays(tmp_path):
    """A room that is one mesh, with a lamp in it: a quarter of the first and half of the second, for as many samples,
    since only cells that hold two charts are divided.
    """
    surfaces = {"lamp": (rectangle([0.4, 0.4, 0.9], [0, 0.2, 0], [0.2, 0, 0]), {"E": 10.0, "is_black": True})}
    bake, _ = refined(tmp_path, surfaces | {"room": (cube_mesh(), {})}, halves=(), max_level=5)
    same_samples = {"t_direct": 1e9, "t_indirect": 1e9, "gather_rays": 512, "shadow_rays": [16, 16]}
    rays = {}
    for effort in (1.0, 0.25):
        bake.settings["refine"] |= same_samples | {"chart_effort": effort, "chart_coarser": 0}
        for half in ("direct", "indirect"):
            assert bake.refine(half, 0, log=["--cost", str(tmp_path / "cost.json")]) == 0
            rays[half, effort] = artefact.read_json(tmp_path / "cost.json")["rays"]
    assert rays["direct", 0.25] < 0.7 * rays["direct", 1.0]  # the rest asks whether dark samples are buried
    assert 0.45 < rays["indirect", 0.25] / rays["indirect", 1.0] < 0.6
