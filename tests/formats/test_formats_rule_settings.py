"""Slices of the settings: each setting moves the slices of the stages that read it, and no other."""

import json
from pathlib import Path

import pytest

from lib import door
from lib.formats import settings as scene_settings
from lib.formats import strict_yaml
from lib.formats.rule_settings import MOST_CHUNKS, lod_levels, n_chunks, rule_settings, short

DEFAULTS = Path(__file__).parents[2] / "config" / "bake.yaml"


def settings(**changed):
    """Resolved default settings of a scene 10 m across; bake__x=1 sets x of bake."""
    tree = json.loads(json.dumps(strict_yaml.read(DEFAULTS, str(DEFAULTS))))
    for name, value in changed.items():
        *path, last = name.split("__")
        part = tree
        for step in path:
            part = part[step]
        part[last] = value
    return scene_settings.resolve(tree, 10.0)


@pytest.mark.parametrize(
    "changed, stages",
    [
        ({"lods": [0.5]}, set()),  # each level has a param of its own
        ({"budget": "2 MiB"}, {"budget_reduce"}),
        ({"export__exposure": 2}, {"package", "first_look"}),
        ({"export__budget_order": "loss_per_byte"}, {"budget_reduce"}),
        ({"camera": {"eye": [0, 0, 1], "target": [1, 1, 1]}}, {"first_look"}),
        ({"up": "y"}, {"first_look"}),  # of the geometry, which has its own slice
        ({"bake__chunks": 3}, set()),  # a param of its own
        ({"bake__tolerance": 0.012}, {"refine", "balance_resample"}),
        ({"bake__tolerance": 0.003}, {"refine", "balance_resample"}),
        ({"bake__relative_to": "surface"}, {"refine", "balance_resample"}),
        ({"bake__max_level": 4}, {"refine"}),
        ({"bake__bounces": 1}, {"sample", "shoot", "refine", "first_look"}),
        ({"bake__seed": 2}, {"sample", "refine", "first_look"}),
        ({"bake__convergence": 0.01}, {"shoot"}),
        ({"bake__sag": 0.01}, {"tessellate"}),
        ({"bake__elements": 100}, {"sample", "shoot"}),
        ({"bake__rays_per_element": 128}, {"sample"}),
        ({"bake__gather_rays": 1008}, {"refine"}),
        ({"bake__texture_level": 5}, {"apply_base_texture"}),
    ],
    ids=str,
)
def test_a_setting_moves_its_slices_alone(changed, stages):
    before, after = rule_settings(settings()), rule_settings(settings(**changed))
    moved = {stage for stage in before if before[stage] != after[stage]}
    assert moved - {"report"} == stages
    assert "report" in moved  # it shows them all


def test_shadow_rays_fixed_by_hand_are_those_of_meshes_too():
    coarse = settings(bake__tolerance=0.02)
    assert json.loads(rule_settings(coarse)["refine"])["chart_effort"] < 1
    fixed = json.loads(rule_settings(settings(bake__tolerance=0.02, bake__shadow_rays=[16, 32]))["refine"])
    assert fixed["chart_effort"] == 1 and fixed["shadow_rays"] == [16, 32]
    fixed = json.loads(rule_settings(settings(bake__tolerance=0.02, bake__gather_rays=512), mesh_cells=1e7)["refine"])
    assert fixed["chart_effort"] == 1 and fixed["gather_rays"] == 512


def test_a_level_is_a_share_of_the_first_if_that_is_none():
    named, other = {"deviation": "1 mm"}, {"triangles": 60}
    assert [share for _, share in lod_levels([named, 0.3, {"share": 0.1}, other])] == [False, True, True, False]
    assert [share for _, share in lod_levels([other, named, 0.3])] == [False, False, True]
    assert [share for _, share in lod_levels([1.0, 0.3, other])] == [False, False, False]
    assert [text for text, _ in lod_levels([named, 0.3])] == ['{"deviation": "1 mm"}', "0.3"]


def test_the_same_settings_in_another_order_are_the_same_text():
    plain = settings()
    turned = dict(reversed([(k, dict(reversed(v.items())) if isinstance(v, dict) else v) for k, v in plain.items()]))
    assert rule_settings(turned) == rule_settings(plain)


def test_no_text_looks_like_a_wildcard_and_none_is_changed():
    warnings = ["surface {c}: flip it", "a \\{wildcards.c} b", "{ input,x} {}", 'quote "{d}"']
    text = rule_settings(settings(), warnings)["report"]
    assert json.loads(text)["warnings"] == warnings
    for name in ("{c", "{wildcards", "{ input", "{d"):
        assert name not in text


def test_thousands_of_warnings_fit_a_command_line():
    warnings = [f"surface number {k}: its corners coincide with those of another" for k in range(5000)]
    text = rule_settings(settings(), warnings)["report"]
    assert len(text) < 50_000 and json.loads(text)["warnings"][-1].startswith("and 4900 more")


def test_long_slices_go_by_file(tmp_path):
    names = [f"teapot number {k} {{c}}/{p:02d}" for k in range(200) for p in range(32)]
    long = rule_settings(settings(), (), {name: 0.1 for name in names}, {name: "gouraud" for name in names})
    found = short(long, tmp_path / "settings")
    assert found["sample"] == long["sample"]  # nothing of a surface
    for stage in ("refine", "balance_resample", "reconstruction", "package", "report"):
        assert found[stage].startswith(f"@{tmp_path}/settings/{stage}-") and len(found[stage]) < 300
        assert door.json_text(found[stage]) == json.loads(long[stage])
    assert sum(map(len, found.values())) < 10_000
    path = Path(found["refine"][1:])
    before = path.stat().st_mtime_ns
    assert short(long, tmp_path / "settings") == found and path.stat().st_mtime_ns == before
    path.write_text("{")
    assert short(long, tmp_path / "settings") == found and path.read_text() == long["refine"]
    moved = short(rule_settings(settings(), (), {name: 0.2 for name in names}), tmp_path / "settings")
    assert moved["refine"] != found["refine"]


def test_chunks_follow_the_scene_and_not_the_tolerance():
    plain = settings()
    assert n_chunks(plain, []) == n_chunks(plain, [1]) == 1
    walls, screws = [0.5] * 400, [0.001] * 400
    assert 1 < n_chunks(plain, screws) < n_chunks(plain, walls) < n_chunks(plain, walls * 2)
    assert n_chunks(plain, walls * 500) == MOST_CHUNKS
    for tolerance in (0.002, 0.009, 0.013, 0.1):
        assert n_chunks(settings(bake__tolerance=tolerance), walls) == n_chunks(plain, walls)
    assert n_chunks(settings(bake__chunks=7), [1]) == 7
    assert 1 < n_chunks(plain, [1], 3_000_000) < n_chunks(plain, [1], 30_000_000)
