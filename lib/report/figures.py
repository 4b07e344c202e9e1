"""The figures of report.json, from what the stages left behind: plain numbers in, plain dicts out."""

import math

import numpy as np

from lib.report import seams, surfaces

STAGES = [
    "preflight",
    "import_scene",
    "tessellate",
    "sample",
    "shoot",
    "refine",
    "refine direct",
    "refine indirect",
    "balance_resample",
    "apply_base_texture",
    "budget_reduce",
    "thin_meshes",
    "lod_export",
    "package",
    "report",
]
SAVINGS = {
    "cast_only": ("surfaces that only cast shadows: no elements, no map", "surfaces"),
    "receive_only": ("surfaces that only receive: not in the shadow mesh", "surfaces"),
    "black": ("black surfaces: no element row", "surfaces"),
    "below_horizon": ("lights below the horizon or behind: no shadow ray", "pairs of sample and light"),
    "dim": ("dim lights counted as unblocked", "pairs of sample and light"),
    "agreed": ("lights whose first shadow rays agreed", "pairs of sample and light"),
    "hidden_points": ("points of elements buried in other things: no part of any row", "points"),
    "hidden_samples": ("samples buried in other things: not refined, not interpolated", "texels"),
    "no_rows": ("one bounce, or no light: no element row", "elements"),
    "no_gather": ("one bounce, or no light: no final gather", "surfaces"),
    "few_texels": ("maps that ended at their root grid", "maps"),
    "one_colour": ("maps of one even colour: no texture", "maps"),
    "levels_dropped": ("deepest levels dropped before writing, all within a quarter of the tolerance", "levels"),
}

COUNTED = {*SAVINGS, "levels_removed", "textured_surfaces"}


def stage_costs(costs, run):
    """One row a stage in the order of the pipeline: seconds, CPU seconds, rays summed over its jobs, the largest peak.

    costs : dicts as the doors write them (stage, chunk, seconds, cpu_seconds, peak_mb, rays, run, notes)
    run : id of the run that is reported; "" means that no job belongs to it
    """
    rows = {}
    for c in costs:
        row = rows.setdefault(
            c["stage"],
            {
                "stage": c["stage"],
                "jobs": 0,
                "seconds": 0.0,
                "cpu_seconds": 0.0,
                "peak_mb": 0.0,
                "rays": 0,
                "rays_in_run": 0,
                "seconds_in_run": 0.0,
                "jobs_in_run": 0,
            },
        )
        is_in_run = bool(run) and c.get("run", "") == run
        row["jobs"] += 1
        for key in ("seconds", "cpu_seconds", "rays"):
            row[key] += c[key]
        row["peak_mb"] = max(row["peak_mb"], c["peak_mb"])
        row["rays_in_run"] += c["rays"] * is_in_run
        row["seconds_in_run"] += c["seconds"] * is_in_run
        row["jobs_in_run"] += int(is_in_run)
    order = {name: k for k, name in enumerate(STAGES)}
    listed = sorted(rows.values(), key=lambda r: (order.get(r["stage"], len(STAGES)), r["stage"]))
    for row in listed:
        row["is_in_run"] = row["jobs_in_run"] > 0
        for key in ("seconds", "cpu_seconds", "seconds_in_run"):
            row[key] = round(row[key], 4)
    return listed


def notes(costs):
    """Counts the jobs noted (`COUNTED`), summed by name."""
    total = {}
    for c in costs:
        for key, value in (c.get("notes") or {}).items():
            if (
                key in COUNTED
                and isinstance(value, int | float)
                and not isinstance(value, bool)
                and math.isfinite(value)
            ):
                total[key] = total.get(key, 0) + value
    return total


def savings(counted):
    """Rows {what, count, unit} of what was not computed; counted : {name of SAVINGS or any other: number}."""
    known = [
        {"what": what, "count": counted[key], "unit": unit} for key, (what, unit) in SAVINGS.items() if counted.get(key)
    ]
    return known


