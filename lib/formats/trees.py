"""What `refine` measures for a chunk of surfaces: one quadtree each, for direct or for indirect light."""

from dataclasses import dataclass

import numpy as np

from lib.formats import artefact

KIND, VERSION = "trees", 1


@dataclass(frozen=True)
class Tree:
    """One surface's samples.  roots (n_u, n_v), level of the lattice that ji (n, 2) int32 [j, i] counts on; value (n,
    G, 3) float32 [W/m^2]; hidden (n,) bool; noise (n,) float32; leaves (m, 3) int32 (level, j, i); error: estimated
    RMS error [W/m^2]."""

    roots: tuple
    level: int
    ji: np.ndarray
    value: np.ndarray
    hidden: np.ndarray
    noise: np.ndarray
    leaves: np.ndarray
    error: float

    def dense(self):
        """value (h, w, G, 3), known, hidden (h, w) on the whole lattice; 0 where nothing was measured."""
        h, w = self.roots[1] * 2**self.level + 1, self.roots[0] * 2**self.level + 1
        value = np.zeros((h, w, *self.value.shape[1:]), dtype=np.float32)
        known, hidden = np.zeros((h, w), dtype=bool), np.zeros((h, w), dtype=bool)
        at = self.ji[:, 0], self.ji[:, 1]
        value[at], known[at], hidden[at] = self.value, True, self.hidden
        return value, known, hidden


def save(path, half, trees, facts):
    """Write {surface: Tree} of a chunk; half is "direct" or "indirect", facts a dict of numbers."""
    order = sorted(trees)
    for s in order:
        if not np.isfinite(trees[s].value).all():
            raise ValueError(f"trees: value of surface {s}: NaN or Inf")
    groups = trees[order[0]].value.shape[1] if order else 1
    empty = {
        "ji": np.zeros((0, 2), np.int32),
        "value": np.zeros((0, groups, 3), np.float32),
        "hidden": np.zeros(0, bool),
        "noise": np.zeros(0, np.float32),
        "leaves": np.zeros((0, 3), np.int32),
    }
    arrays = {name: np.concatenate([none, *(getattr(trees[s], name) for s in order)]) for name, none in empty.items()}
    arrays |= {
        "surface": np.array(order, dtype=np.int32),
        "roots": np.array([trees[s].roots for s in order], dtype=np.int32).reshape(-1, 2),
        "level": np.array([trees[s].level for s in order], dtype=np.int32),
        "error": np.array([trees[s].error for s in order], dtype=np.float64),
        "first_sample": np.cumsum([0, *(len(trees[s].ji) for s in order)]),
        "first_leaf": np.cumsum([0, *(len(trees[s].leaves) for s in order)]),
    }
    artefact.write(path, KIND, VERSION, {"half": half, "facts": facts}, arrays)


def load(path, half):
    """Read a chunk: ({surface: Tree}, facts).  ArtefactError when it is damaged or of the other half."""
    header, arrays = artefact.read(path, KIND, VERSION)
    try:
        found, facts, trees = header["half"], header["facts"], _unpacked(arrays)
    except (KeyError, IndexError, TypeError) as error:
        raise artefact.ArtefactError(f"{path}: damaged ({error}); delete it to have it made again") from None
    if found != half:
        raise artefact.ArtefactError(f"{path}: holds {found} trees, expected {half}")
    return trees, facts


def _unpacked(a):
    trees = {}
    for k, s in enumerate(a["surface"]):
        samples = slice(a["first_sample"][k], a["first_sample"][k + 1])
        leaves = slice(a["first_leaf"][k], a["first_leaf"][k + 1])
        trees[int(s)] = Tree(
            tuple(int(r) for r in a["roots"][k]),
            int(a["level"][k]),
            a["ji"][samples],
            a["value"][samples],
            a["hidden"][samples],
            a["noise"][samples],
            a["leaves"][leaves],
            float(a["error"][k]),
        )
    return trees
