"""One row a surface: what its light cost, how large it became, how sure it is."""

import numpy as np

from lib.maps.budget import gpu_bytes
from lib.report.thumbnails import overlay_count


def rows(scene, trees, maps, textures, D_i, mean_H, reconstruction):
    """Rows of all surfaces, in their order.

    Parameters
    ----------
    scene : has names, files, role, material (lists) and is_black, E
    trees : list of {surface: Tree}, direct and indirect ones, as far as there are any
    maps : MapSet of the light at full size, or None
    textures : MapSet as exported, within the budget, or None
    D_i : {name: the paper's D_i of the map before the budget}
    mean_H : mean irradiance of the scene, largest channel [W/m^2]; errors are relative to it
    reconstruction : {surface name: "texture" or "gouraud"} of those that ask for one
    """
    place = [{int(s): k for k, s in enumerate(m.surface)} if m is not None else {} for m in (maps, textures)]
    sizes = [np.stack(m.sizes(), axis=1) if m is not None else None for m in (maps, textures)]
    listed = []
    for s, name in enumerate(scene.names):
        own = [t[s] for t in trees if s in t]
        k, e = place[0].get(s), place[1].get(s)
        error = float(np.sqrt(sum(t.error**2 for t in own))) if own else None
        hidden = maps.hidden_map(k) if k is not None else None
        listed.append(
            {
                "index": s,
                "name": name,
                "file": scene.files[s],
                "role": scene.role[s],
                "reconstruction": reconstruction.get(name, "auto"),
                "material": scene.material[s],
                "is_black": bool(scene.is_black[s]),
                "is_light": bool(np.max(scene.E[s]) > 0),
                "map": sizes[0][k].tolist() if k is not None else None,
                "texture": sizes[1][e].tolist() if e is not None else None,
                "roots": maps.roots[k].tolist() if k is not None else None,
                "depth": depth(own) if own else int(maps.level[k]) if k is not None else None,
                "leaves": overlay_count([leaves(t) for t in own], own[0].roots) if own else 0,
                "samples": int(sum(len(t.ji) for t in own)),
                "hidden": float(hidden.mean()) if hidden is not None else None,
                "error": error / mean_H if error is not None and mean_H > 0 else None,
                "D_i": D_i.get(name),
                "bytes": gpu_bytes(*sizes[1][e].tolist()) if e is not None else None,
            }
        )
    return listed


def depth(trees):
    """The deepest leaf of some trees."""
    return max((int(t.leaves[:, 0].max(initial=0)) for t in trees), default=0)


def leaves(tree):
    """(level, i, j) of a tree's leaves, stored as rows level, j, i."""
    return tree.leaves[:, 0], tree.leaves[:, 2], tree.leaves[:, 1]


def overall_error(listed, area):
    """Area-weighted RMS of the surfaces' relative errors, None where no surface has one."""
    known = [(row["error"], area[row["index"]]) for row in listed if row["error"] is not None]
    weight = sum(a for _, a in known)
    return float(np.sqrt(sum(a * e * e for e, a in known) / weight)) if weight > 0 else None
