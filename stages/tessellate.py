"""Make the mesh that casts shadows, close enough to the exact surfaces for rays, and find out what each surface is as
a shape.

reads   scene.npz                                                           (lib.formats.scene)
        settings: {"sag": largest distance from the exact surface, share of the scene's largest side (default 0.001)}
writes  casters.npz                                                         (lib.formats.casters)

A surface is also kept within 2/1000 of its own size, so that small objects stay round. No level of detail touches
this mesh.
"""

import numpy as np

from lib import door
from lib.formats import casters, scene
from lib.refusal import refusal
from lib.surfaces import tessellate
from lib.surfaces.closed import in_closed_shell

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
    made = make(x.surfaces, x.flip, x.role, sag)
    casters.save(args.out, made)
    cost.notes.update(
        triangles=len(made.F),
        surfaces=len(x.surfaces),
        borders=len(made.borders),
        shells=int(made.shell.max(initial=-1)) + 1,
        sag=float(made.sag.max(initial=0.0)),
    )


def make(surfaces, flip, role, sag):
    """The Casters of surfaces (n,), turned where flip (n,), with their role (n,), to `sag` of the frame."""
    blocks = np.array([r != "receive_only" for r in role], dtype=bool)
    centre, scale = tessellate.frame(surfaces)
    surfaces = tessellate.into_frame(surfaces, centre, scale)
    known = tessellate.shapes(surfaces, blocks)
    size = known.extent.max(axis=1)
    pieces = tessellate.Pieces(surfaces, known)
    patches = pieces.cut_within(np.minimum(sag, OWN_SAG * size), tessellate.SLIDE * size)
    mesh = tessellate.assemble(patches, surfaces, known)
    F, face_surface = mesh.F.copy(), np.repeat(np.arange(len(surfaces), dtype=np.int32), np.diff(mesh.face_start))
    F[np.asarray(flip, dtype=bool)[face_surface]] = F[np.asarray(flip, dtype=bool)[face_surface]][:, ::-1]
    keep = blocks[face_surface]
    return casters.Casters(
        centre=centre,
        scale=scale,
        V=mesh.V,
        UV=mesh.UV,
        F=F[keep],
        face_surface=face_surface[keep],
        face_shell=(known.shell >= 0)[face_surface[keep]] | in_closed_shell(mesh.V, F[keep]),
        area=known.area,
        extent=known.extent,
        sag=np.where(known.is_planar, 0.0, mesh.distance),
        is_planar=known.is_planar,
        is_closed=known.is_closed,
        is_collapsed=known.is_collapsed,
        shell=known.shell,
        borders=known.borders,
    )


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
