"""Refine the light of a chunk of surfaces on adaptive quadtrees: the direct half, or the indirect half, whose rays
read the radiosity maps of all chunks.

reads   scene.npz, casters.npz, solution.npz, and chunk_<c>.npz of sample (direct), or direct_<c>.npz and all
        radiosity_<c>.npz (indirect)
writes  direct_<c>.npz or indirect_<c>.npz          (lib.formats.trees)
        radiosity_<c>.npz (direct)                  (lib.formats.radiosity_maps)

settings: seed, tolerance, tolerances, relative_to, t_direct, t_indirect, base_indirect, top, gather_rays, shadow_rays,
smallest_cell, chart_effort, chart_coarser, bounces
"""

import numpy as np

from lib import door
from lib.formats import casters, samples, scene, solution, trees
from lib.formats import radiosity_maps as radiosity_file
from lib.formats.mistakes import listed
from lib.radiosity.quality import LOOKUPS, gather_rays
from lib.radiosity.radiosity_maps import radiosity_maps
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
    parser.add_argument("--radiosity-out", metavar="FILE", help="radiosity maps of the chunk (direct half)")
    parser.add_argument("--direct", metavar="FILE", help="direct trees of the chunk (indirect half)")
    parser.add_argument("--radiosity", nargs="+", metavar="FILE", help="radiosity maps of all chunks (indirect half)")
    parser.add_argument("--chunk", type=int, required=True)
    parser.add_argument("--chunks", type=int, required=True)
    parser.add_argument("--settings", type=door.json_text, required=True, metavar="JSON")


def body(args, cost):
    """Load, refine, save."""
    world = World(scene.load(args.scene), casters.load(args.casters))
    solved, chosen = solution.load(args.solution), args.settings
    own = own_share(world.scene.names, chosen)
    tau = thresholds(solved, own, args.half, chosen)
    mine = world.chunk(args.chunks, args.chunk)
    effort = efforts(world, mine, own, chosen["chart_effort"], chosen["chart_coarser"])
    gathers = chosen["bounces"] != 1 and bool(np.any(solved.mean_H))
    if args.half == "direct":
        done = direct_half(args, world, tau, effort, cost)
    elif gathers:
        done = indirect_half(args, world, mine, solved, own, tau, effort)
    else:
        done = {}
        cost.notes["no_gather"] = len(mine)
    demand_finite({world.scene.names[s]: tree.value for s, tree in done.items()})
    if args.half == "direct":
        radiosity_file.save(args.radiosity_out, radiosity_maps(world, done if gathers else {}, solved))
    lookups = LOOKUPS * float(np.max(solved.mean_H)) if args.half == "indirect" else 0.0
    trees.save(args.out, args.half, {int(s): stored(t, world.n_groups, lookups) for s, t in done.items()}, cost.notes)
    cost.rays = world.tracer.rays


def direct_half(args, world, tau, effort, cost):
    """{surface: Quadtree} of direct light, from the base lattices of sample."""
    base, chosen = unpacked(samples.load(args.samples), world), args.settings
    seed, top, smallest = chosen["seed"], chosen["top"], chosen["smallest_cell"]
    done, spared = refine_direct(world, base, seed, tau, top, chosen["shadow_rays"], smallest, effort)
    cost.notes = dict(zip(("below_horizon", "dim", "agreed"), (int(n) for n in spared), strict=True))
    return done


def indirect_half(args, world, mine, solved, own, tau, effort):
    """{surface: Quadtree} of indirect light; warns of surfaces that seem to be turned inside out."""
    chosen = args.settings
    seed, top, base, smallest = (chosen[key] for key in ("seed", "top", "base_indirect", "smallest_cell"))
    direct, maps = trees.load(args.direct, "direct")[0], [radiosity_file.load(path) for path in args.radiosity]
    table = lookup_table(world, maps, solved, chosen["bounces"] == "converge")
    rays = rays_of_surfaces(gather_rays(chosen["gather_rays"], own), own_light(solved, chosen))
    done = refine_indirect(world, mine, table, solved, seed, tau, top, base, rays, smallest, effort)
    dark = [s for s in done if not direct[s].value.any() and not done[s].value.any()]
    if turned := lit_behind(world, dark, seed, chosen["shadow_rays"]):
        names = listed([world.scene.names[s] for s in turned])
        door.warn(f"no light reaches {names}, but their backs are lit: turned inside out? `flip: true` turns them")
    return done


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
