"""How the cost of every stage grows: python benchmarks/growth.py --help.

Scenes made for it, two decades of surfaces, texels, triangles, lights and elements, each axis alone as far as that
can be.  CPU seconds of the stages; the exponent is the slope in logarithms over the upper decade, of
the stages that matter there. Writes growth.md and growth_<axis>.svg into benchmarks/results.
"""

import argparse
import json
import math
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import bake  # noqa: E402
import charts  # noqa: E402
import yaml  # noqa: E402
from run import machine  # noqa: E402

from lib.formats import casters, solution  # noqa: E402

LEAST = 0.1  # CPU seconds that say something
QUICK = {"gather_rays": 32, "rays_per_element": 32, "elements": 400, "max_level": 4}


def room(x=6.0, y=5.0, z=3.0):
    """Six walls, seen from inside."""
    sides = {
        "floor": ([0, 0, 0], [x, 0, 0], [0, y, 0]),
        "ceiling": ([0, 0, z], [0, y, 0], [x, 0, 0]),
        "left": ([0, 0, 0], [0, y, 0], [0, 0, z]),
        "right": ([x, 0, 0], [0, 0, z], [0, y, 0]),
        "front": ([0, 0, 0], [0, 0, z], [x, 0, 0]),
        "back": ([0, y, 0], [x, 0, 0], [0, 0, z]),
    }
    return [rectangle(name, *side, "white") for name, side in sides.items()]


def rectangle(name, origin, u, v, material):
    """An entry of `geometry`."""
    return {"name": name, "rectangle": {"origin": origin, "u": u, "v": v}, "material": material}


def lamps(n, z=2.99, side=0.2, x=6.0, y=5.0):
    """n lamps below the ceiling, facing down, in rows."""
    columns = math.ceil(math.sqrt(n * x / y))
    rows = math.ceil(n / columns)
    places = [((i + 0.5) * x / columns, (j + 0.5) * y / rows) for j in range(rows) for i in range(columns)][:n]
    return [
        rectangle(f"lamp {k}", [a - side / 2, b - side / 2, z], [0, side, 0], [side, 0, 0], "lamp")
        for k, (a, b) in enumerate(places)
    ]


def tiles(n):
    """n small panels hung at many heights and angles, in a room."""
    per_side = math.ceil(n ** (1 / 3))
    out = []
    for k in range(n):
        i, j, l = k % per_side, k // per_side % per_side, k // per_side**2
        a, side = 2.399963 * k, 2.0 / per_side
        at = [0.5 + 5.0 * i / per_side, 0.5 + 4.0 * j / per_side, 0.3 + 2.2 * l / per_side]
        out.append(
            rectangle(f"tile {k}", at, [side * math.cos(a), side * math.sin(a), 0], [0, 0.3 * side, side], "grey")
        )
    return out


