"""Tell what a bake did: report.json for machines, report.html for people, one offline file.

reads   scene.npz, casters.npz, solution.npz, trees of refine, light maps, textures.npz, budget.json, lods.json with the
        exported files beside it, the cost files of all jobs; whatever is missing leaves its section out
        settings: {"settings": what the bake used, "camera": {"eye", "target", "fov"} in the scene's units or null,
        "units", "up", "warnings": [text]}
writes  report.json, report.html

`--results FOLDER` names the files of a finished bake where no file is given by itself. Rays of this run are those of
cost files whose run is the environment's BAKE_RUN.
"""

import json
import os
import tempfile
from pathlib import Path

import numpy as np

from lib import door
from lib.formats import casters as casters_file
from lib.formats import exported, light_maps, pictures, report_html, textured_maps, trees
from lib.formats import scene as scene_file
from lib.formats import solution as solution_file
from lib.formats.artefact import ArtefactError, read_json, write_json
from lib.formats.quantities import METRES
from lib.maps import mapset
from lib.nurbs.evaluate import normal
from lib.report import camera as cameras
from lib.report import charts, figures, picture, seams, surfaces, thumbnails

HERO, SMALL = (960, 600), (400, 250)  # pixels
MOST_THUMBNAILS = 160
MOST_SEAMS = 20
GIVEN = {  # option: pattern below the results folder, whether it is a list
    "scene": ("stages/import_scene/scene.npz", False),
    "casters": ("stages/tessellate/casters.npz", False),
    "solution": ("stages/shoot/solution.npz", False),
    "direct": ("stages/refine/direct_*.npz", True),
    "indirect": ("stages/refine/indirect_*.npz", True),
    "maps": ("stages/balance_resample/chunk_*.npz", True),
    "textures": ("stages/budget_reduce/textures.npz", False),
    "budget": ("stages/budget_reduce/budget.json", False),
    "lods": ("lods.json", False),
    "costs": ("stages/**/*cost*.json", True),
}


def arguments(parser):
    parser.add_argument("--results", metavar="FOLDER", help="results/<scene>, for files not named one by one")
    for name, (pattern, is_list) in GIVEN.items():
        parser.add_argument(f"--{name}", metavar="FILE", nargs="*" if is_list else None, help=f"default: {pattern}")
    parser.add_argument("--name", help="of the scene (default: the name of the results folder)")
    parser.add_argument("--settings", type=json.loads, default={}, metavar="JSON")
    parser.add_argument("--out-html", metavar="FILE")
    parser.add_argument("--out-json", metavar="FILE")


def body(args, cost):
    files = find(args)
    results = Path(args.results) if args.results else Path(files["lods"]).parent
    scene, casters = scene_file.load(files["scene"]), casters_file.load(files["casters"])
    found = Found(files, scene, casters)
    facts = collect(args.name or results.resolve().name, found, args.settings)
    drawn, model = draw(found, facts, args.settings, cost)
    write_json(args.out_json or results / "report.json", facts)
    report_html.save(args.out_html or results / "report.html", facts, drawn, model)


def find(args):
    """{name of GIVEN: path, or list of paths}; None or [] where there is no such file."""
    files = {}
    for name, (pattern, is_list) in GIVEN.items():
        given = getattr(args, name)
        if given is None and args.results:
            given = sorted(str(p) for p in Path(args.results).glob(pattern))
            given = given if is_list else next(iter(given), None)
        files[name] = given or ([] if is_list else None)
    for needed in ("scene", "casters", "lods"):
        if files[needed] is None:
            raise ArtefactError(f"{args.results or 'report'}: {GIVEN[needed][0]}: missing")
    return files


class Found:
    """The stage files of a bake, loaded."""

    def __init__(self, files, scene, casters):
        self.scene, self.casters = scene, casters
        self.solution = solution_file.load(files["solution"]) if files["solution"] else None
        self.trees, self.tree_facts = [], []
        for half in ("direct", "indirect"):
            loaded = [trees.load(path, half) for path in files[half]]
            self.trees.append({s: tree for chunk, _ in loaded for s, tree in chunk.items()})
            self.tree_facts += [facts for _, facts in loaded]
        chunks = [light_maps.load(path) for path in files["maps"]]
        self.maps = mapset.merge([c.maps for c in chunks]) if chunks else None
        self.textures = textured_maps.load(files["textures"]) if files["textures"] else None
        self.budget = read_json(files["budget"]) if files["budget"] else None
        self.lods = read_json(files["lods"])
        self.folder = Path(files["lods"]).parent
        self.costs = [named(read_json(path), path) for path in files["costs"]]
        self.run = os.environ.get("BAKE_RUN", "")


