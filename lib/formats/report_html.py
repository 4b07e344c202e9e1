"""report.html: one offline file, everything inlined, readable in light and dark.

The page is made from the figures of report.json, pictures as PNG bytes, and the viewer's bundle; nothing is computed
here. Names and settings are user text: every one passes through `html.escape`, and JSON inside a script has its
`<` escaped, so no name can end the element it stands in.
"""

import base64
import json
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from lib.formats.artefact import atomic
from lib.report import charts

HERE = Path(__file__).parent / "viewer"
STYLE = HERE / "report.css"
SORTER = HERE / "report.js"
BUNDLE = HERE / "viewer.bundle.js"
POLICY = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
    "connect-src data: blob:"
)


@dataclass(frozen=True)
class Thumbnail:
    """A surface's map as PNG bytes, samples (w, h) in it, and cell borders as an SVG path over width x height cells.

    Samples lie on the crossings of cells, borders included, so the picture reaches half a sample over the border.
    """

    png: bytes
    samples: tuple
    path: str
    width: int
    height: int


@dataclass(frozen=True)
class Pictures:
    """PNG bytes: the finest level; per level the picture and the picture with its triangles; thumbnails by name."""

    hero: bytes | None = None
    levels: list = field(default_factory=list)
    thumbnails: dict = field(default_factory=dict)


def save(path, figures, pictures, model=None):
    """Write the page. model: what the viewer shows (see `viewer_model`), or None for a page without one."""
    with atomic(path) as file:
        file.write(page(figures, pictures, model).encode())


def page(figures, pictures, model=None):
    """The whole page as text.

    figures : dict of lib.report.figures, pictures : Pictures
    model : dict for the viewer, or None
    """
    name = escape(str(figures["scene"]))
    sections = [
        _head(figures, pictures),
        _warnings(figures),
        _viewer(model),
        _levels(figures, pictures),
        _light(figures),
        _cost(figures),
        _surfaces(figures, pictures),
        _budget(figures),
        _gouraud(figures),
        _savings(figures),
        _seams(figures),
        _settings(figures),
    ]
    scripts = f"<script>{_script(SORTER)}</script>"
    if model is not None:
        scripts += (
            f'<script type="application/json" id="model">{_json(model)}</script><script>{_script(BUNDLE)}</script>'
        )
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{name} - bake report</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="color-scheme" content="light dark"><link rel="icon" href="data:,">'
        f"<style>{STYLE.read_text(encoding='utf-8')}</style></head>\n"
        f"<body><main>{''.join(sections)}</main>{scripts}</body></html>\n"
    )


# Pieces of a page


def _section(title, body, note="", ident=""):
    if not body:
        return ""
    note = f'<p class="note">{note}</p>' if note else ""
    return f'<section id="{ident}"><h2>{title}</h2>{note}{body}</section>\n'


def _table(head, rows, kinds="", is_sortable=False):
    """A table; kinds: a letter a column, n number, t text. A cell: text already escaped, or (shown, value to sort by)."""
    if not rows:
        return ""
    css = {"n": "num", "t": ""}
    cells = lambda row: "".join(  # noqa: E731
        f'<td class="{css[k]}" data-value="{escape(str(c[1]))}">{c[0]}</td>'
        if isinstance(c, tuple)
        else f'<td class="{css[k]}">{c}</td>'
        for c, k in zip(row, kinds, strict=True)
    )
    top = "".join(f'<th class="{css[k]}">{h}</th>' for h, k in zip(head, kinds, strict=True))
    sort = " sortable" if is_sortable else ""
    return (
        f'<div class="scroll"><table class="{sort.strip()}"><thead><tr>{top}</tr></thead><tbody>'
        + "".join(f"<tr>{cells(row)}</tr>" for row in rows)
        + "</tbody></table></div>"
    )


def _image(png, alt, css=""):
    return f'<img class="{css}" alt="{escape(alt)}" src="{_data(png)}">' if png else ""


def _data(png):
    return "data:image/png;base64," + base64.b64encode(png).decode()


def _json(value):
    return json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _script(path):
    return path.read_text(encoding="utf-8").replace("</script", "<\\/script")


# Numbers as people read them


def count(n):
    """A whole number with thousands apart, or shortened from a million on.

    >>> count(12345), count(3_240_000), count(None)
    ('12\\u202f345', '3.24 M', '\\u2013')
    """
    if n is None:
        return "\u2013"
    for size, letter in ((1e9, "G"), (1e6, "M")):
        if abs(n) >= size:
            return f"{n / size:.3g} {letter}"
    return f"{n:,.0f}".replace(",", "\u202f")


