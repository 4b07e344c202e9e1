"""The error a bake asks for, achieves and estimates, against much finer bakes of the same scene.

    python benchmarks/own_reference.py [SCENE FOLDER]          default: data/scenes/fruit_room

The truth is the mean of --references bakes at the least tolerance with other seeds; half the difference of two of them
is its standard error, which is taken off as in benchmarks/score.py.  What such a bake has in common with coarser ones,
such as the solved elements, is not seen; for that there are the path traced scenes.

Points are spread evenly over the area of all surfaces with a map: over the triangles that cast their shadows, which lie
within trims and charts.  Points on lamps are none; points where the finest maps are hidden are left out, as buried
ones are in benchmarks/reference; no other is.  Irradiance is read from maps/*.exr as in benchmarks/run.py.

Writes own_reference.md and .json into benchmarks/results; the exit status is 1 if an achieved error is not within
WITHIN of the asked one.
"""

import argparse
import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import bake  # noqa: E402
import numpy as np  # noqa: E402
import score  # noqa: E402
from run import machine  # noqa: E402

from lib.formats import artefact, bake_files  # noqa: E402

TOLERANCES = (0.04, 0.02, 0.01, 0.005)
FINEST = 0.002  # tolerance of the references, the least there is
WITHIN = 1.5  # achieved over asked, either way
POINTS = 40000
FIRST_SEED = 1000  # of the references
LARGEST = 8  # surfaces listed
ONE_LEVEL = "[{deviation: 1 %}]"  # levels of detail are not measured


def spread(V, UV, F, face_surface, n, rng):
    """n points spread evenly over the area of triangles F (m, 3) with corners V and parameters UV: the surface of each
    (n,), its parameters (n, 2)."""
    corner = V[F]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    face = rng.choice(len(area), size=n, p=area / area.sum())
    a, b = rng.random((2, n, 1))
    is_over = a + b > 1
    a, b = np.where(is_over, 1 - a, a), np.where(is_over, 1 - b, b)
    uv = UV[F[face]]
    return face_surface[face], uv[:, 0] * (1 - a - b) + uv[:, 1] * a + uv[:, 2] * b


def are_hidden(maps, surface, uv):
    """(n,) bool: the texel nearest to uv (n, 2) of each surface (n,) is hidden in a MapSet."""
    out = np.zeros(len(uv), dtype=bool)
    for s in np.unique(surface):
        hidden, mine = maps.hidden_map(maps.position(s)), np.flatnonzero(surface == s)
        h, w = hidden.shape
        i, j = np.rint(uv[mine] * (w - 1, h - 1)).astype(int).T
        out[mine] = hidden[j, i]
    return out


def points(results, n, seed):
    """n points of a finished bake, less those that are buried: names (k,), uv (k, 2)."""
    made = bake_files.load(bake_files.find({}, results))
    x, c = made.scene, made.casters
    of = c.face_surface.astype(int)
    back_of = np.full(len(x.names), -1)
    back_of[x.front[x.front >= 0]] = np.flatnonzero(x.front >= 0)
    has_back = back_of[of] >= 0  # the same triangles, seen from behind
    F, of = np.concatenate([c.F, c.F[has_back]]), np.concatenate([of, back_of[of[has_back]]])
    has_points = np.array([made.maps.position(s) >= 0 for s in range(len(x.names))]) & (x.E.max(axis=1) == 0)
    kept = has_points[of]
    surface, uv = spread(c.V, c.UV, F[kept], of[kept], n, np.random.default_rng(seed))
    seen = ~are_hidden(made.maps, surface, uv)
    return np.array(x.names, dtype=object)[surface[seen]], uv[seen]


def baked(folder, work, cores, **settings):
    """One bake: (results folder, figures)."""
    text = json.dumps(settings).replace('"', "")
    return bake.bake(Path(folder).resolve(), work, cores, {"bake": text, "lods": ONE_LEVEL})


def truth(found):
    """Mean E (k, 3) of the references' irradiances, and its standard error se (k, 3); nothing known of it from one.

    >>> truth([np.array([[1.0]]), np.array([[3.0]])])
    (array([[2.]]), array([[1.]]))
    """
    found = np.array(found)
    n = len(found)
    return found.mean(axis=0), found.std(axis=0, ddof=1) / np.sqrt(n) if n > 1 else np.zeros(found.shape[1:])


def by_surface(H, E, se, names):
    """[{surface, share of the points, share of the squared error, rmse over the mean of all E}], most error first."""
    square = ((H - E) ** 2 - se**2).mean(axis=1)
    rows = []
    for name in np.unique(names.astype(str)):
        mine = names == name
        own = {"points": float(mine.mean()), "error": float(square[mine].sum() / square.sum())}
        rows.append({"surface": str(name), **own, "rmse": float(np.sqrt(max(square[mine].mean(), 0)) / E.mean())})
    return sorted(rows, key=lambda row: -row["error"])