def ledger(powers):
    """Rows (label, rgb, share of emitted) of the solver's powers, each (G, 3) or (3,), in a fixed order.

    What is emitted and not received by any element is a row of its own: light that leaves the scene at once, light on
    surfaces without elements, and the quadrature of direct light.
    """
    rgb = {}
    for name, value in powers.items():
        rows = value if len(value) and isinstance(value[0], list | tuple) else [value]
        rgb[name] = [float(sum(r[c] for r in rows)) for c in range(3)]
    if "emitted" in rgb and "received" in rgb:
        rgb["not received"] = [e - r for e, r in zip(rgb["emitted"], rgb["received"], strict=True)]
    base = next((sum(rgb[n]) for n in ("emitted", "received") if n in rgb and sum(rgb[n]) > 0), 0.0)
    order = ["emitted", "not received", "received", "absorbed", "escaped", "unshot", "residue"]
    names = [n for n in order if n in rgb] + sorted(n for n in rgb if n not in order)
    labels = {
        "received": "received directly by elements",
        "residue": "quadrature residue: gathered less shot",
        "not received": "not received: past all elements, and quadrature",
        "escaped": "escaped after a reflection, or ended on lamps and back faces",
    }
    return [(labels.get(n, n.replace("_", " ")), rgb[n], sum(rgb[n]) / base if base else None) for n in names]


def gouraud(leaves, levels):
    """Triangles the same light would need as Gouraud-shaded elements (two a leaf), against the levels of detail.

    leaves : number of quadtree leaves of each surface with a map; levels : rows with level and triangles of the same
    surfaces (`mapped_triangles` where a level also draws surfaces without a map)
    """
    triangles = 2 * int(sum(leaves))
    rows = []
    for level in levels:
        n = level.get("mapped_triangles", level["triangles"])
        rows.append({"level": level["level"], "triangles": n, "times": triangles / n if n and triangles else None})
    return {"triangles": triangles, "levels": rows}


def budget_rows(table):
    """Rows of the surfaces that gave something up, those that lost most bytes first, from budget.json."""
    rows = []
    for s in table["surfaces"]:
        if s["level_after"] < s["level_before"]:
            rows.append(
                {
                    "name": s["surface"],
                    "from": "{} \u00d7 {}".format(*s["size_before"]),
                    "to": "{} \u00d7 {}".format(*s["size_after"]),
                    "levels": s["level_before"] - s["level_after"],
                    "saved": s["bytes_before"] - s["bytes_after"],
                    "D_i": s["D_given_up"],
                }
            )
    return sorted(rows, key=lambda r: (-r["saved"], r["name"]))


def totals(stages, surfaces, levels, memory, unshot, error):
    """The headline numbers."""
    return {
        "surfaces": len(surfaces),
        "maps": sum(s["map"] is not None for s in surfaces),
        "triangles": levels[0]["triangles"] if levels else None,
        "texture_bytes": memory["after"],
        "rays": sum(s["rays"] for s in stages),
        "seconds": round(sum(s["seconds"] for s in stages), 3),
        "cpu_seconds": round(sum(s["cpu_seconds"] for s in stages), 3),
        "peak_mb": max((s["peak_mb"] for s in stages), default=0.0),
        "error": error,
        "unshot": unshot,
    }


def run_totals(stages, run):
    """Rays, seconds and jobs of the run alone."""
    return {
        "id": run,
        "rays": sum(s["rays_in_run"] for s in stages),
        "seconds": round(sum(s["seconds_in_run"] for s in stages), 3),
        "jobs": sum(s["jobs_in_run"] for s in stages),
    }


def level_rows(lods):
    """The levels of lods.json with what the report shows of each."""
    rows = []
    for k, level in enumerate(lods["levels"]):
        rows.append(
            {
                "level": k,
                "file": level["file"],
                "triangles": level["triangles"],
                "vertices": level.get("vertices"),
                "max_distance": level.get("max_distance"),
                "rms_distance": level.get("rms_distance"),
                "gap": level.get("gap"),
                "coverage": level.get("screen_coverage"),
                "slide": level.get("max_slide"),
                "asked": level.get("asked"),
                "note": level.get("note") or "",
                "bytes": level.get("bytes"),
            }
        )
        rows[-1]["share"] = level["triangles"] / rows[0]["triangles"] if rows[0]["triangles"] else None
        if level.get("mapped_triangles") is not None:
            rows[-1]["mapped_triangles"] = level["mapped_triangles"]
    return rows