def named(cost, path):
    """A cost record whose stage tells the halves of refine apart, by the name of its file."""
    half = next((h for h in ("indirect", "direct") if cost["stage"] == "refine" and h in Path(path).name), None)
    return {**cost, "stage": f"refine {half}"} if half else cost


def collect(name, found, settings):
    """The dict of report.json."""
    scene, solution = found.scene, found.solution
    table = found.budget or {"T": None, "S_before": None, "S_after": None, "surfaces": [], "profile": "standard"}
    exported_maps = getattr(found.textures, "light" if table["profile"] == "lightmap" else "final", None)
    mean_H = float(np.mean(solution.mean_H)) if solution is not None else 0.0
    rows = surfaces.rows(scene, found.trees, found.maps, exported_maps, {s["surface"]: s["D"] for s in table["surfaces"]},
                         mean_H)
    for row, extent in zip(rows, found.casters.extent, strict=True):
        row["aspect"] = float(extent[0] / extent[1]) if extent[1] > 0 else None
    stages = figures.stage_costs(found.costs, found.run)
    levels = level_rows(found)
    history = solution.history if solution is not None and len(solution.history) else np.zeros((0, 2))
    memory = {"budget": table["T"], "before": table["S_before"], "after": table["S_after"], "disk": disk_bytes(found)}
    unshot = float(history[-1, 1]) if len(history) else None
    return {
        "scene": name,
        "version": 1,
        "run": figures.run_totals(stages, found.run),
        "totals": figures.totals(stages, rows, levels, memory, unshot, surfaces.overall_error(rows, found.casters.area)),
        "stages": stages,
        "surfaces": rows,
        "levels": levels,
        "shoot": {"shots": history[:, 0].tolist(), "history": history[:, 1].tolist(), "unshot": unshot,
                  "target": (settings.get("settings") or {}).get("bake", {}).get("convergence"),
                  "facts": solution.facts if solution is not None else {}},
        "ledger": figures.ledger(solution.ledger) if solution is not None else [],
        "memory": memory,
        "budget": figures.budget_rows(table),
        "gouraud": figures.gouraud([row["leaves"] for row in rows], levels),
        "savings": figures.savings(counted(found, rows)),
        "notes": figures.notes(found.costs),
        "seams": seam_rows(found, mean_H),
        "exposure": found.lods.get("exposure"),
        "settings": settings.get("settings"),
        "warnings": [*scene.warnings, *settings.get("warnings", [])],
    }


def level_rows(found):
    """The levels of lods.json with what the report shows of each."""
    rows = []
    for k, level in enumerate(found.lods["levels"]):
        rows.append({"level": k, "file": level["file"], "triangles": level["triangles"], "vertices": level.get("vertices"),
                     "max_distance": level.get("max_distance"), "rms_distance": level.get("rms_distance"),
                     "gap": level.get("gap"), "coverage": level.get("screen_coverage"), "bytes": level.get("bytes")})
        rows[-1]["share"] = level["triangles"] / rows[0]["triangles"] if rows[0]["triangles"] else None
        if level.get("mapped_triangles") is not None:
            rows[-1]["mapped_triangles"] = level["mapped_triangles"]
    return rows


def disk_bytes(found):
    """Bytes of the picture files the finest level names."""
    first = found.folder / found.lods["levels"][0]["file"]
    if not first.exists() or first.suffix != ".gltf":
        return None
    named = {image.get("uri") for image in read_json(first).get("images", [])}
    return sum((found.folder / uri).stat().st_size for uri in named if uri and (found.folder / uri).exists())


def counted(found, rows):
    """Savings by name, counted here or noted by the jobs."""
    noted = figures.notes([{"notes": facts} for facts in found.tree_facts])
    noted = {**noted, **{k: v for k, v in figures.notes(found.costs).items() if k in figures.SAVINGS}}
    return {
        **noted,
        "cast_only": sum(row["role"] == "cast_only" for row in rows),
        "receive_only": sum(row["role"] == "receive_only" for row in rows),
        "black": sum(row["is_black"] for row in rows),
        "few_texels": sum(row["map"] is not None and row["map"] == [r + 1 for r in row["roots"]] for row in rows),
    }


