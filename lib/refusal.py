"""The one exception for input that the user has to change: a plain sentence, never a traceback."""

from math import isfinite


class Refusal(Exception):
    """Bad input.  `str()` is the whole message: `FILE: surface NAME: FIELD: what is wrong and what is allowed`."""


def demand_finite(light):
    """Raise Refusal that names the surfaces of {name: array} whose light is NaN or Inf: it must reach no map."""
    names = [name for name, values in light.items() if not isfinite(values.sum(dtype="f8"))]
    if names:
        more = f" and {len(names) - 1} more" if names[1:] else ""
        raise refusal("NaN or Inf in its light; nothing is written", surface=f"{names[0]}{more}")


def refusal(what, file=None, surface=None, field=None):
    """Return a Refusal whose message names file, surface and field, each as the user wrote it.

    >>> str(refusal("-1, expected > 0", file="scene.yaml", surface="lamp", field="power"))
    'scene.yaml: surface lamp: power: -1, expected > 0'
    """
    parts = [str(file)] if file is not None else []
    parts += [f"surface {surface}"] if surface is not None else []
    parts += [str(field)] if field is not None else []
    return Refusal(": ".join([*parts, what]))
