"""Form factors in plain numpy, all points and facets at once: what lib.radiosity.form_factors must give."""

import numpy as np

NEAR, FAR = 8.0, 40.0  # polygons up to, discs from, in units of a facet's longer side: 0.02 % from there on
GAUSS_SQUARE = np.array([(a, b) for a in (-1, 1) for b in (-1, 1)]) / np.sqrt(12) + 0.5  # degree 3
GAUSS_TRIANGLE = np.array([(1, 1), (4, 1), (1, 4)]) / 6  # degree 2
NO_EDGE = 1e-30  # |v_k x v_k+1| below this: the edge is a point or seen end-on


def form_factor_disc(D, n, n_facet, area):
    """F = A cos cos' / (pi r^2 + A) for facets at D = centre - x.

    D (..., 3), n and n_facet broadcastable unit normals of receiver and facet, area (...): returns (...), 0 where
    either looks away.
    """
    return area * _kernel(D, n, n_facet, area)


def _kernel(D, n, n_facet, area):
    r2 = np.einsum("...c,...c->...", D, D)
    cos_x = np.einsum("...c,...c->...", D, n)
    cos_y = -np.einsum("...c,...c->...", D, n_facet)
    facing = (cos_x > 0) & (cos_y > 0)
    return np.where(facing, cos_x * cos_y / np.maximum(r2 * (np.pi * r2 + area), NO_EDGE), 0.0)


def form_factor_polygon(vertices, n):
    """Exact F of convex polygons seen from a point with normal n; what lies below the horizon is cut away.

    vertices (m, k, 3) relative to the point, in order (either way round; repeated ones are allowed), n (m, 3).
    Returns (m,) in [0, 1].

    F = 1 / (2 pi) |sum_k theta_k n . c_k / |c_k||, c_k = v_k x v_k+1, theta_k = atan2(|c_k|, v_k . v_k+1).
    """
    height = np.einsum("mkc,mc->mk", vertices, n)
    following = np.roll(vertices, -1, axis=1)
    height_following = np.roll(height, -1, axis=1)
    # Cut every edge at the horizon; an edge that goes down leaves at `out`, one that comes up enters at `into`.
    above, above_following = height > 0, height_following > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(above != above_following, height / (height - height_following), 0.0)
    cut = vertices + t[..., None] * (following - vertices)
    start = np.where(above[..., None], vertices, cut)
    end = np.where(above_following[..., None], following, cut)
    total = np.where(above | above_following, _edge(start, end, n[:, None]), 0.0).sum(axis=1)
    out = np.where((above & ~above_following)[..., None], cut, 0.0).sum(axis=1)
    into = np.where((~above & above_following)[..., None], cut, 0.0).sum(axis=1)
    total = total + np.where(above.all(axis=1), 0.0, _edge(out, into, n))
    return np.abs(total) / (2 * np.pi)


def _edge(a, b, n):
    c = np.cross(a, b)
    length = np.sqrt(np.einsum("...c,...c->...", c, c))
    theta = np.arctan2(length, np.einsum("...c,...c->...", a, b))
    with np.errstate(divide="ignore", invalid="ignore"):
        projected = theta * np.einsum("...c,...c->...", c, n) / length
    return np.where(length > NO_EDGE, projected, 0.0)


def form_factor_gauss(x, n, facets, column):
    """F from points x, n (m, 3) to one facet each, column (m,): the bare kernel at Gauss points.  (m,)."""
    F = np.zeros(len(x))
    for points, rows in (
        (GAUSS_SQUARE, np.flatnonzero(~facets.is_triangle[column])),
        (GAUSS_TRIANGLE, np.flatnonzero(facets.is_triangle[column])),
    ):
        k = column[rows]
        D, normal = facets.origin[k] - x[rows], facets.normal[k]
        for a, b in points if len(rows) else ():
            F[rows] += _kernel(D + a * facets.e1[k] + b * facets.e2[k], n[rows], normal, 0.0) / len(points)
    return F * facets.area[column]


def form_factor_facets(x, n, facets):
    """F from points to all facets, horizon and facing respected, visibility not.

    x, n (m, 3) points and unit normals; facets: Facets with k facets.  Returns (m, k) float64.
    """
    D = facets.centre[None] - x[:, None]
    F = form_factor_disc(D, n[:, None], facets.normal[None], facets.area[None])
    ahead = np.einsum("mkc,kc->mk", D, facets.normal) < 0
    side = np.maximum((facets.e1**2).sum(axis=1), (facets.e2**2).sum(axis=1))
    r2 = np.einsum("mkc,mkc->mk", D, D)
    # What may reach below the horizon is cut there, as far off as it matters.
    height, corners = np.einsum("mkc,mc->mk", D, n), facets.corners()
    cut = height**2 < side
    reach = np.linalg.norm(corners - facets.centre[:, None], axis=2).max(axis=1, initial=0.0)
    is_polygon = ahead & (r2 < np.where(cut, FAR, NEAR) ** 2 * side) & (height > -reach)  # some of it is above
    row, column = np.nonzero(is_polygon)
    F[row, column] = form_factor_polygon(corners[column] - x[row, None], n[row])
    row, column = np.nonzero(ahead & ~is_polygon & ~cut & (r2 < FAR**2 * side) & (F > 0))
    F[row, column] = form_factor_gauss(x[row], n[row], facets, column)
    return F
