"""How well the light of two maps agrees along a border their surfaces share.

Conventions: maps [j, i] = [v row, u column]; sides 0 u=0, 1 u=1, 2 v=0, 3 v=1; a side runs with the free parameter, and
`reversed` says that the neighbour's runs the other way.
"""

import numpy as np

from lib.maps.mapset import pack
from lib.nurbs.evaluate import normal

MOST = 20  # rows listed
SMOOTH = np.cos(np.radians(10))  # neighbours whose normals differ less share light; over a sharper edge it may jump
PROBES = 9  # points of a border at which normals are compared


def line(value, hidden, side):
    """The samples of one side in the order of its free parameter: (n, ...) values and (n,) hidden."""
    part = {0: np.s_[:, 0], 1: np.s_[:, -1], 2: np.s_[0], 3: np.s_[-1]}[int(side)]
    return value[part], hidden[part]


def step(first, second, is_reversed):
    """The largest and the root mean square difference between two lines (values (n, 3), hidden (n,)) over one border.

    Both are read at the crossings of the finer; a place one of whose samples is hidden is left out.
    Returns two numbers >= 0, nan where nothing can be compared.
    """
    (a, a_hidden), (b, b_hidden) = first, second
    if is_reversed:
        b, b_hidden = b[::-1], b_hidden[::-1]
    n = max(len(a), len(b))
    (a, a_bad), (b, b_bad) = _read(a, a_hidden, n), _read(b, b_hidden, n)
    seen = ~(a_bad | b_bad)
    if not seen.any():
        return float("nan"), float("nan")
    difference = np.abs(a - b)[seen].max(axis=1)
    return float(difference.max()), float(np.sqrt((difference**2).mean()))


def is_smooth(first, second):
    """Do unit normals (n, 3) at the same places of a border agree within 10 degrees everywhere?"""
    return bool((np.einsum("nx,nx->n", first, second) > SMOOTH).all())


def border_uv(side, n=PROBES):
    """Parameters u, v (n,) of places along a side, its ends left out."""
    t = (np.arange(n) + 0.5) / n
    fixed = np.full(n, float(side in (1, 3)))
    return (fixed, t) if side in (0, 1) else (t, fixed)


def exported_irradiance(maps, rho_avg, textured):
    """MapSet of H (N, 1, 3) = B / rho_avg of the exported maps (N, 3), without those that carry a base texture.

    What a surface does not reflect at all (rho_avg = 0 in a channel) counts as no light.
    """
    kept = np.flatnonzero(~textured)
    inverse = np.where(rho_avg > 0, 1 / np.where(rho_avg > 0, rho_avg, 1), 0)
    H = [(maps.map(k) * inverse[k])[:, :, None] for k in kept]
    hidden = [maps.hidden_map(k) for k in kept]
    return pack(maps.surface[kept], maps.roots[kept], maps.level[kept], H, hidden, channels=(1, 3))


def rows(scene, casters, maps, mean_H, normals=None):
    """Steps of irradiance along borders that are smooth in space, the worst first: dicts a, b, worst, rms, relative.

    relative : worst over the brightest light on the border, or over the scene's mean mean_H where that is more
    maps : MapSet of H (N, G, 3), or None; borders between surfaces without maps are left out
    normals : {(surface, side): (PROBES, 3)} of sides asked for before, added to
    """
    normals = {} if normals is None else normals
    if maps is None:
        return []
    sides, steps = {}, []
    for a, side_a, b, side_b, is_reversed in casters.borders.tolist():
        if casters.is_collapsed[a, side_a] or casters.is_collapsed[b, side_b]:
            continue
        pair = [_side(sides, maps, s, side) for s, side in ((a, side_a), (b, side_b))]
        if None not in pair:
            worst, rms = step(*pair, is_reversed)
            if np.isfinite(worst):
                light = max(mean_H, *(float(value[~hidden].max(initial=0.0)) for value, hidden in pair))
                steps.append((-worst, rms, light, a, side_a, b, side_b, bool(is_reversed)))
    # Ask from the worst down which borders are smooth: normals cost more than steps, and few are listed.
    listed = []
    for negative, rms, light, a, side_a, b, side_b, is_reversed in sorted(steps):
        for s, side in ((a, side_a), (b, side_b)):
            if (s, side) not in normals:
                normals[s, side] = normal(scene.surfaces[s], *border_uv(side)) * (-1 if scene.flip[s] else 1)
        if is_smooth(normals[a, side_a], normals[b, side_b][:: -1 if is_reversed else 1]):
            row = {"a": scene.names[a], "b": scene.names[b], "worst": -negative, "rms": rms}
            listed.append({**row, "relative": -negative / light if light > 0 else None})
        if len(listed) == MOST:
            break
    return listed


def _side(known, maps, s, side):
    """One side of the map of surface s, light groups summed; None where it has no map."""
    if (s, side) not in known:
        k = maps.position(s)
        value, hidden = line(maps.map(k), maps.hidden_map(k), side) if k >= 0 else (None, None)
        known[s, side] = (value.sum(axis=1), hidden) if k >= 0 else None
    return known[s, side]


def _read(value, hidden, n):
    """A line read linearly at n even places, and where a hidden sample took part."""
    value = np.asarray(value, float)
    at = np.linspace(0, len(value) - 1, n)
    low = np.minimum(at.astype(int), len(value) - 2)
    part = (at - low)[:, None]
    bad = (hidden[low] & (part[:, 0] < 1)) | (hidden[low + 1] & (part[:, 0] > 0))
    return (1 - part) * value[low] + part * value[low + 1], bad
