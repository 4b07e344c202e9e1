"""Where to cut a surface: the lines of a tensor triangulation, so many and so placed that facets keep a tolerance.

A chord over a step h leaves a curve of second derivative K by K h^2 / 8, so steps proportional to K^-1/2 spread the
error evenly (equidistribution), and n = integral of sqrt(K / 8) / sqrt(tolerance) steps are needed.  K comes from
second differences of points at equal steps, never from knots or control points: the same shape gets the same lines
however it is written.  Two parts are told apart:

  normal      the part of S_uu that leaves the surface (on a side: that leaves the side's curve); it moves the geometry
  tangential  the part inside the surface (uneven speed, poles); it only lets a texture slide, and gets its own, wider
  tolerance

The diagonal of a cell adds the twist S_uv h_u h_v / 4, shared between the two directions.  Both directions take half
the tolerance, unless one is so straight that it leaves more to the other.  Directions linked by borders share one
line set (`Links`). Lines also run along kinks, where the derivative jumps.  Parameters are rounded to 2^-24, so that
rounding noise does not reach them.
"""

from dataclasses import dataclass

import numpy as np

from lib.nurbs.evaluate import evaluate_grid

CELLS = 64  # steps along the direction measured
ACROSS = np.linspace(0.0, 1.0, 17)
ALONG = np.linspace(0.0, 1.0, CELLS + 1)
KINK = 1e-3  # jump of the derivative, relative to its size, that asks for a line
MANY_KINKS = 16  # more than these are a polygon standing for a curve: they are treated as curvature
TURN = np.deg2rad(125)  # one chord may stand for this much turning: a circle has at least 3
GRAIN = 2.0**24


@dataclass(frozen=True)
class Demand:
    """What one surface asks for, in its own length unit.

    root_K : (2, 2, 64)   [direction u, v; normal, tangential; step] sqrt(largest K across / 8)
    twist : (2,)          [normal, tangential] largest |S_uv| / 4
    kinks : two float arrays, interior parameters where S_u, S_v jump
    least : (2,) int      fewest steps along u, v that keep the shape recognisable
    """

    root_K: np.ndarray
    twist: np.ndarray
    kinks: tuple
    least: np.ndarray


def demand(surface, is_closed, is_collapsed):
    """Measure a surface; is_closed (2,), is_collapsed (4,) bool as lib.nurbs.shape says."""
    kinks = (_kinks(surface, 0), _kinks(surface, 1))
    root_K, least = np.empty((2, 2, CELLS)), np.ones(2, dtype=np.int64)
    for d in (0, 1):
        S, along, across = _grid(surface, d)
        border = [not (is_collapsed[2 * (1 - d) + end] or is_closed[1 - d]) for end in (0, 1)]
        root_K[d] = _root_K(S, along, across, border, kinks[d])
        least[d] = max(_turns(S), 3 if is_closed[d] else 2 if is_collapsed[2 * d : 2 * d + 2].all() else 1)
    S, S_u, S_v = evaluate_grid(surface, ACROSS, ACROSS)
    cross = S[1:, 1:] - S[1:, :-1] - S[:-1, 1:] + S[:-1, :-1]
    S_uv = cross * (ACROSS.size - 1) ** 2
    normal = _unit(np.cross(S_u, S_v))
    normal = _unit(normal[1:, 1:] + normal[1:, :-1] + normal[:-1, 1:] + normal[:-1, :-1])
    out = np.abs(np.einsum("jic,jic->ji", S_uv, normal))
    inside = np.linalg.norm(S_uv - np.einsum("jic,jic->ji", S_uv, normal)[..., None] * normal, axis=2)
    return Demand(root_K, np.array([out.max(), inside.max()]) / 4, kinks, least)


def _grid(surface, d):
    """Points and derivatives with the measured direction first: (65, 17, 3) each, S, along d, across d."""
    if d == 0:
        S, S_u, S_v = (a.swapaxes(0, 1) for a in evaluate_grid(surface, ALONG, ACROSS))
        return S, S_u, S_v
    S, S_u, S_v = evaluate_grid(surface, ACROSS, ALONG)
    return S, S_v, S_u


