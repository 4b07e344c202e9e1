"""Sample a chunk of surfaces: direct light on uniform uv crossings, and the elements with their form factor rows.

reads   scene.npz, casters.npz                  (lib.formats.scene, .casters)
writes  chunk_<c>.npz                           (lib.formats.samples)

settings: seed, n_elements, rays_per_element, first_shadow_rays [n0, n1], base_direct, bounces
"""

import numpy as np

from lib import door
from lib.elements.grids import POINTS
from lib.formats import casters, samples, scene
from lib.radiosity.sampling import base_lattice, elements_of
from lib.radiosity.world import World
from lib.refusal import demand_finite


def arguments(parser):
    """Name the stage's files and settings."""
    for name in ("scene", "casters", "out"):
        parser.add_argument(f"--{name}", required=True, metavar="FILE")
    parser.add_argument("--chunk", type=int, required=True)
    parser.add_argument("--chunks", type=int, required=True)
    parser.add_argument("--settings", type=door.json_text, required=True, metavar="JSON")


def body(args, cost):
    """Load, sample, save."""
    world = World(scene.load(args.scene), casters.load(args.casters))
    chosen = args.settings
    grids = world.grids(chosen["n_elements"])
    mine = world.chunk(args.chunks, args.chunk)
    level, seed = chosen["base_direct"], chosen["seed"]
    base, spared = base_lattice(world, mine, seed, level, chosen["first_shadow_rays"])
    demand_finite({world.scene.names[s]: value for s, (value, *_) in base.items()})
    bounces = chosen["bounces"] != 1 and len(world.emitters.E) > 0
    rays = chosen["rays_per_element"] if bounces else 0
    lit = [s for s in mine if grids.n_u[s]]
    elements = elements_of(world, lit, seed, grids, rays, base)
    samples.save(args.out, packed(mine, base, lit, elements, grids, world.n_groups))
    cost.rays = world.tracer.rays
    cost.notes = dict(zip(("below_horizon", "dim", "agreed"), (int(n) for n in spared), strict=True))
    cost.notes["hidden_points"] = int(sum(e.rows.is_hidden.sum() for e in elements))
    cost.notes["no_rows"] = 0 if bounces else int(sum(len(e.area) for e in elements))


def packed(surfaces, base, lit, elements, grids, groups):
    """Samples from per-surface pieces."""
    lattices, levels = [base[s][:3] for s in surfaces], [base[s][3] for s in surfaces]
    fields = [
        np.concatenate([np.zeros((0, *a[0].shape[2:]), a[0].dtype), *(x.reshape(-1, *x.shape[2:]) for x in a)])
        for a in zip(*lattices, strict=True)
    ] or [np.zeros((0, 3 * groups), np.float32), np.zeros(0, bool), np.zeros(0, np.float32)]
    rows = [e.rows for e in elements]
    width = rows[0].entries.shape[1] if rows else 1
    return samples.Samples(
        np.asarray(surfaces, dtype=np.int32),
        np.array(levels, dtype=np.int32),
        np.cumsum([0, *(x[1].size for x in lattices)]),
        *fields,
        np.concatenate(
            [np.zeros(0, np.int32), *(np.arange(grids.first[s], grids.first[s + 1], dtype=np.int32) for s in lit)]
        ),
        np.concatenate([np.zeros((0, width), np.int32), *(r.entries for r in rows)]),
        np.concatenate([np.zeros((0, width), np.uint8), *(r.met for r in rows)]),
        np.concatenate([np.zeros((0, 16), bool), *(r.is_hidden for r in rows)]),
        np.concatenate([np.zeros(0, bool), *(e.is_alone for e in elements)]),
        np.concatenate([np.zeros((0, POINTS**2)), *(e.area for e in elements)]),
        np.concatenate(
            [np.zeros((0, POINTS**2, groups, 3)), *(e.H_direct.reshape(-1, POINTS**2, groups, 3) for e in elements)]
        ).astype(np.float32),
    )


def main(argv=None):
    """Run the stage; returns its exit status."""
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
