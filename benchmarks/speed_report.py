"""speed.md and speed.svg from the rows of benchmarks/run.py: medians, ratios at equal error, figures asked for."""

from statistics import median

import charts
import score

NAMES = {"ours": "this baker", "mitsuba": "Mitsuba 3, points alone", "cycles": "Cycles + OIDN light map"}
# Least ratio of the peer's CPU seconds to ours at the error of its row nearest to the one named.
# The last: what Cycles + OIDN took elsewhere for just that error (benchmarks/reference/README.md).
RATIOS = [("room", 0.0115, 10, 67), ("room", 0.0077, 20, 250), ("cornell", 0.013, 5, 23), ("cornell", 0.0094, 18, 88)]
# CPU seconds that these took where the figures asked for were set: about, and between.
STARTS = {"empty Snakemake run": 1.0, "import open3d": 0.85}
NEAR = 1.15  # as near counts an error within this factor
# Quality: (name, RMSE, p95, {scene: CPU seconds}).
LEVELS = [
    ("preview", 0.02, 0.05, {"cornell": 4, "room": 6}),
    ("standard", 0.01, 0.03, {"cornell": 5, "room": 8}),
    ("final", 0.005, 0.015, {"cornell": 15, "room": 30}),
]
FIGURES = (
    "cpu",
    "apart",
    "wall",
    "scheduling",
    "peak_mb",
    "rays",
    "texels",
    "rmse",
    "p95",
    "bias",
    "by_area",
    "estimate",
)


def medians(rows):
    """One row for each who, scene and setting: the medians of its runs; in the order of their first appearance."""
    groups = {}
    for row in rows:
        groups.setdefault((row["who"], row["scene"], row["setting"]), []).append(row)
    out = []
    for (who, scene, setting), runs in groups.items():
        found = {f: median(r[f] for r in runs) for f in FIGURES if all(f in r for r in runs)}
        out.append({"who": who, "scene": scene, "setting": setting, "runs": len(runs), **found})
    return out


def curve(rows, who, scene, figure="rmse"):
    """[(CPU seconds, error), ...] of one renderer in one scene."""
    return [(r["cpu"], r[figure]) for r in rows if r["who"] == who and r["scene"] == scene]


def write(folder, machine, rows):
    """Write speed.md and speed.svg into a folder."""
    rows = medians(rows)
    scenes = list(dict.fromkeys(r["scene"] for r in rows if r["scene"]))
    (folder / "speed.md").write_text(markdown(machine, rows, scenes), encoding="utf-8")
    lines = [
        (f"{NAMES[who]}, {scene}", sorted(curve(rows, who, scene)))
        for scene in scenes
        for who in NAMES
        if curve(rows, who, scene)
    ]
    percent = [(name, [(cpu, 100 * error) for cpu, error in line if error > 0]) for name, line in lines]
    picture = charts.loglog(
        "Error of irradiance against CPU time", "CPU seconds, all processes", "relative RMSE, %", percent
    )
    (folder / "speed.svg").write_text(picture, encoding="utf-8")


