"""Triangles as a file lists them, made a Mesh: positions welded, useless triangles dropped, a normal at every corner.

A file's normal counts where it lies within 90 degrees of its triangle's.  Elsewhere normals are those of the triangles
around the position, weighted by their angle there, as far as one gets across edges that are folded by less than CREASE.
"""

from dataclasses import dataclass

import numpy as np

from lib.surfaces.mesh import Flat, Mesh
from lib.surfaces.pieces import pieces
from lib.surfaces.rows import numbered

CREASE = 40.0  # degrees; what tessellated round things fold by is less, what is meant as an edge is more
FLAT = 1e-10  # height over longest edge of a triangle without an area: far above rounding in float64
MOST = 1e100  # coordinates, as everywhere; their squares are finite


@dataclass(frozen=True)
class Dropped:
    """What `mesh` left out or changed, in triangles: without an area, repeated, with a normal against its winding."""

    flat: int = 0
    repeated: int = 0
    against: int = 0

    def __add__(self, other):
        return Dropped(self.flat + other.flat, self.repeated + other.repeated, self.against + other.against)

    def sentences(self):
        """What to tell the user: a list of texts.

        >>> Dropped(flat=12).sentences()
        ['left out: 12 triangles without an area']
        """
        counts = ((self.flat, "without an area"), (self.repeated, "listed before"))
        left = [f"{n} triangle{'s' * (n > 1)} {what}" for n, what in counts if n]
        n = self.against
        turned = f"{n} triangle{'s' * (n > 1)} with a normal against the winding: the winding counts"
        return ([f"left out: {', '.join(left)}"] if left else []) + ([turned] if n else [])


def mesh(V, F, N=None, T=None, crease=CREASE):
    """Build a Mesh.

    Parameters
    ----------
    V : (n, 3) float positions;  F : (m, 3) int, counterclockwise seen from the lit side
    N : (m, 3, 3) normals at the corners, of any length; NaN or zero where the file has none; or None
    T : (m, 3, 2) texture coordinates at the corners, or None
    crease : edges folded by less than this are smooth [degrees]

    Returns
    -------
    (Mesh, Dropped): positions in the order the triangles first use them, equal ones once, unused ones left out; of
    triangles on the same three positions with the same lit side the first; none flatter than FLAT.

    Raises ValueError `FIELD: what` for positions that are not finite and indices outside V, Flat when nothing is left.
    """
    V = np.asarray(V, dtype=np.float64) + 0.0  # -0 is 0
    F = np.asarray(F, dtype=np.int64)
    if len(F) and not 0 <= F.min() <= F.max() < len(V):
        raise ValueError(f"triangles: an index is outside 0 to {len(V) - 1}")
    # A NaN fails the comparison.
    if len(F) and not (np.abs(V[F]) <= MOST).all():
        raise ValueError(f"positions: NaN, Inf or a coordinate beyond {MOST:g}")
    V, F = welded(V, F)
    keep = height_ratio(V, F) > FLAT
    n_flat = int(np.count_nonzero(~keep))
    first = _first_of_each(F)
    repeated = keep & ~first
    keep &= first
    if not keep.any():
        raise Flat("triangles: none has an area")
    F = F[keep]
    V, F = welded(V, F)
    face, _ = normals_areas(V, F)
    corner = smooth_normals(V, F, face, crease)
    n_against = 0
    if N is not None:
        given, length = _unit(np.asarray(N, dtype=np.float64)[keep])
        along = np.einsum("ijk,ik->ij", given, face)
        present = (length > 0) & np.isfinite(length)
        n_against = int(np.count_nonzero((present & (along <= 0)).any(axis=1)))
        good = present & (along > 0)
        corner = np.where(good[..., None], given, corner)
    if T is not None:
        T = np.ascontiguousarray(np.asarray(T, dtype=np.float64)[keep])
    made = Mesh(V, F.astype(np.int32), np.ascontiguousarray(corner), T)
    return made, Dropped(n_flat, int(np.count_nonzero(repeated)), n_against)


