"""Compiled products of the sparse form factor matrix."""

from lib.compiled import compiled


@compiled("f8[:], i8[:], i8[:], f8[:,:], f8[:,:]")
def add_products(F, to, source, values, out):
    """out[to[k], :] += F[k] values[source[k], :] for each entry k in turn: F, to, source (m,), values, out (n, C)."""
    for k in range(len(F)):
        for c in range(values.shape[1]):
            out[to[k], c] += F[k] * values[source[k], c]
    return 0