def number(x, digits=3):
    """A measured number with some digits.

    >>> number(0.012345), number(1234.5), number(0), number(None)
    ('0.0123', '1234', '0', '\\u2013')
    """
    if x is None:
        return "\u2013"
    if abs(x) >= 10**digits:
        return f"{x:.0f}"
    return f"{x:.{digits}g}"


def size(n):
    """Bytes.

    >>> size(512), size(65536), size(3_500_000)
    ('512 B', '64 KiB', '3.34 MiB')
    """
    if n is None:
        return "\u2013"
    for unit, name in ((2**30, "GiB"), (2**20, "MiB"), (2**10, "KiB")):
        if n >= unit:
            return f"{n / unit:.3g} {name}" if n < 1000 * unit else f"{n / unit:.0f} {name}"
    return f"{n:.0f} B"


def share(x, digits=2):
    """A share in per cent.

    >>> share(0.0123), share(1), share(None)
    ('1.2 %', '100 %', '\\u2013')
    """
    return "\u2013" if x is None else f"{number(100 * x, max(digits, 3 if abs(x) >= 0.995 else digits))} %"


def length(x):
    """A length in metres.

    >>> length(0.00012), length(0.034), length(2.5)
    ('0.12 mm', '34 mm', '2.5 m')
    """
    if x is None:
        return "\u2013"
    return f"{number(1000 * x)} mm" if abs(x) < 1 else f"{number(x)} m"


# The sections


def _head(figures, pictures):
    totals = figures["totals"]
    tiles = [
        (count(totals["surfaces"]), "surfaces"),
        (count(totals["triangles"]), "triangles, finest level"),
        (size(totals["texture_bytes"]), "of texture memory, mips included"),
        (count(totals["rays"]), "rays in the bake"),
        (f"{number(totals['seconds'])} s", "in all jobs together"),
        (share(totals["error"]), "estimated error of the maps"),
        (share(totals["unshot"]), "of the power left unshot"),
    ]
    tiles = "".join(f"<li><b>{value}</b><span>{label}</span></li>" for value, label in tiles if value[:1] != "\u2013")
    name = escape(str(figures["scene"]))
    run = figures["run"]
    this = (
        f"Rays cast in the run that wrote this page: <b>{count(run['rays'])}</b> "
        f"in {number(run['seconds'])} s of {count(run['jobs'])} jobs."
    )
    hero = _image(pictures.hero, f"{figures['scene']}, finest level", "hero")
    caption = (
        (
            "The finest level as an unlit viewer shows it: a ray-cast picture of the exported files, textures "
            "only, no light added."
        )
        if hero
        else ""
    )
    return (
        f'<header><p class="over">Bake report</p><h1>{name}</h1></header>'
        f"<figure>{hero}<figcaption>{caption}</figcaption></figure>"
        f'<ul class="tiles">{tiles}</ul><p class="note">{this}</p>\n'
    )


def _warnings(figures):
    items = "".join(f"<li>{escape(str(w))}</li>" for w in figures["warnings"])
    return _section("Warnings", f'<ul class="warnings">{items}</ul>' if items else "", ident="warnings")


def _viewer(model):
    if model is None:
        return ""
    buttons = "".join(f'<button data-level="{k}">Level {k}</button>' for k in range(len(model["levels"])))
    body = (
        f'<div class="viewer" id="viewer"><canvas tabindex="0" aria-label="3D view"></canvas>'
        f'<div class="controls"><span class="group">{buttons}</span>'
        '<label><input type="checkbox" name="edges"> triangles</label>'
        '<label><input type="checkbox" name="texels"> texels</label>'
        '<label><input type="checkbox" name="backs"> back faces</label>'
        "<button data-home>view</button><output></output></div></div>"
    )
    return _section(
        "Look around",
        body,
        "Drag to turn, right drag to move, wheel to come closer. All levels draw from the same textures.",
        "look",
    )