def seam_rows(found, mean_H):
    """Steps of irradiance along borders that are smooth in space, the worst first."""
    if found.maps is None:
        return []
    maps, scene = found.maps, found.scene
    total = {}
    rows = []
    for a, side_a, b, side_b, is_reversed in found.casters.borders.tolist():
        ka, kb = maps.position(a), maps.position(b)
        if ka < 0 or kb < 0 or found.casters.is_collapsed[a, side_a] or found.casters.is_collapsed[b, side_b]:
            continue
        N = [normal(scene.surfaces[s], *seams.border_uv(side, turned)) * (-1 if scene.flip[s] else 1)
             for s, side, turned in ((a, side_a, False), (b, side_b, bool(is_reversed)))]
        if not seams.is_smooth(*N):
            continue
        for k in (ka, kb):
            if k not in total:
                total[k] = maps.map(k).sum(axis=2)
        worst = seams.step(seams.line(total[ka], maps.hidden_map(ka), side_a),
                           seams.line(total[kb], maps.hidden_map(kb), side_b), is_reversed)
        if np.isfinite(worst):
            rows.append({"a": scene.names[a], "b": scene.names[b], "worst": worst,
                         "relative": worst / mean_H if mean_H > 0 else None})
    return sorted(rows, key=lambda r: (-r["worst"], r["a"], r["b"]))[:MOST_SEAMS]


def draw(found, facts, settings, cost):
    """Pictures of the levels and maps, and what the viewer shows."""
    view, levels, hero, documents, textures = None, [], None, [], {}
    given = settings.get("camera")
    for k, level in enumerate(facts["levels"]):
        path = found.folder / level["file"]
        parts, loaded = exported.load(path)
        model = picture.join(parts)
        if view is None:
            view = scene_camera(given, settings) if given else cameras.automatic(model)
            hero = png(picture.render(model, loaded, view, *HERO))
        levels.append(tuple(png(shot) for shot in picture.render_with_edges(model, loaded, view, *SMALL)))
        inlined = exported.inlined(path)
        if inlined and documents is not None:
            documents.append(inlined[0])
            textures.update(inlined[1])
        else:
            documents = None
        cost.notes["picture_rays"] = cost.notes.get("picture_rays", 0) + 4 * SMALL[0] * SMALL[1] + (k == 0) * 4 * HERO[0] * HERO[1]
    shown = {"levels": documents, "textures": textures,
             "camera": {"eye": list(view.eye), "target": list(view.target), "fov": view.fov}} if documents else None
    return report_html.Pictures(hero, levels, map_thumbnails(found, facts)), shown


def scene_camera(given, settings):
    """The camera of scene.yaml, in its units and up axis, as one in metres with y up."""
    unit = METRES[settings.get("units", "m")]

    def place(p):
        x, y, z = (float(c) * unit for c in p)
        return (x, y, z) if settings.get("up", "z") == "y" else (x, z, -y)

    return cameras.Camera(place(given["eye"]), place(given["target"]), float(given.get("fov", 50)))


def map_thumbnails(found, facts):
    """{name: Thumbnail} of the largest maps of light."""
    if found.textures is None:
        return {}
    light = found.textures.light
    w, h = light.sizes()
    exposure = facts["exposure"] / np.pi if facts["exposure"] else thumbnails.automatic_exposure(
        light.value[~light.hidden])
    drawn = {}
    for k in sorted(np.lexsort((np.arange(len(light)), -w * h))[:MOST_THUMBNAILS]):
        s = int(light.surface[k])
        own = [t[s] for t in found.trees if s in t]
        codes = thumbnails.thumbnail(light.map(k), light.hidden_map(k), exposure)
        roots = tuple(int(r) for r in light.roots[k])
        path, cells_w, cells_h = "", *roots
        if own:
            path, cells_w, cells_h = charts.tree_lines(*(np.concatenate(x) for x in zip(
                *(surfaces.leaves(t) for t in own), strict=True)), roots)
        drawn[found.scene.names[s]] = report_html.Thumbnail(png(codes), codes.shape[1::-1], path, cells_w, cells_h)
    return drawn


def png(codes):
    """PNG bytes of 8-bit codes (h, w, 3)."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.png"
        pictures.write_png8(path, codes)
        return path.read_bytes()


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