def welded(V, F):
    """Positions equal bit for bit made one: (V, F) with the positions that F uses, in the order it first uses them."""
    corner = V[F.ravel()]
    number, first = numbered(corner)
    return corner[first], number.reshape(-1, 3)


def normals_areas(V, F):
    """Unit normals (m, 3) and areas (m,) of triangles; the normal of one without an area is zero."""
    A, B, C = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    unit, length = _unit(np.cross(B - A, C - A))
    return unit, length / 2


def height_ratio(V, F):
    """(m,) the least height of triangles over their longest edge."""
    edges = np.stack([V[F[:, k - 2]] - V[F[:, k]] for k in range(3)], axis=1)
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    edges = edges / np.where(longest > 0, longest, 1.0)[:, None, None]
    return np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)


def smooth_normals(V, F, face, crease=CREASE):
    """Unit normals (m, 3, 3) at corners: of the triangles around a position, as far as edges are smooth.

    face : (m, 3) unit normals of the triangles
    """
    m = len(F)
    a, b = _smooth_neighbours(F, face, np.cos(np.radians(crease)))
    # Join the corners of two neighbours at both ends of their edge, which runs the other way in the other one.
    triangle_a, k_a, triangle_b, k_b = a // 3, a % 3, b // 3, b % 3
    here = np.concatenate([3 * triangle_a + k_a, 3 * triangle_a + (k_a + 1) % 3])
    there = np.concatenate([3 * triangle_b + (k_b + 1) % 3, 3 * triangle_b + k_b])
    group = pieces(3 * m, here, there)
    n = int(group.max(initial=-1)) + 1
    weighted = (corner_angles(V, F)[..., None] * face[:, None, :]).reshape(-1, 3)
    total = np.stack([np.bincount(group, weighted[:, k], n) for k in range(3)], axis=1)
    N = _unit(total)[0][group].reshape(m, 3, 3)
    bad = ~(np.einsum("ijk,ik->ij", N, face) > 0)  # around the tip of a spike
    return np.where(bad[..., None], face[:, None, :], N)


def corner_angles(V, F):
    """(m, 3) angles of triangles at their corners."""
    edge = _unit(np.stack([V[F[:, (k + 1) % 3]] - V[F[:, k]] for k in range(3)], axis=1))[0]
    cosine = -np.einsum("ijk,ijk->ij", edge, np.roll(edge, 1, axis=1))
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _smooth_neighbours(F, face, cosine):
    """Half edges (3 triangle + k runs from corner k to k + 1) that meet smoothly: two (p,) arrays."""
    start, end = F.ravel(), np.roll(F, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.lexsort((high, low))
    pairs = []
    for step in (1, 2, 3):  # two sheets back to back have four half edges at an edge
        a, b = order[:-step], order[step:]
        same = (low[a] == low[b]) & (high[a] == high[b]) & (start[a] == end[b])
        a, b = a[same], b[same]
        smooth = np.einsum("ij,ij->i", face[a // 3], face[b // 3]) > cosine
        pairs.append((a[smooth], b[smooth]))
    return tuple(np.concatenate(side) for side in zip(*pairs, strict=True))


def _first_of_each(F):
    """(m,) bool: no earlier triangle has the same corners in the same winding."""
    turn = np.argmin(F, axis=1)[:, None]
    F = np.take_along_axis(F, (turn + np.arange(3)) % 3, axis=1)
    order = np.lexsort(F.T)
    is_new = np.concatenate([[True], (np.diff(F[order], axis=0) != 0).any(axis=1)])[: len(F)]
    first = np.empty(len(F), dtype=bool)
    first[order] = is_new
    return first


def _unit(vectors):
    """Vectors (..., k) at unit length, zero where they are zero or not finite, and their lengths."""
    length = np.linalg.norm(vectors, axis=-1)
    usable = (length > 0) & np.isfinite(length)
    return np.where(usable[..., None], vectors, 0.0) / np.where(usable, length, 1.0)[..., None], length
