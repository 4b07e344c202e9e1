"""Shrink the exported textures until their GPU bytes S fit the budget T, giving up the least detail.

reads   textured maps of every chunk, casters.npz (closed directions)     (lib.formats.textured_maps, .casters)
        settings: {"budget": bytes, "profile": "standard" or "lightmap", "order": "loss" or "loss_per_byte"}
writes  textures.npz, all surfaces                                         (lib.formats.textured_maps)
        budget.json: S before and after, who gave up what, the error that this makes; the automatic exposure of the
        textures before

`standard` exports light on its base texture and reduces those maps; `lightmap` exports and reduces the light alone,
and the base textures count as fixed bytes.  `loss` takes the smallest D_i first, as the paper does; `loss_per_byte` the
smallest D_i for the bytes it frees.
"""

import dataclasses

from lib import door
from lib.formats import casters, textured_maps
from lib.formats.artefact import write_json
from lib.maps import budget, exposure
from lib.refusal import Refusal

PROFILES = {"standard": "final", "lightmap": "light"}
MUCH = 0.03  # of the light: an error worth a warning, if the other order halves it at least


def arguments(parser):
    parser.add_argument("--maps", required=True, nargs="+", metavar="FILE", help="textured maps of every chunk")
    parser.add_argument("--casters", required=True, metavar="FILE", help="casters.npz")
    parser.add_argument("--settings", required=True, type=door.json_text, metavar="JSON", help="budget and profile")
    parser.add_argument("--out", required=True, metavar="FILE", help="textures.npz")
    parser.add_argument("--table", required=True, metavar="FILE", help="budget.json")


def body(args, cost):
    x = textured_maps.merge([textured_maps.load(path) for path in args.maps])
    shapes = casters.load(args.casters)
    is_closed = shapes.is_closed
    profile = args.settings.get("profile", "standard")
    if profile not in PROFILES:
        raise Refusal(f"profile: {profile!r}, allowed are {' and '.join(PROFILES)}")
    order = args.settings.get("order", "loss")
    if order not in budget.ORDERS:
        raise Refusal(f"order: {order!r}, allowed are {' and '.join(budget.ORDERS)}")
    T = args.settings.get("budget")
    before = getattr(x, PROFILES[profile])
    fixed = 0 if profile == "standard" else sum(budget.gpu_bytes(w, h) for w, h in x.pictures.values())

    after, steps, D = budget.reduce(before, is_closed[before.surface], T, fixed, order)
    area = shapes.area[before.surface]
    lost = budget.lost(before, after, area) if steps else 0.0
    if order == "loss" and lost > MUCH:
        other = budget.reduce(before, is_closed[before.surface], T, fixed, "loss_per_byte")[0]
        if (less := budget.lost(before, other, area)) < lost / 2:
            off, by_bytes = (f"{100 * share:.2g} %" for share in (lost, less))
            wish = "export: {budget_order: loss_per_byte}"
            door.warn(f"budget: the textures that fit it are {off} off on average, {by_bytes} with `{wish}`")

    textured_maps.save(args.out, dataclasses.replace(x, **{PROFILES[profile]: after}))
    record = table(x.names, profile, order, T, fixed, before, after, steps, D) | {"lost": lost}
    # Brightness is that of the whole light: a smaller budget must not change it.
    write_json(
        args.table, {**record, "exposure": exposure.automatic(textured_maps.reflected(x), shapes.area[x.final.surface])}
    )
    cost.notes["levels_removed"] = len(steps)


def table(names, profile, order, T, fixed, before, after, steps, D):
    """Return the JSON record: totals, one row a surface, one row a removal in order; bytes are GPU bytes."""
    name_of = dict(zip(before.surface.tolist(), names, strict=True))
    (w0, h0), (w1, h1) = before.sizes(), after.sizes()
    surfaces = [
        {
            "surface": names[k],
            "level_before": int(before.level[k]),
            "level_after": int(after.level[k]),
            "size_before": [int(w0[k]), int(h0[k])],
            "size_after": [int(w1[k]), int(h1[k])],
            "bytes_before": budget.gpu_bytes(int(w0[k]), int(h0[k])),
            "bytes_after": budget.gpu_bytes(int(w1[k]), int(h1[k])),
            "D": float(D[k]),
            "D_given_up": sum((step.D for step in steps if step.surface == before.surface[k]), 0.0),
        }
        for k in range(len(names))
    ]
    return {
        "profile": profile,
        "order": order,
        "T": int(T),
        "S_before": budget.total(before, fixed),
        "S_after": budget.total(after, fixed),
        "S_smallest": budget.smallest_total(before.roots, fixed),
        "fixed": fixed,
        "surfaces": surfaces,
        "steps": [{"surface": name_of[s.surface], "level": s.level, "D": s.D, "S": s.S} for s in steps],
    }


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
