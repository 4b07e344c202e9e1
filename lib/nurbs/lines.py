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

from dataclasses import dataclass, replace

import numpy as np

from lib.nurbs.evaluate import evaluate_grid
from lib.nurbs.line_kernels import curvatures, turning

CELLS = 64  # steps along the direction measured
LEAST_CELLS = 8  # steps between two kinks, however near
FINER = 8  # steps put where the first were too coarse
MOST_CELLS = 4096
ACROSS = np.linspace(0.0, 1.0, 17)
KINK = 1e-3  # jump of the derivative, relative to its size, that asks for a line
MANY_KINKS = 16  # more than these are a polygon standing for a curve: they are treated as curvature
TURN = np.deg2rad(125)  # one chord may stand for this much turning: a circle has at least 3
GRAIN = 2.0**24


@dataclass(frozen=True)
class Demand:
    """What one surface asks for, in its own length unit; the pairs are for the directions u and v.

    at : pair of (m + 1,) ascending from 0 to 1, the steps K was measured on; kinks are among them
    root_K : pair of (2, m)   [normal, tangential; step] sqrt(largest K across / 8)
    twist : (2,)              [normal, tangential] largest |S_uv| / 4
    kinks : pair of arrays, interior parameters where S_u, S_v jump: lines run there
    least : (2,) int          fewest steps that keep the shape recognisable
    forced : pair of arrays, interior parameters of more lines that must be there
    """

    at: tuple
    root_K: tuple
    twist: np.ndarray
    kinks: tuple
    least: np.ndarray
    forced: tuple = (np.empty(0), np.empty(0))


def demand(surface, is_closed, is_collapsed):
    """Measure a surface; is_closed (2,), is_collapsed (4,) bool as lib.nurbs.shape says."""
    if _is_parallelogram(surface):
        return Demand(
            (np.array([0.0, 1.0]),) * 2, (np.zeros((2, 1)),) * 2, np.zeros(2), (np.empty(0),) * 2, np.ones(2, int)
        )
    kinks = (_kinks(surface, 0), _kinks(surface, 1))
    at = tuple(_along(k) for k in kinks)
    found = [_measured(surface, d, at[d], kinks[d], is_closed, is_collapsed) for d in (0, 1)]
    return Demand(at, tuple(f[0] for f in found), _twist(surface), kinks, np.array([f[1] for f in found]))


def _is_parallelogram(surface):
    """True for the plainest surface of all, which needs no measuring and is most of what rooms are made of."""
    if surface.Pw.shape != (2, 2, 4) or np.ptp(surface.w) > 0:
        return False
    P = surface.P
    return bool(np.abs(P[0, 0] - P[1, 0] - P[0, 1] + P[1, 1]).max() <= 1e-14 * np.abs(P).max())


def refined(surface, demand, d, lines, failing, is_closed, is_collapsed):
    """The Demand with direction d measured again, finer between those `lines` (k + 1,) where `failing` (k,)."""
    t = np.arange(FINER) / FINER
    finer = (lines[:-1, None] + np.diff(lines)[:, None] * t)[failing].ravel()
    at = np.union1d(demand.at[d], finer)
    at = at[np.concatenate([[True], np.diff(at) > 1e-9])]
    if at.size > MOST_CELLS:
        return demand
    root_K, _ = _measured(surface, d, at, demand.kinks[d], is_closed, is_collapsed)
    both = [(at, root_K) if k == d else (demand.at[k], demand.root_K[k]) for k in (0, 1)]
    return replace(demand, at=tuple(b[0] for b in both), root_K=tuple(b[1] for b in both))


def with_lines(demand, d, lines):
    """The Demand with more lines (k,) along direction d."""
    forced = tuple(np.union1d(own, lines) if k == d else own for k, own in enumerate(demand.forced))
    return replace(demand, forced=forced)


def _measured(surface, d, at, kinks, is_closed, is_collapsed):
    """(root_K, least) of direction d on the steps `at`."""
    S, along, across = _grid(surface, d, at)
    border = [not (is_collapsed[2 * (1 - d) + end] or is_closed[1 - d]) for end in (0, 1)]
    root_K = _root_K(S, along, across, border, at, np.isin(at, kinks))
    return root_K, max(_turns(S), 3 if is_closed[d] else 2 if is_collapsed[2 * d : 2 * d + 2].all() else 1)


def _along(kinks):
    """Parameters to measure at: equal steps between kinks."""
    edge = np.concatenate([[0.0], kinks, [1.0]])
    count = np.maximum(np.rint(np.diff(edge) * CELLS), LEAST_CELLS).astype(int)
    parts = [a + (b - a) * np.arange(n) / n for a, b, n in zip(edge[:-1], edge[1:], count, strict=True)]
    return np.concatenate([*parts, [1.0]])


def _grid(surface, d, along):
    """Points and derivatives with the measured direction first: (m + 1, 17, 3) each, S, along d, across d."""
    if d == 0:
        S, S_u, S_v = (np.ascontiguousarray(a.swapaxes(0, 1)) for a in evaluate_grid(surface, along, ACROSS))
        return S, S_u, S_v
    S, S_u, S_v = evaluate_grid(surface, ACROSS, along)
    return S, S_v, S_u


