"""Artefact of thin_meshes: how meshes that touch are thinned, and what that costs, in the scene's frame.

A list of lib.lod.mesh_levels.Known, whose `index` counts the meshes of the scene without the backs.
"""

import numpy as np

from lib.formats import artefact
from lib.lod.collapse import History
from lib.lod.mesh_levels import Known

KIND, VERSION = "mesh_ladder", 1
DTYPES = {
    "index": np.int64, "size": np.int64, "pair": np.int32, "at": np.float64, "death": np.int32, "steps": np.int64,
    "measured": np.float64,
}  # fmt: skip


def check(found, path="mesh_ladder"):
    """Raise ArtefactError naming path and field of what breaks the promises of Known and History."""
    for known in found:
        n, s, c, h = len(known.index), len(known.steps), len(known.history.pair), known.history
        ends = np.sort(h.pair[:, 1]) if c else h.pair[:, 1]
        rules = {
            "index": n > 0 and known.index.min() >= 0 and (np.diff(known.index) > 0).all(),
            "pair": h.pair.shape == (c, 2) and (not c or (h.pair.min() >= 0 and h.pair.max() < h.n)),
            "pair: each vertex goes once": (np.diff(ends) > 0).all() and (h.pair[:, 0] != h.pair[:, 1]).all(),
            "at": h.at.shape == (c, 3) and np.isfinite(h.at).all(),
            "death": len(h.death) > 0 and h.death.min() >= 0 and h.death.max() <= c,
            "steps": s > 0 and known.steps[0] == 0 and known.steps[-1] == c and (np.diff(known.steps) > 0).all(),
            "measured": known.measured.shape == (s, n, 4)
            and np.isfinite(known.measured).all()
            and (known.measured >= 0).all(),
        }
        for name, holds in rules.items():
            if not holds:
                raise artefact.ArtefactError(f"{path}: {name}: out of range, see lib.formats.mesh_ladder")


def save(path, found):
    """Write a list of Known; ArtefactError before anything is written if it is not sound."""
    check(found, path)
    rows = [
        {
            "index": known.index,
            "size": [[len(known.index), known.history.n, len(known.history.pair), len(known.history.death),
                      len(known.steps)]],
            "pair": known.history.pair,
            "at": known.history.at,
            "death": known.history.death,
            "steps": known.steps,
            "measured": known.measured.reshape(-1, 4),
        }
        for known in found
    ]  # fmt: skip
    arrays = {name: np.concatenate([row[name] for row in rows]).astype(dtype) for name, dtype in DTYPES.items()}
    artefact.write(path, KIND, VERSION, {}, arrays)


def load(path):
    """Read a list of Known; ArtefactError naming path and fault."""
    _, arrays = artefact.read(path, KIND, VERSION)
    try:
        found = _unpacked(arrays)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise artefact.ArtefactError(f"{path}: damaged ({error}); delete it to have it made again") from error
    check(found, path)
    return found


def _unpacked(arrays):
    for name, dtype in DTYPES.items():
        if arrays[name].dtype != dtype:
            raise ValueError(f"{name}: {arrays[name].dtype}, expected {np.dtype(dtype).name}")
    n, vertices, c, m, s = arrays["size"].T
    counts = {"index": n, "pair": c, "at": c, "death": m, "steps": s, "measured": s * n}
    parts = {}
    for name, count in counts.items():
        if count.sum() != len(arrays[name]) or count.min() < 0:
            raise ValueError(f"{name}: {len(arrays[name])} rows, expected {count.sum()}")
        parts[name] = np.split(arrays[name], np.cumsum(count)[:-1])
    return [
        Known(
            parts["index"][g],
            History(
                int(vertices[g]), parts["pair"][g].astype(np.int64), parts["at"][g], parts["death"][g].astype(np.int64)
            ),
            parts["steps"][g],
            parts["measured"][g].reshape(int(s[g]), int(n[g]), 4),
        )
        for g in range(len(n))
    ]