def markdown(machine, rows, scenes):
    """The tables."""
    runs = max(r["runs"] for r in rows)
    text = [
        "# Error against CPU seconds",
        "",
        f"Made by `make bench`; {machine['cores']} cores of {machine['processor']},"
        f" Python {machine['python']}, commit {machine['commit']};"
        f" medians of {runs} run{'s' if runs > 1 else ''} with other seeds."
        " CPU seconds are user + system of all processes;"
        " errors are relative to the mean irradiance of the reference points.",
        "",
        "## This baker, whole pipeline",
        "",
        "CPU: from nothing to maps, textures and levels of detail, Snakemake included,"
        " without `package` and `report`, which a second run adds (apart, with its own start)."
        " Start: Snakemake, shells, interpreters and imports, all that no job accounts for.",
        "",
        "| scene | setting | RMSE, % | 95 %, % | bias, % | RMSE by area, % | as estimated, % | CPU s"
        " | start | apart | wall s"
        " | rays, M | texels, k | memory, MB |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for r in (r for r in rows if r["who"] == "ours"):
        cells = [
            r["scene"],
            r["setting"],
            *_errors(r),
            *(f"{100 * r[f]:.2f}" if f in r else "" for f in ("by_area", "estimate")),
            f"{r['cpu']:.1f}",
            f"{r['scheduling']:.1f}",
        ]
        cells += [
            f"{r['apart']:.1f}",
            f"{r['wall']:.1f}",
            f"{r['rays'] / 1e6:.1f}",
            f"{r['texels'] / 1e3:.0f}",
            f"{r['peak_mb']:.0f}",
        ]
        text.append(_line(cells))
    peers = [r for r in rows if r["who"] not in ("ours", "machine")]
    if peers:
        text += ["", "## Peers", "", "Without their start: seconds begin when their packages are imported.", ""]
        text += [
            "| renderer | scene | setting | RMSE, % | 95 %, % | bias, % | CPU s | ours at this RMSE, CPU s | ratio |",
            "|---|---|---|---|---|---|---|---|---|",
        ]
        for r in peers:
            text.append(
                _line([NAMES[r["who"]], r["scene"], r["setting"], *_errors(r), f"{r['cpu']:.1f}", *_against(rows, r)])
            )
    text += ["", "## Asked for", "", *_machine(rows), *_levels(rows, scenes), *_ratios(rows, scenes)]
    return "\n".join(text) + "\n"


def _line(cells):
    return "| " + " | ".join(cells) + " |"


def _errors(r):
    return [f"{100 * r['rmse']:.2f}", f"{100 * r['p95']:.2f}", f"{100 * r['bias']:+.2f}"]


def _against(rows, r):
    """Our CPU seconds at the error of a peer's row, and the ratio of its seconds to them."""
    mine = curve(rows, "ours", r["scene"])
    cpu = score.cpu_at(mine, r["rmse"]) if mine else None
    if cpu is None and mine and r["rmse"] > score.front(mine)[0][1]:
        least = score.front(mine)[0][0]
        return [f"< {least:.1f}", f"> {r['cpu'] / least:.1f}"]
    return ["", ""] if cpu is None else [f"{cpu:.1f}", f"{r['cpu'] / cpu:.1f}"]


def slower(rows):
    """How much slower the machine is than the one of STARTS: the mean ratio of what both start; 1 where unknown."""
    ratios = [r["cpu"] / STARTS[r["setting"]] for r in rows if r["who"] == "machine"]
    return sum(ratios) / len(ratios) if ratios else 1.0


def _machine(rows):
    found = [(r["setting"], r["cpu"], STARTS[r["setting"]]) for r in rows if r["who"] == "machine"]
    if not found:
        return []
    text = "; ".join(f"{name} {cpu:.2f} CPU s, there about {there:g}" for name, cpu, there in found)
    return [
        "CPU seconds are asked for as on the machine they were set on, and by their ratio to what starts take here and"
        f" took there: {text}. This machine is {slower(rows):.2f} times slower.",
        "",
    ]


def _levels(rows, scenes):
    """CPU seconds at which both errors of a quality are met, against those asked for."""
    out = [
        "| quality | scene | RMSE, % | 95 %, % | CPU s by RMSE | CPU s by 95 % | asked | | asked, by this machine | |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, rmse, p95, asked in LEVELS:
        for scene in (s for s in scenes if curve(rows, "ours", s)):
            found = [
                _reached(curve(rows, "ours", scene, figure), limit) for figure, limit in (("rmse", rmse), ("p95", p95))
            ]
            limits = asked[scene], asked[scene] * slower(rows)
            met = [all(f is not None for f in found) and max(found) <= limit for limit in limits]
            cells = [
                name,
                scene,
                f"{100 * rmse:g}",
                f"{100 * p95:g}",
                *("not reached" if f is None else f"{f:.1f}" for f in found),
            ]
            for limit, is_met in zip(limits, met, strict=True):
                cells += [f"{limit:.2g}", "met" if is_met else "missed"]
            out.append(_line(cells))
    return [*out, ""]


def _reached(line, limit):
    """CPU seconds at which an error is met: interpolated, or the cheapest row if that is already better."""
    enough = [cpu for cpu, error in line if error <= limit]
    if not enough:
        return None
    return score.cpu_at(line, limit) or min(enough)


def _ratios(rows, scenes):
    """Ratios to Cycles + OIDN near the errors named: to its row of this run if one is near, and to its figures
    elsewhere, as they are and as this machine would have taken."""
    out = [
        "| scene | at RMSE, % | Cycles here: RMSE, % | CPU s | ours, CPU s | ratio | Cycles elsewhere, CPU s | ratio"
        " | by this machine | asked | |"
    ]
    out.append("|---|---|---|---|---|---|---|---|---|---|---|")
    for scene, at, asked, elsewhere in RATIOS:
        mine = curve(rows, "ours", scene)
        if scene not in scenes or not mine:
            continue
        theirs = [r for r in rows if r["who"] == "cycles" and r["scene"] == scene]
        near = [r for r in theirs if max(r["rmse"] / at, at / r["rmse"]) <= NEAR]
        cells = ["none near", "", "", ""]
        if near:
            r = min(near, key=lambda r: max(r["rmse"] / at, at / r["rmse"]))
            cells = [f"{100 * r['rmse']:.2f}", f"{r['cpu']:.1f}", *_against(rows, r)]
        cpu = _reached(mine, at)
        ratio, here = (f"{factor * elsewhere / cpu:.1f}" if cpu else "not reached" for factor in (1, slower(rows)))
        found = [float(text.strip("> ")) for text in (cells[3], here) if text.strip("> ").replace(".", "").isdigit()]
        met = bool(found) and min(found) >= asked
        verdict = [ratio, here, str(asked), "met" if met else "missed"]
        out.append(_line([scene, f"{100 * at:g}", *cells, str(elsewhere), *verdict]))
    return out if len(out) > 2 else []
