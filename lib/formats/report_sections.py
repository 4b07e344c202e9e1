"""The sections of report.html, one function each: figures of report.json in, HTML out, "" without content.

Every name and every setting is user text and is escaped where it is put in.
"""

import json
from html import escape

from lib.formats.html_pieces import bar, data_uri, image, section, table
from lib.report.charts import convergence
from lib.report.wording import DASH, count, length, number, share, size


def head(figures, pictures):
    """Title, picture of the finest level, headline numbers."""
    totals, run, name = figures["totals"], figures["run"], str(figures["scene"])
    tiles = [
        (count(totals["surfaces"]), "surfaces"),
        (count(totals["triangles"]), "triangles, finest level"),
        (size(totals["texture_bytes"]), "of texture memory, mips included"),
        (count(totals["rays"]), "rays in the bake"),
        (f"{number(totals['seconds'])} s", "in all jobs together"),
        (share(totals["error"]), "estimated error of the maps"),
        (share(totals["unshot"]), "of the power left unshot"),
    ]
    tiles = "".join(f"<li><b>{value}</b><span>{label}</span></li>" for value, label in tiles if value != DASH)
    figure = image(pictures.hero, f"{name}, finest level", "hero")
    if figure:
        figure = (
            f"<figure>{figure}<figcaption>The finest level as an unlit viewer shows it: a ray-cast picture of the "
            "exported files, textures only, no light added.</figcaption></figure>"
        )
    return (
        f'<header><p class="over">Bake report</p><h1>{escape(name)}</h1></header>{figure}<ul class="tiles">{tiles}</ul>'
        f'<p class="note">The run that wrote this page cast <b>{count(run["rays"])}</b> rays of the bake, '
        f"in {count(run['jobs'])} jobs of {number(run['seconds'])} s together.</p>\n"
    )


def warnings(figures):
    """What the user should know."""
    items = "".join(f"<li>{escape(str(w))}</li>" for w in figures["warnings"])
    return section("Warnings", f'<ul class="warnings">{items}</ul>' if items else "", ident="warnings")


def viewer(model):
    """The place of the 3D view; viewer.bundle.js fills it."""
    if model is None:
        return ""
    buttons = "".join(f'<button data-level="{k}">Level {k}</button>' for k in range(len(model["levels"])))
    body = (
        '<div class="viewer" id="viewer"><canvas tabindex="0" aria-label="3D view"></canvas>'
        f'<div class="controls"><span class="group">{buttons}</span>'
        '<label><input type="checkbox" name="edges"> triangles</label>'
        '<label><input type="checkbox" name="texels"> texels</label>'
        '<label><input type="checkbox" name="backs"> back faces</label>'
        "<button data-home>view</button><output></output></div></div>"
    )
    note = "Drag to turn, right drag to move, wheel to come closer. All levels draw from the same textures."
    return section("Look around", body, note, "look")


def levels(figures, pictures):
    """Triangles, distances and bytes of every level, and how it looks."""
    columns = [
        ("level", "t", lambda r: f"{r['level']}"),
        ("asked", "t", lambda r: escape(_asked(r["asked"]))),
        ("triangles", "n", lambda r: count(r["triangles"])),
        ("of finest", "n", lambda r: share(r["share"])),
        ("vertices", "n", lambda r: count(r["vertices"])),
        ("largest distance", "n", lambda r: length(r["max_distance"])),
        ("RMS distance", "n", lambda r: length(r["rms_distance"])),
        ("texture slide", "n", lambda r: length(r["slide"])),
        ("widest gap", "n", lambda r: length(r["gap"])),
        ("screen cover", "n", lambda r: share(r["coverage"])),
        ("geometry", "n", lambda r: size(r["bytes"])),
        ("file", "t", lambda r: escape(str(r["file"]))),
    ]
    notes = "".join(
        f'<p class="note">Level {r["level"]}: {escape(r["note"])}.</p>' for r in figures["levels"] if r["note"]
    )
    shots = "".join(
        f"<figure>{image(plain, _name(r))}{image(edges, _name(r) + ', its triangles')}"
        f"<figcaption>{_name(r)}: {count(r['triangles'])} triangles</figcaption></figure>"
        for r, (plain, edges) in zip(figures["levels"], pictures.levels, strict=False)
    )
    note = (
        "Distances are to the exact surfaces; the slide is how far a texture is drawn beside its place; a gap is the "
        "widest opening between neighbours along a shared border. Every level names the same texture files."
    )
    body = table(columns, figures["levels"]) + notes + (f'<div class="shots">{shots}</div>' if shots else "")
    return section("Levels of detail", body, note, "levels")


def _name(level):
    return f"Level {level['level']}"


def _asked(asked):
    """What the user asked of a level, as text."""
    if not asked:
        return DASH
    (kind, value), *_ = asked.items()
    if kind == "deviation":
        return f"within {length(value)}" if isinstance(value, int | float) else f"within {value}"
    return share(value) if kind == "share" else f"{count(value)} triangles"


