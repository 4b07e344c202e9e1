"""Find out once how the meshes of a scene can be thinned, and what that costs, whatever levels of detail are asked for.

reads   scene.npz, casters.npz                                             (lib.formats.scene, .casters)
writes  ladder.npz                                                         (lib.formats.mesh_ladder)

Meshes that touch are thinned together.  For each such group: the order in which its vertices go, and the measured
distance and slide of levels all the way down.
"""

import numpy as np

from lib import door
from lib.formats import casters, mesh_ladder, scene
from lib.lod.mesh_levels import MeshLevels
from lib.refusal import refusal
from lib.surfaces import tessellate
from lib.surfaces.mesh import Mesh


def arguments(parser):
    parser.add_argument("--scene", required=True, metavar="FILE", help="scene.npz")
    parser.add_argument("--casters", required=True, metavar="FILE", help="casters.npz")
    parser.add_argument("--out", required=True, metavar="FILE", help="ladder.npz")


def body(args, cost):
    x, shapes = scene.load(args.scene), casters.load(args.casters)
    meshes = [x.surfaces[s] for s in np.flatnonzero(x.front < 0) if isinstance(x.surfaces[s], Mesh)]
    if not meshes:
        raise refusal("the scene has no meshes", field="scene")
    found = MeshLevels(tessellate.into_frame(meshes, shapes.centre, shapes.scale), None).found()
    mesh_ladder.save(args.out, found)
    cost.notes.update(
        meshes=len(meshes),
        groups=len(found),
        triangles=sum(len(known.history.death) for known in found),
        levels=sum(len(known.steps) for known in found),
    )


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