def _levels(figures, pictures):
    rows = []
    for level in figures["levels"]:
        rows.append(
            [
                f"{level['level']}",
                escape(str(level["file"])),
                count(level["triangles"]),
                count(level["vertices"]),
                share(level.get("share")),
                length(level["max_distance"]),
                length(level["rms_distance"]),
                length(level["gap"]),
                share(level["coverage"]),
                size(level["bytes"]),
            ]
        )
    table = _table(
        [
            "level",
            "file",
            "triangles",
            "vertices",
            "of finest",
            "largest distance",
            "RMS distance",
            "widest gap",
            "screen cover",
            "geometry",
        ],
        rows,
        "ttnnnnnnnn",
    )
    shots = "".join(
        f"<figure>{_image(plain, f'level {k}')}{_image(edges, f'level {k}, triangles')}"
        f"<figcaption>Level {k}: {count(figures['levels'][k]['triangles'])} triangles</figcaption></figure>"
        for k, (plain, edges) in enumerate(pictures.levels)
    )
    return _section(
        "Levels of detail",
        table + (f'<div class="shots">{shots}</div>' if shots else ""),
        "Distances are to the exact surfaces; a gap is the widest opening between neighbours along a shared "
        "border. Every level names the same texture files.",
        "levels",
    )


def _light(figures):
    shoot = figures["shoot"]
    chart = charts.convergence(shoot["shots"], shoot["history"], shoot["target"])
    if chart:
        chart = f"<figure>{chart}<figcaption>Unshot power, as a share of the start</figcaption></figure>"
    rows = [
        [escape(label), *(number(x, 5) for x in rgb), number(sum(rgb), 5), share(part, 3)]
        for label, rgb, part in figures["ledger"]
    ]
    ledger = _table(["power [W]", "red", "green", "blue", "sum", "of emitted"], rows, "tnnnnn")
    return _section(
        "Light",
        chart + ledger,
        "Emitted = not received + received; received = absorbed + escaped + unshot, to rounding; the residue is the "
        "reflected power of the gathered solution less that of the shot one.",
        "light",
    )


def _cost(figures):
    stages = figures["stages"]
    if not stages:
        return ""
    most = {key: max(max(s[key] for s in stages), 1e-12) for key in ("seconds", "rays")}
    rows = []
    for s in stages:
        bars = [
            (
                f'<span class="bar"><i style="width:{100 * s[key] / most[key]:.1f}%"></i></span><span>{text}</span>',
                s[key],
            )
            for key, text in (("seconds", number(s["seconds"])), ("rays", count(s["rays"])))
        ]
        rows.append(
            [
                escape(str(s["stage"])),
                count(s["jobs"]),
                bars[0],
                number(s["cpu_seconds"]),
                f"{number(s['peak_mb'])} MB",
                bars[1],
                "yes" if s["is_in_run"] else "kept",
            ]
        )
    total = figures["totals"]
    rows.append(
        [
            "<b>all</b>",
            count(sum(s["jobs"] for s in stages)),
            f"<b>{number(total['seconds'])}</b>",
            number(total["cpu_seconds"]),
            f"{number(total['peak_mb'])} MB",
            f"<b>{count(total['rays'])}</b>",
            "",
        ]
    )
    table = _table(["stage", "jobs", "seconds", "CPU seconds", "peak memory", "rays", "this run"], rows, "tnnnnnt")
    return _section(
        "Cost", table, "Seconds of all jobs of a stage added up; start-up of the interpreter not included.", "cost"
    )


def _surfaces(figures, pictures):
    surfaces = figures["surfaces"]
    cards = []
    for s in surfaces:
        thumb = pictures.thumbnails.get(s["name"])
        if thumb is None:
            continue
        lines = f'<path d="{thumb.path}"/>' if thumb.path else ""
        cards.append(
            f'<figure><svg viewBox="0 0 {thumb.width} {thumb.height}" preserveAspectRatio="none" '
            f'style="aspect-ratio:{_aspect(s, thumb)}"><image href="{_data(thumb.png)}" {_box(thumb)} '
            f'preserveAspectRatio="none"/>{lines}</svg>'
            f"<figcaption>{escape(s['name'])}<small>{_map_size(s)}</small></figcaption></figure>"
        )
    gallery = ""
    if cards:
        left = sum(s["map"] is not None for s in surfaces) - len(cards)
        more = f'<p class="note">{count(left)} smaller maps are in the table only.</p>' if left > 0 else ""
        gallery = (
            '<p><label><input type="checkbox" id="lines" checked> quadtree lines</label></p>'
            f'<div class="maps">{"".join(cards)}</div>{more}'
        )
    rows = [
        [
            escape(s["name"]),
            escape(str(s["role"])),
            _map_size(s),
            (number(s["depth"]), s["depth"] or 0),
            _texture_size(s),
            (size(s["bytes"]), s["bytes"] or 0),
            (number(s["D_i"]), s["D_i"] or 0),
            (share(s["error"]), s["error"] or 0),
            (count(s["samples"]), s["samples"] or 0),
            (share(s["hidden"]), s["hidden"] or 0),
        ]
        for s in surfaces
    ]
    table = _table(
        ["surface", "role", "map", "depth", "texture", "GPU bytes", "D<sub>i</sub>", "error", "samples", "buried"],
        rows,
        "ttnnnnnnnn",
        is_sortable=True,
    )
    table = (
        f"<details{' open' if len(rows) <= 40 else ''}><summary>{count(len(rows))} surfaces</summary>{table}</details>"
    )
    return _section(
        "Illumination maps",
        gallery + table,
        "Reflected light of each surface over its own parameters, u to the right, v up. Lines are the cells "
        "of the adaptive samples; violet ones are buried. The error is an estimate relative to the scene's mean light.",
        "maps",
    )


