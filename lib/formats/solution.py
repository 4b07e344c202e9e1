"""What `shoot` finds: the irradiance of all elements, and the account of the power."""

from dataclasses import dataclass

import numpy as np

from lib.formats import artefact

KIND, VERSION = "solution", 2


@dataclass(frozen=True)
class Solution:
    """H_indirect (n, G, 3) float32 bounced irradiance of the elements >= 0 [W/m^2]; is_alone (n,) bool, nothing
    is interpolated across the element; is_hidden (n, 16) bool, its points
    spread (n,) float32 standard deviation over directions of the reflected light that each element sees [W/m^2]
    H_element (n,) float32 irradiance of the elements, all groups, largest channel
    n_u, n_v (surfaces,) int64 element grid of each surface; rho (surfaces, 3) float64
    mean_H (3,) area-weighted mean irradiance of the scene's elements, all groups
    H_surface (surfaces, 3) each surface's own, 0 without elements
    history (rounds, 2) shots and unshot share; ledger {name: (G, 3) list} powers [W]; facts {name: number}."""

    H_indirect: np.ndarray
    is_alone: np.ndarray
    is_hidden: np.ndarray
    spread: np.ndarray
    H_element: np.ndarray
    n_u: np.ndarray
    n_v: np.ndarray
    rho: np.ndarray
    mean_H: np.ndarray
    H_surface: np.ndarray
    history: np.ndarray
    ledger: dict
    facts: dict

    @property
    def first(self):
        """Offsets of the surfaces' elements, (surfaces + 1,)."""
        return np.concatenate([[0], np.cumsum(self.n_u * self.n_v)])


ARRAYS = [name for name in Solution.__dataclass_fields__ if name not in ("ledger", "facts")]


def check(x):
    """Raise ValueError naming the field that breaks the contract."""
    for name in ("H_indirect", "spread", "rho", "mean_H", "H_surface"):
        values = getattr(x, name)
        if not np.isfinite(values).all() or (values < 0).any():
            raise ValueError(f"solution: {name}: NaN, Inf or negative")
    if len(x.H_indirect) != x.first[-1]:
        raise ValueError("solution: H_indirect: its length is not the number of elements")


def save(path, x):
    """Write the solution."""
    check(x)
    arrays = {name: np.asarray(getattr(x, name)) for name in ARRAYS}
    artefact.write(path, KIND, VERSION, {"ledger": x.ledger, "facts": x.facts}, arrays)


def load(path):
    """Read the solution; ArtefactError when it is damaged."""
    header, arrays = artefact.read(path, KIND, VERSION)
    try:
        x = Solution(ledger=header["ledger"], facts=header["facts"], **arrays)
        check(x)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise artefact.ArtefactError(f"{path}: damaged ({error}); delete it to have it made again") from None
    return x