def _unit(a):
    """Unit vectors, zero where the length is nothing beside the largest."""
    length = np.linalg.norm(a, axis=-1, keepdims=True)
    return np.where(length > 1e-9 * length.max(initial=0.0), a / np.maximum(length, 1e-300), 0.0)


def _root_K(S, along, across, border, kinks):
    """sqrt(K / 8) per step, normal and tangential (2, 64): second differences of S (65, 17, 3) along its first axis."""
    second = (S[:-2] - 2 * S[1:-1] + S[2:]) * CELLS**2
    normal = _unit(np.cross(along, across))[1:-1]
    out = np.abs(np.einsum("kic,kic->ki", second, normal))
    no_normal = ~normal.any(axis=2)
    out[no_normal] = np.linalg.norm(second, axis=2)[no_normal]
    inside = np.linalg.norm(second - np.einsum("kic,kic->ki", second, normal)[..., None] * normal, axis=2)
    tangent = _unit(along)[1:-1]
    for end, is_border in zip((0, -1), border, strict=True):
        if is_border:  # the outline is geometry too: what leaves the side's own tangent counts in full
            bend = second[:, end] - np.einsum("kc,kc->k", second[:, end], tangent[:, end])[:, None] * tangent[:, end]
            out[:, end] = np.linalg.norm(bend, axis=1)
    noise = 64 * np.finfo(float).eps * np.abs(S).max() * CELLS**2
    K = np.stack([out.max(axis=1), inside.max(axis=1)])
    K = np.where(K > noise, K, 0.0)
    smooth = np.ones(CELLS - 1, dtype=bool)
    for kink in kinks:
        smooth &= np.abs(ALONG[1:-1] - kink) >= 1 / CELLS
    if not smooth.all() and smooth.any():  # a difference across a kink is no curvature: take the neighbours'
        K = np.stack([np.interp(ALONG[1:-1], ALONG[1:-1][smooth], k[smooth]) for k in K])
    root = np.sqrt(K / 8)
    root = np.concatenate([root[:, :1], root, root[:, -1:]], axis=1)
    return (root[:, :-1] + root[:, 1:]) / 2


def _kinks(surface, d):
    """Interior parameters of direction d where the first derivative jumps."""
    degree, knots = (surface.degree_u, surface.knots_u) if d == 0 else (surface.degree_v, surface.knots_v)
    value, count = np.unique(knots[(knots > 0) & (knots < 1)], return_counts=True)
    value = value[count >= degree]
    value = value[(value > 1e-6) & (value < 1 - 1e-6)]
    if not value.size:
        return value
    both = np.sort(np.concatenate([value - 1e-9, value]))
    D = evaluate_grid(surface, both, ACROSS)[1].swapaxes(0, 1) if d == 0 else evaluate_grid(surface, ACROSS, both)[2]
    before, after = D[0::2], D[1::2]
    jump = np.linalg.norm(after - before, axis=2)
    size = np.maximum(np.linalg.norm(before, axis=2), np.linalg.norm(after, axis=2))
    value = value[(jump > KINK * np.maximum(size, 1e-6 * size.max())).any(axis=1)]
    return value if value.size <= MANY_KINKS else value[:0]


def _turns(S):
    """Fewest steps by the turning of the curves S (65, 17, 3) along the first axis: 1 to 3."""
    chord = np.diff(S, axis=0)
    length = np.linalg.norm(chord, axis=2)
    rows = length.sum(axis=0) > 1e-6 * length.sum(axis=0).max(initial=0.0)
    t = _unit(chord[:, rows])
    cosine = np.clip(np.einsum("kic,kic->ki", t[1:], t[:-1]), -1, 1)
    angle = np.where(t[1:].any(axis=2) & t[:-1].any(axis=2), np.arccos(cosine), 0.0)
    return int(np.clip(np.ceil(angle.sum(axis=0).max(initial=0.0) / TURN - 1e-6), 1, 3))


@dataclass(frozen=True)
class Links:
    """Which (surface, direction) pairs share a line set; node 2 s + d.

    group : (2 n,) int      number of the set
    is_reversed : (2 n,)    the node runs against its set's direction
    is_mirrored : (groups,) a set linked to itself backwards: it must be its own mirror image
    """

    group: np.ndarray
    is_reversed: np.ndarray
    is_mirrored: np.ndarray