def measured(folder, tolerance, names, uv, E, se, args):
    """One bake against the truth: its row."""
    results, figures = baked(folder, args.work / "bake", args.cores, tolerance=tolerance, seed=args.seed)
    H = bake.irradiance(results, names, uv)
    return {
        "tolerance": tolerance,
        **score.errors(H, E, se),
        "estimate": artefact.read_json(results / "report.json")["totals"]["error"],
        "cpu": figures["cpu"],
        "texels": figures["texels"],
        "surfaces": by_surface(H, E, se, names)[:LARGEST],
    }


def is_within(row):
    """The achieved error is within WITHIN of the asked one."""
    return 1 / WITHIN <= row["rmse"] / row["tolerance"] <= WITHIN


def markdown(scene, rows, facts):
    """The table."""
    noise = f"{100 * facts['noise']:.2f} %" if facts["references"] > 1 else "not known"
    text = [
        f"# Asked, achieved and estimated error of `{scene}`",
        "",
        f"Made by `python benchmarks/own_reference.py`, commit {facts['commit']}. The truth: {facts['references']}"
        f" bakes at tolerance {FINEST:g} with other seeds; its standard error, {noise} of the mean, is taken off."
        f" {facts['points']:,} points, even over the area of all surfaces but lamps; buried ones left out. Asked:"
        f" within a factor of {WITHIN}.",
        "",
        "| asked, % | achieved RMSE, % | over asked | estimate, % | over achieved | 95 %, % | bias, % | CPU s"
        " | texels, k | |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [
            f"{100 * row['tolerance']:g}",
            f"{100 * row['rmse']:.2f}",
            f"{row['rmse'] / row['tolerance']:.2f}",
            f"{100 * row['estimate']:.2f}",
            f"{row['estimate'] / row['rmse']:.2f}",
            f"{100 * row['p95']:.1f}",
            f"{100 * row['bias']:+.2f}",
            f"{row['cpu']:.0f}",
            f"{row['texels'] / 1000:.0f}",
            "" if is_within(row) else "missed",
        ]
        text.append("| " + " | ".join(cells) + " |")
    text += ["", "## Where the error is", ""]
    text += ["Surfaces with the largest shares of the squared error; RMSE over the mean of the scene.", ""]
    text += ["| asked, % | surface | points, % | squared error, % | RMSE, % |", "|---|---|---|---|---|"]
    for row in rows:
        for s in row["surfaces"]:
            cells = f"{100 * s['points']:.1f} | {100 * s['error']:.1f} | {100 * s['rmse']:.2f}"
            text.append(f"| {100 * row['tolerance']:g} | {s['surface']} | {cells} |")
    return "\n".join(text) + "\n"


def main(argv=None):
    """Bake the truth, then every tolerance; the table is written after each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=HERE.parent / "data" / "scenes" / "fruit_room")
    parser.add_argument("--tolerances", type=float, nargs="+", default=TOLERANCES)
    parser.add_argument("--references", type=int, default=2, help="bakes the truth is the mean of")
    parser.add_argument("--points", type=int, default=POINTS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--work", type=Path, default=HERE.parent / "results" / "benchmarks" / "own_reference")
    parser.add_argument("--out", type=Path, default=HERE / "results")
    args = parser.parse_args(argv)
    found, names, uv = [], None, None
    for k in range(args.references):
        results, figures = baked(
            args.folder, args.work / "reference", args.cores, tolerance=FINEST, seed=FIRST_SEED + k
        )
        if names is None:
            names, uv = points(results, args.points, args.seed)
        found.append(bake.irradiance(results, names, uv))
        print(f"reference {k + 1}: {figures['cpu']:.0f} CPU s, {figures['texels'] / 1e6:.1f} M texels", flush=True)
    E, se = truth(found)
    known = np.isfinite(E).all(axis=1)  # nothing is known of the light on black surfaces
    names, uv, E, se = names[known], uv[known], E[known], se[known]
    noise = float(np.sqrt((se**2).mean()) / E.mean())
    facts = {"noise": noise, "references": args.references, "points": len(uv), "commit": machine()["commit"]}
    rows = []
    args.out.mkdir(parents=True, exist_ok=True)
    for tolerance in args.tolerances:
        rows.append(measured(args.folder, tolerance, names, uv, E, se, args))
        last = rows[-1]
        print(f"asked {tolerance:.3%}, achieved {last['rmse']:.3%}, estimate {last['estimate']:.3%}", flush=True)
        artefact.write_json(args.out / "own_reference.json", {**facts, "scene": args.folder.name, "rows": rows})
        (args.out / "own_reference.md").write_text(markdown(args.folder.name, rows, facts), encoding="utf-8")
    return int(not all(is_within(row) for row in rows))


if __name__ == "__main__":
    raise SystemExit(main())
