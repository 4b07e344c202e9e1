"""Cut one level of detail of the whole scene from the exact surfaces, and measure how far it is from them.

reads   scene.npz, casters.npz; ladder.npz, which spares finding out how meshes are thinned; textures.npz if light is to
        be stored in vertices                        (lib.formats.scene, .casters, .mesh_ladder, .textured_maps)
        levels: JSON list, finest first, of {"deviation": length}, {"triangles": n}, {"share": x} or a bare share
writes  lod_<k>.npz                                                (lib.formats.lod_mesh)

A length is a number in the scene's unit, text like "0.5 mm", or "0.01 %" of the scene's largest side.  A share is one
of the first level's triangles, or of a level of 0.01 % deviation where the first is a share itself.

With textures.npz, surfaces of reconstruction `gouraud`, and `auto` ones whose map is at its smallest, get vertices on
every line of their map's lattice.
"""

import json

import numpy as np

from lib import door
from lib.formats import casters, lod_mesh, scene, textured_maps
from lib.formats.artefact import ArtefactError
from lib.formats.quantities import METRES, metres
from lib.lod.levels import DEVIATION, Scene, TooFine
from lib.refusal import refusal
from lib.surfaces import tessellate


def arguments(parser):
    parser.add_argument("--scene", required=True, metavar="FILE", help="scene.npz")
    parser.add_argument("--casters", required=True, metavar="FILE", help="casters.npz")
    parser.add_argument("--ladder", metavar="FILE", help="ladder.npz, of the scene's meshes")
    parser.add_argument("--textures", metavar="FILE", help="textures.npz, for light in vertices")
    parser.add_argument("--level", required=True, type=door.json_text, metavar="JSON", help="the level asked for")
    parser.add_argument("--level-index", required=True, type=int, metavar="K", help="its number, 0 is the finest")
    parser.add_argument("--finest", metavar="FILE", help="lod_<j>.npz, of whose triangles it is a share")
    parser.add_argument("--units", default="m", choices=sorted(METRES), help="of lengths without a unit (default m)")
    parser.add_argument("--reconstruction", type=door.json_text, default={}, metavar="JSON", help="{surface: way}")
    parser.add_argument("--out", required=True, metavar="FILE", help="lod_<k>.npz")


def body(args, cost):
    x, shapes = scene.load(args.scene), casters.load(args.casters)
    own, of = np.flatnonzero(x.front < 0), shapes_of(x.front)
    surfaces = tessellate.into_frame([x.surfaces[s] for s in own], shapes.centre, shapes.scale)
    k, asked = args.level_index, args.level if isinstance(args.level, dict) else {"share": args.level}
    try:
        lines = lattice(x.names, args.textures, args.reconstruction)
        lines = {int(of[s]): joined(lines, np.flatnonzero(of == of[s])) for s in lines}
        pieces = scene_of(surfaces, known(shapes, own), lines, np.bincount(of), args.ladder)
        count = len(lod_mesh.load(args.finest).F) if args.finest else None
        level = cut(pieces, asked, count, args.units, shapes.scale)
    except TooFine as error:
        raise refusal(f"{json.dumps(asked)} {error}", field=f"lods[{k}]") from None
    note = ""
    if level.is_smallest:
        note = (
            f"{level.asked} triangles asked for, these surfaces need {np.bincount(of) @ np.diff(level.mesh.face_start)}"
        )
    elif "deviation" in asked and level.mesh.distance.max() > level.tolerance:
        wanted, reached = (f"{x * shapes.scale:.3g}" for x in (level.tolerance, level.mesh.distance.max()))
        note = f"{wanted} m asked for, {reached} m reached" if wanted != reached else ""
    if note and "share" not in asked:  # who asks for a share asks for no number: lods.json tells it
        door.warn(f"lods[{k}]: {note}")
    made = in_metres(level, shapes, of, np.asarray(x.flip, dtype=bool), k, asked, note)
    lod_mesh.save(args.out, made)
    cost.notes.update(level=k, triangles=len(made.F), distance=float(made.distance.max()))