def light(figures):
    """The course of the solution and where the power went."""
    shoot = figures["shoot"]
    chart = convergence(shoot["shots"], shoot["history"], shoot["target"])
    if chart:
        chart = f"<figure>{chart}<figcaption>Unshot power, as a share of the start</figcaption></figure>"
    columns = [
        ("power [W]", "t", lambda r: escape(r[0])),
        *((colour, "n", lambda r, c=c: number(r[1][c], 5)) for c, colour in enumerate(("red", "green", "blue"))),
        ("sum", "n", lambda r: number(sum(r[1]), 5)),
        ("of emitted", "n", lambda r: share(r[2], 3)),
    ]
    note = (
        "Emitted = not received + received; received = absorbed + escaped + unshot, to rounding; the residue is the "
        "reflected power of the gathered solution less that of the shot one."
    )
    return section("Light", chart + table(columns, figures["ledger"]), note, "light")


def cost(figures):
    """Seconds, memory and rays of every stage."""
    stages, total = figures["stages"], figures["totals"]
    most = {key: max([s[key] for s in stages] + [1e-12]) for key in ("seconds", "rays")}

    def barred(row, key, text):
        return f"{bar(row[key] / most[key])}<span>{text}</span>", row[key]

    columns = [
        ("stage", "t", lambda r: escape(str(r["stage"]))),
        ("jobs", "n", lambda r: count(r["jobs"])),
        ("seconds", "n", lambda r: barred(r, "seconds", number(r["seconds"]))),
        ("CPU seconds", "n", lambda r: number(r["cpu_seconds"])),
        ("peak memory", "n", lambda r: f"{number(r['peak_mb'])} MB"),
        ("rays", "n", lambda r: barred(r, "rays", count(r["rays"]))),
        ("this run", "t", lambda r: "yes" if r["is_in_run"] else "kept"),
    ]
    foot = [
        "<b>all</b>",
        count(sum(s["jobs"] for s in stages)),
        f"<b>{number(total['seconds'])}</b>",
        number(total["cpu_seconds"]),
        f"{number(total['peak_mb'])} MB",
        f"<b>{count(total['rays'])}</b>",
        "",
    ]
    note = (
        "Seconds of all jobs of a stage added up, without the start of the interpreter; this page's own making is "
        "not in the list. Stages marked as kept were not run again."
    )
    return section("Cost", table(columns, stages, foot=foot), note, "cost")


def maps(figures, pictures):
    """Every surface's map as a picture with its quadtree, and as a row of numbers."""
    surfaces = figures["surfaces"]
    cards = [_card(s, pictures.thumbnails[s["name"]]) for s in surfaces if s["name"] in pictures.thumbnails]
    gallery = ""
    if cards:
        left = sum(s["map"] is not None for s in surfaces) - len(cards)
        gallery = (
            '<p><label><input type="checkbox" id="lines" checked> quadtree lines</label></p>'
            f'<div class="maps">{"".join(cards)}</div>'
            + (f'<p class="note">{count(left)} smaller maps are in the table only.</p>' if left > 0 else "")
        )
    columns = [
        ("surface", "t", lambda s: escape(s["name"])),
        ("role", "t", lambda s: escape(str(s["role"]))),
        ("map", "n", lambda s: _sides(s["map"])),
        ("depth", "n", lambda s: (number(s["depth"]), s["depth"] or 0)),
        ("texture", "n", lambda s: _sides(s["texture"])),
        ("GPU bytes", "n", lambda s: (size(s["bytes"]), s["bytes"] or 0)),
        ("D<sub>i</sub>", "n", lambda s: (number(s["D_i"]), s["D_i"] or 0)),
        ("error", "n", lambda s: (share(s["error"]), s["error"] or 0)),
        ("samples", "n", lambda s: (count(s["samples"]), s["samples"])),
        ("buried", "n", lambda s: (share(s["hidden"]), s["hidden"] or 0)),
    ]
    listing = table(columns, surfaces, is_sortable=True)
    is_open = " open" if len(surfaces) <= 40 else ""
    listing = f"<details{is_open}><summary>{count(len(surfaces))} surfaces</summary>{listing}</details>"
    note = (
        "Reflected light of each surface over its own parameters, u to the right, v up. Lines are the cells of the "
        "adaptive samples; violet samples are buried. The error is an estimate relative to the scene's mean light."
    )
    return section("Illumination maps", gallery + listing, note, "maps")


