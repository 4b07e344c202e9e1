"""Solve the bounced light of the elements: progressive refinement, then gather sweeps over the same rows.  Casts no
ray.

reads   scene.npz, casters.npz, chunk_<c>.npz of sample, the reflectances        (lib.formats.scene, .casters, .samples)
writes  solution.npz                                                             (lib.formats.solution)
        convergence.svg: the share of unshot power over the number of shots      (lib.report.charts)

settings: n_elements, convergence, bounces ("converge" or n)
"""

import numpy as np

from lib import door
from lib.elements.grids import POINTS, element_grids
from lib.formats import artefact, casters, samples, scene, solution
from lib.radiosity.shooting import DoesNotConverge, FormFactors, solve
from lib.refusal import Refusal
from lib.report import charts

ABSORBED = -2  # of lib.radiosity.rows, which casts rays and is not loaded here


def arguments(parser):
    """Name the stage's files and settings."""
    for name in ("scene", "casters", "materials", "out"):
        parser.add_argument(f"--{name}", required=True, metavar="FILE")
    parser.add_argument("--plot", metavar="FILE", help="SVG: unshot power over shots")
    parser.add_argument("--samples", nargs="+", required=True, metavar="FILE")
    parser.add_argument("--settings", type=door.json_text, required=True, metavar="JSON")


def body(args, cost):
    """Load, solve, save."""
    x, mesh = scene.load(args.scene), casters.load(args.casters)
    chosen = args.settings
    reflectance = artefact.read_json(args.materials)["rho_avg"]
    rho = np.array([reflectance.get(name, (0.0, 0.0, 0.0)) for name in x.names], dtype=np.float64).reshape(-1, 3)
    reflects = (np.array(x.role) == "full") & ~np.asarray(x.is_black)
    grids = element_grids(mesh.area, mesh.extent, mesh.is_planar, reflects, chosen["n_elements"])
    chunks = [samples.load(path) for path in args.samples]
    entries, met, hidden, is_alone, A_points, H_points = collected(chunks, grids.total, len(x.groups))
    surface = np.repeat(np.arange(len(x.names)), grids.n_u * grids.n_v)
    bounces = None if chosen["bounces"] == "converge" else int(chosen["bounces"])
    F, area = FormFactors(entries, A_points), A_points.sum(axis=1)
    H_direct = np.einsum("npgc,np->ngc", H_points, A_points) / np.maximum(area, 1e-300)[:, None, None]
    B_points = (H_points * rho[surface][:, None, None]).reshape(grids.total, POINTS**2, -1)
    first = F.gather_points(B_points, met)
    try:
        found = solve(H_direct, rho[surface], area, F, chosen["convergence"], bounces, first)
    except DoesNotConverge as error:
        raise Refusal(
            f"the light does not converge: {error}; lower the reflectances or set bounces to a number"
        ) from None
    watts = mesh.scale**2
    total = max(area.sum(), 1e-300)
    weighted = found.H.sum(axis=1) * area[:, None]
    by_surface = np.stack([np.bincount(surface, w, minlength=len(x.names)) for w in weighted.T], axis=1)
    H_surface = by_surface / np.maximum(np.bincount(surface, area, minlength=len(x.names)), 1e-300)[:, None]
    mean_H = weighted.sum(axis=0) / total
    emitted = [(x.E[x.group == g] * mesh.area[x.group == g, None]).sum(axis=0) * watts for g in range(len(x.groups))]
    ledger = {name: (power * watts).tolist() for name, power in found.ledger.items()}
    ledger["emitted"] = [power.tolist() for power in emitted]
    facts = {"shots": found.shots, "sweeps": found.sweeps, "elements": grids.total, "ambient": found.ambient.tolist()}
    solution.save(
        args.out,
        solution.Solution(
            np.maximum(found.H - H_direct, 0).astype(np.float32),
            is_alone,
            hidden,
            F.spread(found.H.sum(axis=1) * rho[surface]).astype(np.float32),
            found.H.sum(axis=1).max(axis=1, initial=0.0).astype(np.float32),
            grids.n_u,
            grids.n_v,
            rho,
            mean_H,
            H_surface,
            found.history,
            ledger,
            facts,
        ),
    )

    if args.plot:
        shots, unshot = found.history.T if len(found.history) else ([], [])
        with artefact.atomic(args.plot) as file:
            file.write(charts.standalone(charts.convergence(shots, unshot, chosen["convergence"])).encode())


def collected(chunks, total, groups):
    """Entries (n, R), the points they meet (n, R), hidden points (n, 16), is_alone (n,), area of the points (n, 16)
    and direct light there (n, 16, G, 3) of all elements, in order.  What meets a hidden point of an element, the far
    side of a wall on it, is absorbed.
    """
    width = max((c.entries.shape[1] for c in chunks if len(c.entries)), default=1)
    entries = np.full((total, width), -3, dtype=np.int32)
    met, hidden = np.zeros(entries.shape, dtype=np.uint8), np.ones((total, POINTS**2), dtype=bool)
    area, H_points = np.zeros((total, POINTS**2)), np.zeros((total, POINTS**2, groups, 3))
    is_alone = np.zeros(total, dtype=bool)
    for c in chunks:
        if len(c.element):
            entries[c.element], met[c.element], hidden[c.element] = c.entries, c.met, c.is_hidden
            is_alone[c.element], area[c.element], H_points[c.element] = c.is_alone, c.area, c.H_direct
    if total:
        entries = np.where((entries >= 0) & hidden[entries, met], ABSORBED, entries)
    return entries, met, hidden, is_alone, area, H_points


def main(argv=None):
    """Run the stage; returns its exit status."""
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