def links(n, borders):
    """Union-find with orientation over the borders (m, 5) of n surfaces: a side runs along the other direction."""
    parent, turned, mirrored = list(range(2 * n)), [0] * (2 * n), set()

    def root(node):
        path, turn = [], 0
        while parent[node] != node:
            path.append(node)
            node = parent[node]
        for child in reversed(path):
            turn ^= turned[child]
            parent[child], turned[child] = node, turn
        return node

    for a, side_a, b, side_b, is_reversed in borders.tolist():
        x, y = 2 * a + 1 - side_a // 2, 2 * b + 1 - side_b // 2
        root_x, root_y = root(x), root(y)
        turn_x, turn_y = (turned[x] if x != root_x else 0), (turned[y] if y != root_y else 0)
        if root_x == root_y:
            if turn_x ^ turn_y ^ is_reversed:
                mirrored.add(root_x)
            continue
        low, high = min(root_x, root_y), max(root_x, root_y)
        parent[high], turned[high] = low, turn_x ^ turn_y ^ is_reversed
        if high in mirrored:
            mirrored.add(low)
    roots = np.array([root(node) for node in range(2 * n)], dtype=np.int64)
    is_reversed = np.array([turned[i] if roots[i] != i else 0 for i in range(2 * n)], dtype=bool)
    numbers, group = np.unique(roots, return_inverse=True)
    return Links(group, is_reversed, np.isin(numbers, sorted(mirrored)))


@dataclass(frozen=True)
class Plan:
    """The demands of all surfaces, gathered by line set and by the segments between kinks; made by `plan`.

    bounds : per set, ascending parameters from 0 to 1: the ends and kinks
    first : (groups,) int          number of the set's first segment, of `segments` in all
    node, segment : (r,) int       a row: one (surface, direction) in one segment of its set
    square : (r, 2), width (r,)    square of the integral of sqrt(K / 8), normal and tangential; the segment's length
    """

    demands: list
    links: Links
    bounds: list
    first: np.ndarray
    node: np.ndarray
    segment: np.ndarray
    square: np.ndarray
    width: np.ndarray


def plan(demands, link):
    """Gather the demands of n surfaces by the sets of `link`."""
    nodes = np.argsort(link.group, kind="stable")
    starts = np.searchsorted(link.group[nodes], np.arange(len(link.is_mirrored) + 1))
    bounds, first, node, segment, square, width, total = [], [], [], [], [], [], 0
    for g, is_mirrored in enumerate(link.is_mirrored):
        members = nodes[starts[g] : starts[g + 1]]
        edge = _bounds(demands, link, members, is_mirrored)
        bounds.append(edge)
        first.append(total)
        for m in members:
            summed = _cumulative(_oriented(demands, link, m))
            part = np.diff(np.stack([np.interp(edge, ALONG, row) for row in summed]), axis=1)
            node += [m] * (edge.size - 1)
            segment += range(total, total + edge.size - 1)
            square.append(part.T**2)
            width.append(np.diff(edge))
        total += edge.size - 1
    return Plan(
        demands,
        link,
        bounds,
        np.array(first, dtype=np.int64),
        np.array(node, dtype=np.int64),
        np.array(segment, dtype=np.int64),
        np.concatenate(square),
        np.concatenate(width),
    )


