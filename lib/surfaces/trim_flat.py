"""Triangles without an area: those of a pole are left out, those between border points on a line are turned away.

Three border points on one line make a triangle of no area, or of rounding's.  Leaving it out would leave its long edge
facing two short ones; instead the diagonal it has in common with its neighbour is flipped.
"""

import numpy as np

from lib.nurbs.facet_kernels import NO_AREA, ONE_PLACE
from lib.nurbs.facets import has_area, kinds

MOST_FLIPS = 1000


def without_flat(S, F, edges):
    """The triangles F (m, 3) of points S (k, 3), flat ones flipped or left out; edges (e, 2) are never flipped."""
    kind = kinds(S, F)
    F = F[kind != ONE_PLACE]
    flat = np.flatnonzero(kind[kind != ONE_PLACE] == NO_AREA)
    if not flat.size:
        return F
    owner = {(int(t[k]), int(t[(k + 1) % 3])): i for i, t in enumerate(F) for k in range(3)}
    fixed = {(int(min(e)), int(max(e))) for e in edges}
    todo, flips = list(flat), 0
    while todo and flips < MOST_FLIPS:
        i = todo.pop()
        if has_area(S, F[i : i + 1])[0]:
            continue
        k = int(np.argmax([((S[F[i, (m + 1) % 3]] - S[F[i, m]]) ** 2).sum() for m in range(3)]))
        a, c, b = (int(F[i, (k + m) % 3]) for m in range(3))  # the longest edge runs from a to c, b lies on it
        other = owner.get((c, a))
        if other is None or (min(a, c), max(a, c)) in fixed:
            continue
        d = int(F[other].sum()) - a - c
        F[i], F[other] = (b, d, c), (b, a, d)
        for t in (i, other):
            for m in range(3):
                owner[int(F[t, m]), int(F[t, (m + 1) % 3])] = t
        del owner[a, c], owner[c, a]
        flips += 1
        todo += [i, other]
    A, B, C = (S[F[:, k]] for k in range(3))
    return F[np.linalg.norm(np.cross(B - A, C - A), axis=1) > 0]
