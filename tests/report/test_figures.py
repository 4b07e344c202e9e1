"""Figures of hand-made cost files, budgets and trees, added up by hand."""

import pytest

from lib.report import figures


def cost(stage, seconds, rays, run="now", **more):
    return {
        "stage": stage,
        "seconds": seconds,
        "cpu_seconds": 2 * seconds,
        "peak_mb": 100 * seconds,
        "rays": rays,
        "run": run,
        "notes": {},
        **more,
    }


def test_costs_are_summed_by_stage_in_the_order_of_the_pipeline():
    rows = figures.stage_costs(
        [cost("shoot", 1.0, 0), cost("sample", 0.5, 1000), cost("sample", 0.25, 500), cost("lod_export", 0.1, 0)], "now"
    )
    assert [r["stage"] for r in rows] == ["sample", "shoot", "lod_export"]
    assert rows[0]["jobs"] == 2 and rows[0]["seconds"] == 0.75 and rows[0]["cpu_seconds"] == 1.5
    assert rows[0]["rays"] == 1500 and rows[0]["peak_mb"] == 50


def test_rays_of_this_run_leave_out_what_an_earlier_run_cast():
    rows = figures.stage_costs([cost("sample", 1.0, 1000, "before"), cost("lod_export", 0.5, 0)], "now")
    run = figures.run_totals(rows, "now")
    assert run == {"id": "now", "rays": 0, "seconds": 0.5, "jobs": 1}
    assert [r["is_in_run"] for r in rows] == [False, True]


def test_without_a_run_id_no_job_counts_as_of_this_run():
    rows = figures.stage_costs([cost("sample", 1.0, 1000, "")], "")
    assert figures.run_totals(rows, "")["rays"] == 0 and rows[0]["rays"] == 1000


def test_notes_are_summed_and_savings_named():
    noted = figures.notes([cost("sample", 1, 1, notes={"dim": 3, "x": "text"}), cost("refine", 1, 1, notes={"dim": 4})])
    assert noted == {"dim": 7}
    assert [s["count"] for s in figures.savings({**noted, "cast_only": 2, "black": 0})] == [2, 7]


def test_ledger_sums_groups_and_states_shares():
    rows = figures.ledger(
        {
            "emitted": [[4.0, 3, 2], [0, 0, 1]],
            "received": [[3.0, 3, 2], [0, 0, 1]],
            "absorbed": [[1.0, 1, 1], [0, 0, 1]],
        }
    )
    assert [r[0][:8] for r in rows] == ["emitted", "not rece", "received", "absorbed"]
    assert rows[0][1] == [4, 3, 3] and rows[0][2] == 1.0
    assert rows[1][1] == [1, 0, 0] and rows[1][2] == pytest.approx(0.1)
    assert rows[3][2] == pytest.approx(0.4)


def test_ledger_of_a_dark_scene_has_no_shares():
    assert figures.ledger({"emitted": [[0.0, 0, 0]]}) == [("emitted", [0, 0, 0], None)]


def test_gouraud_needs_two_triangles_a_leaf():
    g = figures.gouraud([100, 20], [{"level": 0, "triangles": 60}, {"level": 1, "triangles": 6}])
    assert g["triangles"] == 240 and [r["times"] for r in g["levels"]] == [4, 40]


def test_budget_rows_list_who_gave_up_and_what():
    def row(name, before, after, saved):
        return {
            "surface": name,
            "level_before": before,
            "level_after": after,
            "size_before": [2**before + 1] * 2,
            "size_after": [2**after + 1] * 2,
            "bytes_before": saved + 10,
            "bytes_after": 10,
            "D": 9.0,
            "D_given_up": 0.5,
        }

    rows = figures.budget_rows({"surfaces": [row("kept", 3, 3, 0), row("wall", 4, 2, 700), row("floor", 5, 4, 900)]})
    assert [(r["name"], r["levels"], r["saved"], r["to"]) for r in rows] == [
        ("floor", 1, 900, "17 \u00d7 17"),
        ("wall", 2, 700, "5 \u00d7 5"),
    ]