def exported_seams(bake, maps, mean_H, normals):
    """The same as the seams of the maps, of the exported ones: within the budget, which treats neighbours apart."""
    if maps is None:
        return []
    H = seams.exported_irradiance(maps, bake.textures.rho_avg, bake.textures.textured)
    return seams.rows(bake.scene, bake.casters, H, mean_H, normals)


def counted(bake, rows):
    """Savings by name, counted here or noted by the jobs."""
    noted = notes([{"notes": facts} for facts in bake.tree_facts])
    noted = {**noted, **{k: v for k, v in notes(bake.costs).items() if k in SAVINGS}}
    pictures = bake.lods.get("textures") or {}
    return {
        **noted,
        "cast_only": sum(row["role"] == "cast_only" for row in rows),
        "receive_only": sum(row["role"] == "receive_only" for row in rows),
        "black": sum(row["is_black"] for row in rows),
        "one_colour": sum(row["map"] is not None and row["name"] not in pictures for row in rows) if pictures else 0,
        "few_texels": sum(row["map"] is not None and row["map"] == [r + 1 for r in row["roots"]] for row in rows),
    }


def collect(name, bake, settings, run):
    """The dict of report.json.

    name : of the scene; bake : has the fields of lib.formats.bake_files.Bake
    settings : {"settings": what the bake used or None, "warnings": [text]}; run : id of the run, "" for none
    """
    scene, solution = bake.scene, bake.solution
    none = dict.fromkeys(("T", "S_before", "S_after", "order", "lost"))
    table = bake.budget or {**none, "surfaces": [], "profile": "standard"}
    exported_maps = getattr(bake.textures, "light" if table["profile"] == "lightmap" else "final", None)
    mean_H = float(np.max(solution.mean_H)) if solution is not None else 0.0  # as the thresholds have it
    D_i, ways = {s["surface"]: s["D"] for s in table["surfaces"]}, settings.get("reconstruction", {})
    rows = surfaces.rows(scene, bake.trees, bake.maps, exported_maps, D_i, mean_H, ways)
    for row, extent in zip(rows, bake.casters.extent, strict=True):
        row["aspect"] = float(extent[0] / extent[1]) if extent[1] > 0 else None
    normals = {}  # along borders, which both kinds of seams ask for
    stages = stage_costs(bake.costs, run)
    levels = level_rows(bake.lods)
    history = solution.history if solution is not None and len(solution.history) else np.zeros((0, 2))
    memory = {
        "budget": table["T"],
        "before": table["S_before"],
        "after": table["S_after"],
        "disk": bake.lods.get("texture_bytes"),
        "order": table["order"],
        "lost": table["lost"],
    }
    unshot = float(history[-1, 1]) if len(history) else None
    return {
        "scene": name,
        "version": 1,
        "run": run_totals(stages, run),
        "totals": totals(stages, rows, levels, memory, unshot, surfaces.overall_error(rows, bake.casters.area)),
        "stages": stages,
        "surfaces": rows,
        "levels": levels,
        "shoot": {
            "shots": history[:, 0].tolist(),
            "history": history[:, 1].tolist(),
            "unshot": unshot,
            "target": (settings.get("settings") or {}).get("bake", {}).get("convergence"),
            "facts": solution.facts if solution is not None else {},
        },
        "ledger": ledger(solution.ledger) if solution is not None else [],
        "memory": memory,
        "budget": budget_rows(table),
        "gouraud": gouraud([row["leaves"] for row in rows], levels),
        "savings": savings(counted(bake, rows)),
        "notes": notes(bake.costs),
        "seams": seams.rows(bake.scene, bake.casters, bake.maps, mean_H, normals),
        "seams_exported": exported_seams(bake, exported_maps, mean_H, normals),
        "exposure": bake.lods.get("exposure"),
        "settings": settings.get("settings"),
        "warnings": list(dict.fromkeys([*scene.warnings, *settings.get("warnings", [])])),
    }
