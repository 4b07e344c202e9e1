"""Which of a scene's open sheets get light on both sides, and which on the other side than their file says."""

import numpy as np

from lib import forks
from lib.formats.scene_table import REFLECTANCE
from lib.surfaces.closed import in_closed_shell
from lib.surfaces.coarse import coarse
from lib.surfaces.joined import joined
from lib.surfaces.mesh import Mesh
from lib.visibility.both_sides import is_lit, is_two_sided, side_light

CLOSED = 0.9  # share of a surface's triangles in closed shells from which it is no open sheet


def lit_sides(placed, table, asked):
    """Of the surfaces `asked` (indices into placed, a list of Placed): those that have light on both sides, and those
    whose file turns them away from it.

    table : rows of scene_table
    """
    parts = forks.mapped(lambda one: coarse(one.surface)[:2], placed)
    start = np.cumsum([0, *(len(V) for V, _ in parts)])
    V = np.concatenate([V for V, _ in parts])
    F = np.concatenate(
        [(F if not one.flip else F[:, ::-1]) + s for (_, F), one, s in zip(parts, placed, start, strict=False)]
    )
    surface = np.repeat(np.arange(len(placed)), [len(F) for _, F in parts])
    turned = np.array([table[one.name]["turn"] for one in placed], dtype=bool)
    F[turned[surface]] = F[turned[surface]][:, ::-1]
    is_mesh = np.array([isinstance(one.surface, Mesh) for one in placed])
    shut = np.bincount(surface, in_closed_shell(V, F), len(placed)) / np.maximum(
        np.bincount(surface, None, len(placed)), 1
    )
    asked = [k for k in asked if not (is_mesh[k] and shut[k] >= CLOSED)]
    if not asked:
        return [], []
    low, high = V.min(axis=0), V.max(axis=0)
    V = (V - (low + high) / 2) / max(float((high - low).max()), 1e-300)
    E = np.array([table[one.name]["E"] for one in placed], dtype=np.float64)
    rho = np.where([table[one.name]["is_black"] for one in placed], 0.0, REFLECTANCE)
    light = side_light(V, F, surface, E, rho, np.array(asked))
    return _sides(placed, asked, turned, light)


def _sides(placed, asked, turned, light):
    """What lit_sides returns, of the light (n, 2) on both sides of the surfaces `asked`.

    Sheets that hang together are turned together, to where most of their light is: else some would be seen from one
    side and some from the other.  Those that have theirs on the other side then get both.
    """
    flip = np.array([placed[k].flip for k in asked]) ^ turned[asked]
    body, side = joined([placed[k].surface for k in asked], flip)
    power = np.array([placed[k].area for k in asked]) * (light[asked, 0] - light[asked, 1]) * side
    wanted = np.where(np.bincount(body, power)[body] >= 0, side, -side)  # 1: as it is
    both = is_two_sided(light)[asked] | is_lit(light)[asked][np.arange(len(asked)), np.where(wanted > 0, 1, 0)]
    asked = np.array(asked)
    return asked[both].tolist(), asked[(wanted < 0) & ~both].tolist()