def _card(s, thumb):
    """One map: its picture under the lines of its cells. Samples lie on the lines' crossings, so the picture is larger
    than the cells by half a sample on every side, which the frame cuts off."""
    x, y = (0.5 * cells / max(n - 1, 1) for cells, n in zip((thumb.width, thumb.height), thumb.samples, strict=True))
    aspect = max(0.4, min(3.0, s.get("aspect") or thumb.width / thumb.height))
    lines = f'<path d="{thumb.path}"/>' if thumb.path else ""
    return (
        f'<figure><svg viewBox="0 0 {thumb.width} {thumb.height}" preserveAspectRatio="none" '
        f'style="aspect-ratio:{aspect:.3f}"><image href="{data_uri(thumb.png)}" preserveAspectRatio="none" '
        f'x="{-x:g}" y="{-y:g}" width="{thumb.width + 2 * x:g}" height="{thumb.height + 2 * y:g}"/>{lines}</svg>'
        f"<figcaption>{escape(s['name'])}<small>{_sides(s['map'])[0]}</small></figcaption></figure>"
    )


def _sides(sides):
    return (f"{sides[0]} \u00d7 {sides[1]}", sides[0] * sides[1]) if sides else (DASH, 0)


def budget(figures):
    """What the textures take, and who gave up what."""
    memory = figures["memory"]
    if not memory["budget"]:
        return ""
    used = memory["after"] / memory["budget"]
    error = f" They are {100 * memory['lost']:.2g} % off on average." if memory["lost"] else ""
    line = (
        f"<p><b>{size(memory['after'])}</b> of {size(memory['budget'])} allowed are used ({share(used)}); before "
        f"the reduction {size(memory['before'])}. On disk the textures take {size(memory['disk'])}."
        f"{error}</p>{bar(used, 'bar wide')}"
    )
    columns = [
        ("surface", "t", lambda r: escape(str(r["name"]))),
        ("from", "n", lambda r: r["from"]),
        ("to", "n", lambda r: r["to"]),
        ("levels given up", "n", lambda r: (count(r["levels"]), r["levels"])),
        ("saved", "n", lambda r: (size(r["saved"]), r["saved"])),
        ("D<sub>i</sub> given up", "n", lambda r: (number(r["D_i"]), r["D_i"])),
    ]
    least = "loses least for the bytes it frees" if memory["order"] == "loss_per_byte" else "loses least"
    note = (
        f"GPU bytes as exported, mip chains included. The surface that {least}, by the sum of what its deepest "
        "samples add, gives up its deepest level first."
    )
    listing = table(columns, figures["budget"], is_sortable=True) or "<p>No map gave anything up.</p>"
    return section("Texture budget", line + listing, note, "budget")


def gouraud(figures):
    """Triangles with light in vertices against triangles with light in textures."""
    g = figures["gouraud"]
    if not g["triangles"]:
        return ""
    rows = [("Gouraud-shaded elements, two triangles a leaf", g["triangles"], None)]
    rows += [(f"Level {r['level']}, textured", r["triangles"], r["times"]) for r in g["levels"]]
    columns = [
        ("reconstruction", "t", lambda r: r[0]),
        ("triangles", "n", lambda r: count(r[1])),
        ("", "n", lambda r: _times(r[2])),
    ]
    note = "The same light stored in vertices needs the leaves of the quadtrees as triangles; mapped surfaces only."
    return section("Gouraud against texture", table(columns, rows), note, "gouraud")


def _times(times):
    if not times:
        return ""
    return f"{number(times)} times fewer" if times >= 1 else f"{number(1 / times)} times more"


def savings(figures):
    """What was not computed, as numbers."""
    columns = [
        ("saving", "t", lambda s: escape(s["what"])),
        ("", "n", lambda s: count(s["count"])),
        ("", "t", lambda s: escape(s["unit"])),
    ]
    return section("What the scene did not pay for", table(columns, figures["savings"]), ident="savings")


def seams(figures):
    """The largest steps between the maps of smooth neighbours."""
    columns = [
        ("surface", "t", lambda r: escape(str(r["a"]))),
        ("neighbour", "t", lambda r: escape(str(r["b"]))),
        ("largest step [W/m\u00b2]", "n", lambda r: number(r["worst"])),
        ("of the light there", "n", lambda r: share(r["relative"])),
        ("RMS step [W/m\u00b2]", "n", lambda r: number(r["rms"])),
    ]
    note = (
        "Borders that two surfaces share smoothly, worst first: the largest difference of irradiance between their "
        "maps along the border, also over the brightest light there or the scene's mean, whichever is more."
    )
    after = "".join(
        f"<p>In the exported textures, within the budget, the largest step is {number(r['worst'])} W/m\u00b2 "
        f"({share(r['relative'])} of the light there), between {escape(r['a'])} and {escape(r['b'])}.</p>"
        for r in figures["seams_exported"][:1]
    )
    return section("Seams", table(columns, figures["seams"]) + after, note, "seams")


def settings(figures):
    """What the bake was asked for, defaults filled in."""
    if not figures["settings"]:
        return ""
    text = escape(json.dumps(figures["settings"], indent=2, sort_keys=True, ensure_ascii=False))
    return section(
        "Settings", f"<details><summary>Settings used</summary><pre>{text}</pre></details>", ident="settings"
    )