def balls(n, radius=0.5):
    """n spheres in rows, as files of surfaces of revolution would give them: rational quadratics."""
    w = math.sqrt(0.5)
    ring = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    profile = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1)]
    knots = [0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1]
    out = []
    for k in range(n):
        centre = (1.2 + 1.8 * (k % 3), 1.2 + 2.2 * (k // 3 % 2), 0.8)
        points = [
            [[centre[0] + radius * a * r, centre[1] + radius * b * r, centre[2] + radius * h] for r, h in profile]
            for a, b in ring
        ]
        weights = [[(w if i % 2 else 1) * (w if j % 2 else 1) for j in range(5)] for i in range(9)]
        shape = {
            "degree_u": 2,
            "degree_v": 2,
            "knots_u": knots,
            "knots_v": [0, 0, 0, 0.5, 0.5, 1, 1, 1],
            "points": points,
            "weights": weights,
        }
        out.append({"name": f"ball {k}", "nurbs": shape, "material": "grey"})
    return out


def scene(geometry, bake_settings, lamp=40.0):
    """A scene.yaml as a dict; lamp : W/m^2, or {name pattern: W/m^2} on top of 40."""
    materials = {
        "white": {"reflectance": 0.7},
        "grey": {"reflectance": 0.5},
        "lamp": {"reflectance": 0, "emission": [40.0] * 3},
    }
    overrides = {}
    if isinstance(lamp, dict):
        for k, (pattern, power) in enumerate(lamp.items()):
            materials[f"lamp {k}"] = {"reflectance": 0, "emission": [power] * 3}
            overrides[pattern] = {"material": f"lamp {k}"}
    return {"geometry": geometry, "materials": materials, "surfaces": overrides, "bake": bake_settings, "lods": [1.0]}


def dim(n):
    """All lamps but the first two a millionth as bright."""
    return {f"lamp {k}": 4e-5 for k in range(2, n)}


AXES = {  # name: (what it counts, sizes, scene of a size)
    "surfaces": ("surfaces", (2, 10, 32, 100, 320, 1000), lambda n: scene(room() + lamps(2) + tiles(n), QUICK)),
    "texels": (
        "texels of all maps",
        (4, 5, 6, 7, 8, 9),
        lambda n: scene(
            room() + lamps(2) + tiles(12),
            {"gather_rays": 32, "max_level": n, "tolerance": 0.005, "shadow_rays": [16, 64]},
        ),
    ),
    "triangles": (
        "triangles that cast shadows",
        (1e-3, 3e-4, 1e-4, 3e-5, 1e-5),
        lambda sag: scene(room() + lamps(2) + balls(4, 0.75), {**QUICK, "sag": sag}),
    ),
    "lights": (
        "lamps",
        (2, 4, 10, 20, 50, 100),
        lambda n: scene(room() + lamps(n) + tiles(12), {"gather_rays": 32, "max_level": 5}),
    ),
    "dim lights": (
        "lamps, all but two dim",
        (2, 4, 10, 20, 50, 100),
        lambda n: scene(room() + lamps(n) + tiles(12), {"gather_rays": 32, "max_level": 5}, dim(n)),
    ),
    "elements": (
        "elements",
        (100, 300, 1000, 3000, 10000, 30000, 100000, 300000),
        lambda n: scene(room() + lamps(2) + tiles(30), {**QUICK, "elements": n}),
    ),
}


def measured(axis, size, work):
    """One bake: {"size", "stages": {stage: CPU seconds}, "rays"}."""
    folder = work / "scenes" / "growth"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.yaml").write_text(yaml.safe_dump(AXES[axis][2](size)))
    results, figures = bake.bake(folder, work / "growth")
    stages = results / "stages"
    counted = {
        "texels": lambda: figures["texels"],
        "triangles": lambda: len(casters.load(stages / "tessellate" / "casters.npz").F),
        "elements": lambda: int(sum(len(x) for x in [solution.load(stages / "shoot" / "solution.npz").H_indirect])),
        "surfaces": lambda: size + 8,
    }
    seconds = {name: row["cpu"] for name, row in figures["stages"].items()}
    seconds["snakemake"] = figures["scheduling"]
    return {
        "size": counted.get(axis, lambda: size)(),
        "stages": seconds,
        "rays": figures["rays"],
        "peak_mb": figures["peak_mb"],
    }


def exponents(rows):
    """{stage: slope} between the largest size and the one about a decade below, of stages that take LEAST there."""
    last = rows[-1]
    first = max((r for r in rows if r["size"] <= last["size"] / 8), key=lambda r: r["size"], default=rows[0])
    wide = math.log(last["size"] / first["size"])
    return {
        name: math.log(cpu / max(first["stages"].get(name, 0.0), 0.02)) / wide
        for name, cpu in last["stages"].items()
        if cpu > LEAST
    }


def markdown(table, on):
    """A table an axis."""
    text = [
        "# Growth",
        "",
        f"Made by `python benchmarks/growth.py`; {on['cores']} cores of {on['processor']}, commit {on['commit']}.",
        "CPU seconds of each stage; the last line is the exponent over the upper decade.",
        "",
    ]
    for axis, rows in table.items():
        names = [n for n in rows[-1]["stages"] if max(r["stages"].get(n, 0) for r in rows) > LEAST]
        slope = exponents(rows)
        text += [
            f"## {AXES[axis][0].capitalize()}",
            "",
            "| " + " | ".join([axis, "rays, M", "peak MB", *names]) + " |",
            "|---" * (len(names) + 3) + "|",
        ]
        for r in rows:
            cells = [
                f"{r['size']:,}",
                f"{r['rays'] / 1e6:.1f}",
                f"{r['peak_mb']:.0f}",
                *(f"{r['stages'].get(n, 0):.2f}" for n in names),
            ]
            text.append("| " + " | ".join(cells) + " |")
        text += ["| exponent | | | " + " | ".join(f"{slope[n]:.2f}" if n in slope else "" for n in names) + " |", ""]
    return "\n".join(text)


def picture(axis, rows):
    """The stages that cost most, over the size."""
    names = sorted((n for n in rows[-1]["stages"] if n != "snakemake"), key=lambda n: -rows[-1]["stages"][n])[:6]
    curves = [(n, [(r["size"], max(r["stages"].get(n, 0), 0.01)) for r in rows]) for n in names]
    return charts.loglog(f"CPU seconds over {AXES[axis][0]}", AXES[axis][0], "CPU seconds", curves)


def main(argv=None):
    """Measure the axes asked for; results of others are kept."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--axes", nargs="+", default=list(AXES), choices=list(AXES))
    parser.add_argument("--most", type=int, help="how many sizes, from the smallest")
    args = parser.parse_args(argv)
    work, out = HERE.parent / "results" / "benchmarks", HERE / "results"
    out.mkdir(exist_ok=True)
    kept = out / "growth.json"
    table = json.loads(kept.read_text()) if kept.exists() else {}
    for axis in args.axes:
        table[axis] = []
        for size in AXES[axis][1][: args.most]:
            row = measured(axis, size, work)
            table[axis].append(row)
            print(axis, row["size"], {n: round(s, 2) for n, s in row["stages"].items() if s > LEAST}, flush=True)
        kept.write_text(json.dumps(table, indent=1))
        (out / f"growth_{axis.replace(' ', '_')}.svg").write_text(picture(axis, table[axis]), encoding="utf-8")
        (out / "growth.md").write_text(markdown(table, machine()), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
