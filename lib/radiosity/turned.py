"""Surfaces that may be turned inside out: no light reaches them, and it falls on their backs."""

import numpy as np

from lib.elements.lattice import receivers
from lib.radiosity.direct import direct_light
from lib.visibility.qmc import shift, stream

LEVEL = 2  # of the lattice whose inner crossings are asked
LEAST = 0.1  # of them must be lit: more than leaks in through a crack


def lit_behind(world, surfaces, seed, shadow_rays):
    """Those of `surfaces` whose backs get direct light at LEAST of the places asked, as a list.

    shadow_rays : (first, most) of them to a lamp.  Surfaces of two lit sides are left out: they have both.
    """
    front = np.asarray(world.scene.front)
    found = []
    for s in surfaces:
        if front[s] >= 0 or (front == s).any():
            continue
        lattice, level = world.lattices[s], world.base_level(s, LEVEL)
        h, w = lattice.shape(level)
        j, i = (axis.ravel() for axis in np.mgrid[1 : h - 1, 1 : w - 1])
        is_turned = not world.scene.flip[s]
        x, N = receivers(world.surface(s), is_turned, world.casters.sag[s], lattice, level, j, i, world.domain(s))
        turns = shift(stream(seed, world.scene.names[s]), i, j)
        around = world.emitters, world.n_groups, world.tracer, world.mesh.face_surface
        lit = direct_light(x, N, turns, *around, *shadow_rays).H.any(axis=(1, 2))
        if lit.mean() > LEAST:
            found.append(s)
    return found
