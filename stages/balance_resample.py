"""Turn the trees of a chunk into plain maps: balance, the recursive bilinear transform, direct and indirect added,
idle levels dropped.

reads   scene.npz, solution.npz, direct_<c>.npz, indirect_<c>.npz                  (lib.formats.scene, .solution,
.trees) writes  chunk_<c>.npz: irradiance H per light group                                (lib.formats.light_maps)

settings: tolerance, tolerances, relative_to, t_direct, t_indirect
"""

import numpy as np

from lib import door
from lib.formats import light_maps, scene, solution, trees
from lib.maps.combine import combine
from lib.maps.mapset import MapSet
from lib.radiosity.thresholds import own_share, thresholds

IDLE = 0.25  # levels within this share of the threshold of their prediction say nothing


def arguments(parser):
    """Name the stage's files and settings."""
    for name in ("scene", "solution", "direct", "indirect", "out"):
        parser.add_argument(f"--{name}", required=True, metavar="FILE")
    parser.add_argument("--settings", type=door.json_text, required=True, metavar="JSON")


def body(args, cost):
    """Load, resample, save."""
    x, solved = scene.load(args.scene), solution.load(args.solution)
    direct, indirect = trees.load(args.direct, "direct")[0], trees.load(args.indirect, "indirect")[0]
    tau = thresholds(solved, own_share(x.names, args.settings), "direct", args.settings)
    maps, stats = {}, {}
    for s, tree in sorted(direct.items()):
        other = indirect.get(s)
        halves = [(*t.dense(), t.level) for t in (tree, other) if t is not None]
        H, hidden, level = combine(halves[0], halves[1] if other else None, IDLE * tau[s])
        maps[s] = tree.roots, level, H, hidden
        stats[x.names[s]] = figures(tree, other, level, H, hidden)
    light_maps.save(args.out, light_maps.LightMaps(packed(maps, len(x.groups)), stats))
    measured = sum(max(row["level_direct"], row["level_indirect"]) for row in stats.values())
    cost.notes["levels_dropped"] = measured - sum(row["level"] for row in stats.values())
    cost.notes["hidden_samples"] = sum(row["hidden"] for row in stats.values())


def figures(direct, indirect, level, H, hidden):
    """What the report says of one surface."""
    halves = [t for t in (direct, indirect) if t is not None]
    seen = H[~hidden].sum(axis=1)
    return {
        "level": int(level),
        "level_direct": int(direct.level),
        "level_indirect": int(indirect.level) if indirect else 0,
        "samples_direct": len(direct.ji),
        "samples_indirect": len(indirect.ji) if indirect else 0,
        "leaves": max(len(t.leaves) for t in halves),
        "hidden": int(hidden.sum()),
        "texels": int(hidden.size),
        "mean_H": [float(c) for c in seen.mean(axis=0)] if seen.size else [0.0, 0.0, 0.0],
        "error": float(np.sqrt(sum(t.error**2 for t in halves))),
    }


def packed(maps, groups):
    """MapSet of {surface: (roots, level, H (h, w, G, 3), hidden (h, w))}."""
    order = sorted(maps)
    return MapSet(
        np.array(order, dtype=np.int32),
        np.array([maps[s][0] for s in order], dtype=np.int32).reshape(-1, 2),
        np.array([maps[s][1] for s in order], dtype=np.int32),
        np.concatenate([np.zeros((0, groups, 3), np.float32), *(maps[s][2].reshape(-1, groups, 3) for s in order)]),
        np.concatenate([np.zeros(0, bool), *(maps[s][3].ravel() for s in order)]),
    )


def main(argv=None):
    """Run the stage; returns its exit status."""
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
