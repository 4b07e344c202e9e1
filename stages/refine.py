"""Refine the light of a chunk of surfaces on adaptive quadtrees: the direct half, or the indirect half, which reads
all direct trees.

reads   scene.npz, casters.npz, solution.npz, and chunk_<c>.npz of sample (direct) or all direct_<c>.npz (indirect)
writes  direct_<c>.npz or indirect_<c>.npz          (lib.formats.trees)

settings: seed, tolerance, tolerances, relative_to, t_direct, t_indirect, base_indirect, top, gather_rays, shadow_rays,
smallest_cell, chart_effort, chart_coarser, bounces
"""

import numpy as np

from lib import door
from lib.formats import casters, samples, scene, solution, trees
from lib.formats.mistakes import listed
from lib.radiosity.quality import LOOKUPS, gather_rays
from lib.radiosity.refine import efforts, error_of, lookup_table, rays_of_surfaces, refine_direct, refine_indirect
from lib.radiosity.thresholds import own_light, own_share, thresholds
from lib.radiosity.turned import lit_behind
from lib.radiosity.world import World
from lib.refusal import demand_finite


def arguments(parser):
    """Name the stage's files and settings."""
    for name in ("scene", "casters", "solution", "out"):
        parser.add_argument(f"--{name}", required=True, metavar="FILE")
    parser.add_argument("--half", choices=("direct", "indirect"), required=True)
    parser.add_argument("--samples", metavar="FILE", help="chunk of sample (direct half)")
    parser.add_argument("--direct", nargs="*", default=[], metavar="FILE", help="all direct trees (indirect half)")
    parser.add_argument("--chunk", type=int, required=True)
    parser.add_argument("--chunks", type=int, required=True)
    parser.add_argument("--settings", type=door.json_text, required=True, metavar="JSON")


def body(args, cost):
    """Load, refine, save."""
    world = World(scene.load(args.scene), casters.load(args.casters))
    solved, chosen = solution.load(args.solution), args.settings
    own = own_share(world.scene.names, chosen)
    tau = thresholds(solved, own, args.half, chosen)
    effort = efforts(world, own, chosen["chart_effort"], chosen["chart_coarser"])
    if args.half == "direct":
        x = samples.load(args.samples)
        done, spared = refine_direct(
            world,
            unpacked(x, world),
            chosen["seed"],
            tau,
            chosen["top"],
            chosen["shadow_rays"],
            chosen["smallest_cell"],
            effort,
        )
        cost.notes = dict(zip(("below_horizon", "dim", "agreed"), (int(n) for n in spared), strict=True))
    elif chosen["bounces"] == 1 or not np.any(solved.mean_H):
        done = {}
        cost.notes["no_gather"] = len(world.chunk(args.chunks, args.chunk))
    else:
        direct = {s: t.dense() for path in args.direct for s, t in trees.load(path, "direct")[0].items()}
        mine = world.chunk(args.chunks, args.chunk)
        follows = chosen["bounces"] == "converge"
        table = lookup_table(world, direct, solved, follows)
        rays = rays_of_surfaces(gather_rays(chosen["gather_rays"], own), own_light(solved, chosen))
        top, base = chosen["top"], chosen["base_indirect"]
        smallest = chosen["smallest_cell"]
        done = refine_indirect(world, mine, table, solved, chosen["seed"], tau, top, base, rays, smallest, effort)
        dark = [s for s in done if not direct[s][0].any() and not done[s].value.any()]
        if turned := lit_behind(world, dark, chosen["seed"], chosen["shadow_rays"]):
            names = listed([world.scene.names[s] for s in turned])
            door.warn(f"no light reaches {names}, but their backs are lit: turned inside out? `flip: true` turns them")
    demand_finite({world.scene.names[s]: tree.value for s, tree in done.items()})
    lookups = LOOKUPS * float(np.max(solved.mean_H)) if args.half == "indirect" else 0.0
    trees.save(args.out, args.half, {int(s): stored(t, world.n_groups, lookups) for s, t in done.items()}, cost.notes)
    cost.rays = world.tracer.rays


def unpacked(x, world):
    """{surface: (value, hidden, noise, level)} on the base lattices of a chunk of sample."""
    out = {}
    for k, s in enumerate(x.surface):
        part, shape = slice(x.first[k], x.first[k + 1]), world.lattices[s].shape(x.level[k])
        out[int(s)] = (
            x.value[part].reshape(*shape, -1),
            x.hidden[part].reshape(shape),
            x.noise[part].reshape(shape),
            int(x.level[k]),
        )
    return out


def stored(tree, groups, lookups):
    """The tree as its file holds it."""
    at = np.nonzero(tree.known)
    ji = np.stack(at, axis=1).astype(np.int32)
    value = tree.value[at].reshape(-1, groups, 3)
    return trees.Tree(
        tree.lattice.roots,
        tree.level,
        ji,
        value,
        tree.hidden[at],
        tree.noise[at],
        tree.leaves(),
        error_of(tree, lookups),
    )


def main(argv=None):
    """Run the stage; returns its exit status."""
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