def scene_of(surfaces, known, lines, copies, ladder):
    """The lib.lod.levels.Scene, with what a ladder file tells of its meshes."""
    if ladder is None:
        return Scene(surfaces, known, lines, copies)
    from lib.formats import mesh_ladder  # here: scenes without meshes need none of it

    found = mesh_ladder.load(ladder)
    try:
        return Scene(surfaces, known, lines, copies, found)
    except ValueError as error:
        raise ArtefactError(f"{ladder}: {error}; delete it to have it made again") from error


def shapes_of(front):
    """(n,) which of the shapes, numbered without the backs, each surface has."""
    own = np.flatnonzero(front < 0)
    return np.searchsorted(own, np.where(front < 0, np.arange(len(front)), front))


def known(shapes, own):
    """What is known of the surfaces `own` (k,) alone, numbered from 0."""
    borders = shapes.borders.copy()
    borders[:, [0, 2]] = np.searchsorted(own, borders[:, [0, 2]])
    fields = ("area", "extent", "is_planar", "is_closed", "is_collapsed", "shell")
    return tessellate.Shapes(**{field: getattr(shapes, field)[own] for field in fields}, borders=borders)


def joined(lines, both):
    """The lines (u, v) of all sides of a sheet."""
    return tuple(np.unique(np.concatenate([lines[s][d] for s in both if s in lines])) for d in (0, 1))


def lattice(names, textures, reconstruction):
    """{surface: (u, v)} the inner lattice lines of the maps whose light goes into vertices."""
    if textures is None:
        return {}
    maps = textured_maps.load(textures)
    out = {}
    for k, s in enumerate(maps.final.surface.tolist()):
        asked = reconstruction.get(names[s], "auto")
        is_smallest = maps.final.level[k] == 0 and not maps.textured[k]
        if asked == "gouraud" or (asked == "auto" and is_smallest):
            h, w = maps.final.hidden_map(k).shape
            out[s] = (np.arange(1, w - 1) / (w - 1), np.arange(1, h - 1) / (h - 1))
    return out


def cut(pieces, asked, count, units, scale):
    """The Level `asked` for of the Scene `pieces`, whose frame is `scale` metres.

    count : triangles of the level that it is a share of; None: of the finest there is where none is named
    """
    if "deviation" in asked:
        return pieces.by_deviation(_deviation(asked, units, scale))
    if "triangles" in asked:
        return pieces.by_count(int(asked["triangles"]))
    if count is None and asked["share"] == 1:
        return pieces.by_deviation(DEVIATION)
    return pieces.by_count(int(asked["share"] * (pieces.n_within(DEVIATION) if count is None else count)))


def _deviation(asked, units, scale):
    length = metres(asked["deviation"], units, scale)
    if not length > 0:
        raise refusal(f"{asked['deviation']}, allowed are lengths > 0", field="lods: deviation")
    return length / scale


def in_metres(level, shapes, of, flip, k, asked, note):
    """The LodMesh of a Level: out of the frame, turned where the surface is; of (n,), the shape of each surface."""
    mesh, scale = level.mesh, shapes.scale
    parts = [_part(level, shape, turned) for shape, turned in zip(of, flip, strict=True)]
    vertex_start = np.cumsum([0, *(len(part[0]) for part in parts)]).astype(np.int64)
    V, N, UV, F = (np.concatenate(field) for field in zip(*parts, strict=True))
    face_start = np.cumsum([0, *(len(part[3]) for part in parts)]).astype(np.int64)
    return lod_mesh.LodMesh(
        V=shapes.centre + scale * V,
        N=N.astype(np.float32),
        UV=UV,
        F=F + np.repeat(vertex_start[:-1], np.diff(face_start))[:, None].astype(F.dtype),
        vertex_start=vertex_start,
        face_start=face_start,
        distance=mesh.distance[of] * scale,
        rms=mesh.rms[of] * scale,
        slide=mesh.slide[of] * scale,
        level=k,
        asked=asked,
        tolerance=level.tolerance * scale,
        gap=level.gap * scale,
        note=note,
    )


def _part(level, shape, turned):
    """V, N, UV and F, counted from 0, of one of the shapes of a level."""
    mesh = level.mesh
    vertices, faces = (slice(*start[shape : shape + 2]) for start in (mesh.vertex_start, mesh.face_start))
    F = mesh.F[faces] - np.int32(mesh.vertex_start[shape])
    N = level.N[vertices]
    return mesh.V[vertices], -N if turned else N, mesh.UV[vertices], F[:, ::-1] if turned else F


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