def _aspect(s, thumb):
    """Width over height of the drawn map: the surface's own mean extents where known."""
    ratio = s.get("aspect") or thumb.width / thumb.height
    return f"{max(0.4, min(3.0, ratio)):.3f}"


def _box(thumb):
    x, y = (0.5 * cells / max(n - 1, 1) for cells, n in zip((thumb.width, thumb.height), thumb.samples, strict=True))
    return f'x="{-x:g}" y="{-y:g}" width="{thumb.width + 2 * x:g}" height="{thumb.height + 2 * y:g}"'


def _map_size(s):
    return f"{s['map'][0]} \u00d7 {s['map'][1]}" if s["map"] else "\u2013"


def _texture_size(s):
    return (
        (f"{s['texture'][0]} \u00d7 {s['texture'][1]}", s["texture"][0] * s["texture"][1])
        if s["texture"]
        else ("\u2013", 0)
    )


def _budget(figures):
    memory = figures["memory"]
    if memory["budget"] is None:
        return ""
    used = memory["after"] / memory["budget"] if memory["budget"] else 0
    line = (
        f"<p><b>{size(memory['after'])}</b> of {size(memory['budget'])} allowed are used "
        f"({share(used)}); before the reduction {size(memory['before'])}. On disk the textures take "
        f"{size(memory['disk'])}.</p>"
        f'<span class="bar wide"><i style="width:{min(100, 100 * used):.1f}%"></i></span>'
    )
    rows = [
        [
            escape(str(r["name"])),
            escape(str(r["from"])),
            escape(str(r["to"])),
            (count(r["levels"]), r["levels"]),
            (size(r["saved"]), r["saved"] or 0),
            (number(r["D_i"]), r["D_i"] or 0),
        ]
        for r in figures["budget"]
    ]
    table = _table(
        ["surface", "from", "to", "levels given up", "saved", "D<sub>i</sub> given up"], rows, "tnnnnn", True
    )
    return _section(
        "Texture budget",
        line + (table or "<p>No map gave anything up.</p>"),
        "GPU bytes as exported, mip chains included. The surface that loses least, by the sum of what its "
        "deepest samples add, gives up its deepest level first.",
        "budget",
    )


def _gouraud(figures):
    g = figures["gouraud"]
    if not g["triangles"]:
        return ""
    rows = [["Gouraud-shaded elements, two triangles a leaf", count(g["triangles"]), ""]]
    rows += [
        [
            f"Level {r['level']}, textured",
            count(r["triangles"]),
            f"{number(r['times'])} times fewer" if r["times"] >= 1 else f"{number(1 / r['times'])} times more",
        ]
        for r in g["levels"]
        if r["times"]
    ]
    return _section(
        "Gouraud against texture",
        _table(["reconstruction", "triangles", ""], rows, "tnn"),
        "The same light stored in vertices would need the leaves of the quadtrees as triangles.",
        "gouraud",
    )


def _savings(figures):
    rows = [[escape(s["what"]), count(s["count"]), escape(s["unit"])] for s in figures["savings"]]
    return _section("What the scene did not pay for", _table(["saving", "", ""], rows, "tnt"), ident="savings")


def _seams(figures):
    rows = [
        [escape(str(r["a"])), escape(str(r["b"])), number(r["worst"]), share(r["relative"])] for r in figures["seams"]
    ]
    return _section(
        "Seams",
        _table(["surface", "neighbour", "largest step [W/m\u00b2]", "of mean light"], rows, "ttnn"),
        "Borders that two surfaces share smoothly, worst first: the largest difference of irradiance between "
        "their maps along the border.",
        "seams",
    )


def _settings(figures):
    text = json.dumps(figures["settings"], indent=2, sort_keys=True, ensure_ascii=False) if figures["settings"] else ""
    return _section(
        "Settings",
        f"<details><summary>Settings used</summary><pre>{escape(text)}</pre></details>" if text else "",
        ident="settings",
    )
