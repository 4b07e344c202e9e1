"""What a viewer must show of a bake, from the bake's own arrays and not from the exported files: JSON for check.js.

usage: expected.py RESULTS

Points are samples of the maps, seen along the exact surface's normal.  A colour may be off by what the neighbouring
samples differ (a facet lies a little beside the surface), a step of dithering and one of rounding.
"""

import json
import sys
from pathlib import Path

import numpy as np

from lib.formats import casters, lod_mesh, scene, textured_maps
from lib.formats.artefact import read_json
from lib.formats.gltf import y_up
from lib.maps.colour import linear_to_srgb
from lib.nurbs.evaluate import frame

WALLS, STEPS = 12, 2


def main(results):
    """Print the probes of a result folder."""
    stages = Path(results) / "stages"
    x = scene.load(stages / "import_scene" / "scene.npz")
    shapes = casters.load(stages / "tessellate" / "casters.npz")
    maps = textured_maps.load(stages / "budget_reduce" / "textures.npz")
    level = lod_mesh.load(stages / "lod_export" / "lod_0.npz")
    lods = read_json(Path(results) / "lods.json")
    chosen = probes_of_walls(x, shapes, maps, lods["exposure"], lods["in_vertices"]) + probes_of_lamps(
        x, shapes, lods["exposure"]
    )
    counts = {"meshes": int((np.diff(level.face_start) > 0).sum()), "triangles": len(level.F)}
    print(json.dumps({"counts": {**counts, "textures": len(lods["textures"])}, "probes": chosen}))


def probes_of_walls(x, shapes, maps, exposure, in_vertices):
    """Up to WALLS surfaces, the largest first, and the sample of each quarter where the light changes least."""
    out = []
    order = sorted(range(len(maps.final)), key=lambda k: -shapes.area[maps.final.surface[k]])
    for k in order:
        s = int(maps.final.surface[k])
        value, hidden = maps.final.map(k), maps.final.hidden_map(k)
        h, w = hidden.shape
        if x.names[s] in in_vertices or x.E[s].any() or h < 3 or w < 3 or not value.any():
            continue
        codes = code(value, exposure)
        corners = [(slice(j, h - 2 + j), slice(i, w - 2 + i)) for j in range(3) for i in range(3)]
        spread = np.max([np.abs(codes[c] - codes[1:-1, 1:-1]).max(axis=2) for c in corners], axis=0)
        seen = ~np.any([hidden[c] for c in corners], axis=0)
        spread[~seen] = 1e9
        light = value[1:-1, 1:-1].max(axis=2)
        spread[light < np.median(light[seen]) if seen.any() else ~seen] = (
            1e9  # dark ones may lie below what stands there
        )
        for a, b in [(0, 0), (0, 1), (1, 0), (1, 1)]:  # the calmest sample of each quarter of the map
            rows, columns = np.array_split(np.arange(h - 2), 2)[a], np.array_split(np.arange(w - 2), 2)[b]
            if not len(rows) or not len(columns):
                continue
            part = spread[np.ix_(rows, columns)]
            j, i = np.unravel_index(np.argmin(part), part.shape)
            if part[j, i] > 40:
                continue
            j, i = rows[j] + 1, columns[i] + 1
            out.append(probe(x, shapes, s, i / (w - 1), j / (h - 1), codes[j, i], STEPS + part.min()))
        if len({p["name"] for p in out}) == WALLS:
            break
    return out


def probes_of_lamps(x, shapes, exposure):
    """The middle of every surface that shines and reflects nothing."""
    lamps = [s for s in range(len(x.names)) if x.E[s].any() and x.is_black[s]]
    return [probe(x, shapes, s, 0.5, 0.5, code(x.E[s], exposure), STEPS) for s in lamps]


def code(B, exposure):
    """sRGB codes, 0 to 255, of radiosity B."""
    return 255 * linear_to_srgb(np.asarray(B, dtype=np.float64) / np.pi * exposure)


def probe(x, shapes, s, u, v, rgb, within):
    """One point to look at, y up."""
    S, N = frame(x.surfaces[s], np.array([u]), np.array([v]))
    N = -N if x.flip[s] else N
    return {
        "name": x.names[s],
        "at": y_up(S[0], x.up).tolist(),
        "normal": y_up(N[0], x.up).tolist(),
        "distance": float(0.005 * shapes.extent[s].min() * shapes.scale),
        "rgb": np.rint(rgb).astype(int).tolist(),
        "within": int(np.ceil(within)),
    }


if __name__ == "__main__":
    main(sys.argv[1])
