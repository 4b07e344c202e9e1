"""Make the mesh that casts shadows, close enough to the exact surfaces for rays, and find out what each surface is as
a shape.

reads   scene.npz                                                           (lib.formats.scene)
        settings: {"sag": largest distance from the exact surface, share of the scene's largest side (default 0.001)}
writes  casters.npz                                                         (lib.formats.casters)

A surface is also kept within 2/1000 of its own size, so that small objects stay round. No level of detail touches
this mesh.
"""

import numpy as np

from lib import door, forks
from lib.formats import casters, scene
from lib.nurbs.coincident import back_to_back
from lib.nurbs.surface import NurbsSurface
from lib.refusal import refusal
from lib.surfaces import tessellate
from lib.surfaces.closed import in_closed_shell
from lib.surfaces.frames import part_of

NO_PART = np.empty((0, 3, 2)), np.empty((0, 3), dtype=bool)  # of a back, which has that of its front
SAG, OWN_SAG = 1e-3, 2e-3  # of the frame; of the surface's own size


def arguments(parser):
    parser.add_argument("--scene", required=True, metavar="FILE", help="scene.npz")
    parser.add_argument("--settings", type=door.json_text, default={}, metavar="JSON", help="sag")
    parser.add_argument("--out", required=True, metavar="FILE", help="casters.npz")


def body(args, cost):
    x = scene.load(args.scene)
    sag = float(args.settings.get("sag", SAG))
    if not 1e-6 <= sag <= 0.1:
        raise refusal(f"{sag:g}, allowed are 0.000001 to 0.1", field="sag")
    made = make(x.surfaces, x.flip, x.role, sag, x.front)
    casters.save(args.out, made)
    cost.notes.update(
        triangles=len(made.F),
        surfaces=len(x.surfaces),
        borders=len(made.borders),
        shells=int(made.shell.max(initial=-1)) + 1,
        sag=float(made.sag.max(initial=0.0)),
    )


def make(surfaces, flip, role, sag, front=None):
    """The Casters of surfaces (n,), turned where flip (n,), with their role (n,), to `sag` of the frame.

    front (n,) int: the surface whose back this is, or -1; backs have no triangles of their own.
    """
    front = np.full(len(surfaces), -1) if front is None else np.asarray(front)
    own = np.flatnonzero(front < 0)
    blocks = np.array([r != "receive_only" for r in role], dtype=bool)[own]
    centre, scale = tessellate.frame([surfaces[s] for s in own])
    surfaces = tessellate.into_frame([surfaces[s] for s in own], centre, scale)
    known = tessellate.shapes(surfaces, blocks)
    size = known.extent.max(axis=1)
    pieces = tessellate.Pieces(surfaces, known)
    parts = forks.mapped(part_of, surfaces)
    patches = pieces.cut_within(np.minimum(sag, OWN_SAG * size), tessellate.SLIDE * size)
    mesh = tessellate.assemble(patches, surfaces, known)
    F, face_own = mesh.F.copy(), np.repeat(np.arange(len(own)), np.diff(mesh.face_start))
    turned = np.asarray(flip, dtype=bool)[own][face_own]
    F[turned] = F[turned][:, ::-1]
    keep = blocks[face_own]
    of = np.searchsorted(own, np.where(front < 0, np.arange(len(front)), front))  # what each is the shape of
    borders = known.borders.copy()
    borders[:, [0, 2]] = own[borders[:, [0, 2]]]
    return casters.Casters(
        centre=centre,
        scale=scale,
        V=mesh.V,
        UV=mesh.UV,
        F=F[keep],
        face_surface=own[face_own[keep]].astype(np.int32),
        face_shell=(known.shell >= 0)[face_own[keep]] | in_closed_shell(mesh.V, F[keep]),
        area=known.area[of],
        extent=known.extent[of],
        sag=np.where(known.is_planar, 0.0, mesh.distance)[of],
        is_planar=known.is_planar[of],
        is_closed=known.is_closed[of],
        is_collapsed=known.is_collapsed[of],
        is_back_to_back=sheets(surfaces, np.asarray(flip)[own])[of],
        shell=known.shell[of],
        borders=borders,
        **packed([parts[k] if front[s] < 0 else NO_PART for s, k in enumerate(of)]),
    )


def sheets(surfaces, flip):
    """(n,) bool: the whole ones of the surfaces (n,) in the frame, turned where flip (n,), that stand back to back."""
    whole = [s for s, surface in enumerate(surfaces) if isinstance(surface, NurbsSurface)]
    out = np.zeros(len(surfaces), dtype=bool)
    out[whole] = back_to_back([surfaces[s] for s in whole], flip[whole], 1.0)
    return out


def packed(parts):
    """The fields of Casters of what part_of says of each surface."""
    sizes = np.array([[len(uv), len(border)] for uv, border in parts], dtype=np.int64).reshape(-1, 2)
    return {
        "part_start": np.concatenate([np.zeros((1, 2), np.int64), np.cumsum(sizes, axis=0)]),
        "part_uv": np.concatenate([NO_PART[0], *(uv for uv, _ in parts)]),
        "part_border": np.concatenate([NO_PART[1], *(border for _, border in parts)]),
    }


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