def _bounds(demands, link, members, is_mirrored):
    kinks = [np.array([0.0, 1.0])]
    for m in members:
        own = demands[m // 2].kinks[m % 2]
        kinks.append(1 - own if link.is_reversed[m] else own)
        kinks.append(1 - own if is_mirrored else own[:0])
    edge = np.unique(np.concatenate(kinks))
    return edge[np.concatenate([[True], np.diff(edge) > 1e-9])]


def _oriented(demands, link, node):
    root_K = demands[node // 2].root_K[node % 2]
    return root_K[:, ::-1] if link.is_reversed[node] else root_K


def _cumulative(density):
    """Integral from 0 at the 65 grid parameters, of a density (..., 64) constant over each step."""
    return np.concatenate([np.zeros((*density.shape[:-1], 1)), np.cumsum(density, axis=-1) / CELLS], axis=-1)


def _shares(p, tolerance):
    """What each row and node needs: square with the twist's part (r, 2), the node's share of the tolerance (2 n, 2)."""
    n = len(p.demands)
    whole = np.zeros((2 * n, 2))
    np.add.at(whole, p.node, np.sqrt(p.square))
    whole = whole.reshape(n, 2, 2) ** 2  # surface, direction, part
    twist = np.array([d.twist for d in p.demands])
    ratio = np.sqrt((whole[:, 0] + twist + 1e-300) / (whole[:, 1] + twist + 1e-300))
    added = np.stack([twist * ratio / 2, twist / ratio / 2], axis=1).reshape(2 * n, 2)
    square = p.square + added[p.node] * p.width[:, None] ** 2
    largest = np.zeros((2 * n, 2))
    np.maximum.at(largest, p.node, square)
    other = largest.reshape(n, 2, 2)[:, ::-1].reshape(2 * n, 2)
    share = 1 - np.minimum(other / tolerance.repeat(2, axis=0), 0.5)
    return square, added, share


def steps(p, tolerance):
    """Steps of every segment (segments,) int for the tolerance (n, 2) [normal, tangential] of each surface."""
    square, _, share = _shares(p, tolerance)
    need = np.sqrt(square / (share * tolerance.repeat(2, axis=0))[p.node]).max(axis=1)
    count = np.ones(p.segment[-1] + 1, dtype=np.int64)
    np.maximum.at(count, p.segment, np.maximum(np.ceil(np.minimum(need, 2.0**30) - 1e-6), 1).astype(np.int64))
    least = np.zeros(len(p.first), dtype=np.int64)
    np.maximum.at(least, p.links.group, np.array([d.least for d in p.demands]).ravel())
    widest = np.array([f + int(np.argmax(np.diff(b))) for f, b in zip(p.first, p.bounds, strict=True)])
    count[widest] += np.maximum(least - np.add.reduceat(count, p.first), 0)
    return count


def per_surface(p, count):
    """Steps along u and v of every surface (n, 2)."""
    return np.add.reduceat(count, p.first)[p.links.group].reshape(-1, 2)


def place(p, tolerance, count):
    """The parameters of the lines: for each surface (u, v), ascending from 0 to 1, as `count` (segments,) says."""
    _, added, share = _shares(p, tolerance)
    scale = np.sqrt(share * tolerance.repeat(2, axis=0))
    sets = []
    nodes = np.argsort(p.links.group, kind="stable")
    starts = np.searchsorted(p.links.group[nodes], np.arange(len(p.bounds) + 1))
    for g, edge in enumerate(p.bounds):
        own = count[p.first[g] : p.first[g] + edge.size - 1]
        density = np.zeros(CELLS)
        if own.max() > 1:
            for m in nodes[starts[g] : starts[g + 1]]:
                root = np.sqrt(_oriented(p.demands, p.links, m) ** 2 + added[m][:, None]) / scale[m][:, None]
                density = np.maximum(density, root.max(axis=0))
        sets.append(_place(density, edge, own, p.links.is_mirrored[g]))
    out = []
    for s in range(len(p.demands)):
        own = [sets[p.links.group[m]] for m in (2 * s, 2 * s + 1)]
        out.append(tuple(1 - t[::-1] if p.links.is_reversed[2 * s + d] else t for d, t in enumerate(own)))
    return out


def _place(density, edge, count, is_mirrored):
    """Lines of one set: `count` (k,) steps of equal integral of `density` (64,) between the `edge` parameters."""
    density = density + max(0.05 * density.max(), 1e-30)  # never a step without end where the surface is straight
    if is_mirrored:
        density = (density + density[::-1]) / 2
    summed = _cumulative(density)
    at = np.interp(edge, ALONG, summed)
    inner = [
        np.interp(a + (b - a) * np.arange(1, n) / n, summed, ALONG)
        for a, b, n in zip(at[:-1], at[1:], count, strict=True)
    ]
    lines = np.concatenate(
        [np.concatenate([[start], np.rint(t * GRAIN) / GRAIN]) for start, t in zip(edge, inner, strict=False)]
    )
    lines = np.unique(np.append(lines, 1.0))
    return (lines + (1 - lines[::-1])) / 2 if is_mirrored else lines