def _twist(surface):
    """Largest |S_uv| / 4, normal and tangential (2,), from mixed differences."""
    S, S_u, S_v = evaluate_grid(surface, ACROSS, ACROSS)
    S_uv = (S[1:, 1:] - S[1:, :-1] - S[:-1, 1:] + S[:-1, :-1]) * (ACROSS.size - 1) ** 2
    normal = unit(np.cross(S_u, S_v))
    normal = unit(normal[1:, 1:] + normal[1:, :-1] + normal[:-1, 1:] + normal[:-1, :-1])
    out = np.einsum("jic,jic->ji", S_uv, normal)
    inside = np.linalg.norm(S_uv - out[..., None] * normal, axis=2)
    return np.array([np.abs(out).max(), inside.max()]) / 4


def unit(a):
    """Unit vectors, zero where the length is nothing beside the largest."""
    length = np.linalg.norm(a, axis=-1, keepdims=True)
    return np.where(length > 1e-9 * length.max(initial=0.0), a / np.maximum(length, 1e-300), 0.0)


def _root_K(S, along, across, border, at, is_kink):
    """sqrt(K / 8) per step, normal and tangential (2, m): differences of S (m + 1, 17, 3) along its first axis."""
    K = np.empty((2, len(at) - 2))
    curvatures(S, along, across, at, *border, K)  # an outline is geometry too: all that leaves its tangent counts
    noise = 64 * np.finfo(float).eps * np.abs(S).max() / np.diff(at)[1:] ** 2
    root = np.sqrt(np.where(K > noise, K, 0.0) / 8)
    # a difference across a kink is no curvature, and at the ends there is none: their steps take the other end's
    root = np.concatenate([np.zeros((2, 1)), np.where(is_kink[1:-1], 0.0, root), np.zeros((2, 1))], axis=1)
    known = np.concatenate([[0], ~is_kink[1:-1], [0]])
    return (root[:, :-1] + root[:, 1:]) / (known[:-1] + known[1:])


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
    """Fewest steps by the turning of the curves S (m + 1, 17, 3) along the first axis: 1 to 3."""
    angle = np.empty(1)
    turning(S, angle)
    return int(np.clip(np.ceil(angle[0] / TURN - 1e-6), 1, 3))


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
            at, root_K = _oriented(demands, link, m)
            part = np.diff(np.stack([np.interp(edge, at, row) for row in _cumulative(at, root_K)]), axis=1)
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
        own = np.concatenate([demands[m // 2].kinks[m % 2], demands[m // 2].forced[m % 2]])
        kinks.append(1 - own if link.is_reversed[m] else own)
        kinks.append(1 - own if is_mirrored else own[:0])
    edge = np.concatenate(kinks)
    if edge.size == 2:
        return edge
    edge = np.unique(edge)
    return edge[np.concatenate([[True], np.diff(edge) > 1e-9])]


def _oriented(demands, link, node):
    """A node's steps (m + 1,) and sqrt(K / 8) (2, m) along its set's direction."""
    at, root_K = demands[node // 2].at[node % 2], demands[node // 2].root_K[node % 2]
    return (1 - at[::-1], root_K[:, ::-1]) if link.is_reversed[node] else (at, root_K)


def _cumulative(at, density):
    """Integral from 0 to each of `at` (m + 1,), of a density (..., m) constant between them."""
    return np.concatenate([np.zeros((*density.shape[:-1], 1)), np.cumsum(density * np.diff(at), axis=-1)], axis=-1)


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
        wanted = []
        if own.max() == 1 and edge.size == 2:
            sets.append(edge)
            continue
        for m in nodes[starts[g] : starts[g + 1]] if own.max() > 1 else ():
            at, root_K = _oriented(p.demands, p.links, m)
            wanted.append((at, (np.sqrt(root_K**2 + added[m][:, None]) / scale[m][:, None]).max(axis=0)))
        if p.links.is_mirrored[g]:
            wanted += [(1 - at[::-1], density[::-1]) for at, density in wanted]
        sets.append(_place(wanted, edge, own, p.links.is_mirrored[g]))
    out = []
    for s in range(len(p.demands)):
        own = [sets[p.links.group[m]] for m in (2 * s, 2 * s + 1)]
        out.append(tuple(1 - t[::-1] if p.links.is_reversed[2 * s + d] else t for d, t in enumerate(own)))
    return out


def _place(wanted, edge, count, is_mirrored):
    """Lines of one set: `count` (k,) steps between the `edge` parameters (k + 1,), each of equal integral of the
    largest of the densities `wanted`, pairs of `at` (m + 1,) and (m,).
    """
    if len(wanted) == 1 and edge.size == 2:  # most often: steps of one surface, from end to end
        ((at, density),) = wanted
    else:
        at = np.unique(np.concatenate([edge, *(a for a, _ in wanted)]))
        middle = (at[:-1] + at[1:]) / 2
        density = np.max([d[np.searchsorted(a, middle) - 1] for a, d in wanted] or [np.ones(middle.size)], axis=0)
    density = density + max(0.05 * density.max(), 1e-30)  # never a step without end where the surface is straight
    summed = _cumulative(at, density)
    own = np.interp(edge, at, summed)
    inner = [
        np.interp(a + (b - a) * np.arange(1, n) / n, summed, at) for a, b, n in zip(own, own[1:], count, strict=False)
    ]
    lines = np.concatenate(
        [np.concatenate([[a], np.rint(t * GRAIN) / GRAIN]) for a, t in zip(edge, inner, strict=False)]
    )
    lines = np.append(lines, 1.0)
    if (np.diff(lines) <= 0).any():
        lines = np.unique(lines)
    return (lines + (1 - lines[::-1])) / 2 if is_mirrored else lines
