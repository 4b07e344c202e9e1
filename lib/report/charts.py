"""Small drawings of the report as SVG text, by hand: they follow the page's light or dark colours.

matplotlib was measured for the one curve of the report: 0.7 s wall, 0.8 s of a core, for its import and one small plot,
against less than a millisecond here. A retune of the levels of detail is to take seconds, so it is left out.
"""

import math

import numpy as np


def convergence(shots, unshot, target=None):
    """The share of unshot power (log) over the number of shots, as an SVG.

    shots, unshot : equally long sequences, unshot > 0 (zeros are drawn at the foot); target : the share that ends it.
    Returns "" where there is nothing to draw.
    """
    points = [(float(x), float(y)) for x, y in zip(shots, unshot, strict=True) if np.isfinite(x) and np.isfinite(y)]
    positive = [y for _, y in points if y > 0] + ([target] if target else [])
    if len(points) < 2 or not positive:
        return ""
    low, high = math.floor(math.log10(min(positive))), math.ceil(math.log10(max(positive)) - 1e-9)
    high = max(high, low + 1)
    width, height, left, right, top, foot = 640, 260, 58, 14, 12, 40
    x_end = max(x for x, _ in points) or 1.0

    def px(x):
        return left + (width - left - right) * x / x_end

    def py(y):
        return top + (height - top - foot) * (high - max(math.log10(y) if y > 0 else low, low)) / (high - low)

    parts = [f'<svg class="chart" viewBox="0 0 {width} {height}" role="img" aria-label="Unshot power over shots">']
    for power in range(low, high + 1):
        y = py(10.0**power)
        parts.append(
            f'<line class="grid" x1="{left}" x2="{width - right}" y1="{y:.1f}" y2="{y:.1f}"/>'
            f'<text class="tick" x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{_power(power)}</text>'
        )
    for x in _ticks(x_end):
        parts.append(
            f'<line class="grid" x1="{px(x):.1f}" x2="{px(x):.1f}" y1="{height - foot}" '
            f'y2="{height - foot + 4}"/><text class="tick" x="{px(x):.1f}" y="{height - foot + 17}" '
            f'text-anchor="middle">{x:,.0f}</text>'
        )
    if target:
        parts.append(
            f'<line class="target" x1="{left}" x2="{width - right}" y1="{py(target):.1f}" y2="{py(target):.1f}"/>'
            f'<text class="tick target" x="{left + 8}" y="{py(target) - 5:.1f}">'
            f"stop at {target:g}</text>"
        )
    line = " ".join(f"{px(x):.1f},{py(y):.1f}" for x, y in points)
    parts.append(f'<polyline class="curve" points="{line}"/>')
    if len(points) <= 120:
        parts += [
            f'<circle class="dot" cx="{px(x):.1f}" cy="{py(y):.1f}" r="3"><title>{x:,.0f} shots: {y:.3g}</title>'
            "</circle>"
            for x, y in points
        ]
    parts.append(
        f'<text class="tick" x="{(left + width - right) / 2}" y="{height - 4}" text-anchor="middle">shots</text></svg>'
    )
    return "".join(parts)


STYLE = (
    "<style>svg{background:#fff;font:12px sans-serif}.grid{stroke:#ddd}.tick{fill:#555}.curve{fill:none;stroke:#2468b0;"
    "stroke-width:2}.dot{fill:#2468b0}.target{stroke:#b04a24;stroke-dasharray:4}text.target{fill:#b04a24;stroke:none}"
    "</style>"
)


def standalone(svg):
    """A chart as a file of its own: with its name space and light colours; an empty drawing for ""."""
    svg = svg or '<svg viewBox="0 0 1 1"></svg>'
    head, body = svg.split(">", 1)
    return f'{head} xmlns="http://www.w3.org/2000/svg">{STYLE}{body}\n'


def _power(power):
    names = {0: "100 %", -1: "10 %", -2: "1 %", -3: "0.1 %", -4: "0.01 %"}
    return names.get(power, f"10<tspan dy='-5' font-size='9'>{power}</tspan>")


def _ticks(end, count=5):
    """Round numbers from 0 to end.

    >>> _ticks(1234)
    [0.0, 500.0, 1000.0]
    """
    step = 10.0 ** math.floor(math.log10(end / count))
    step *= next(m for m in (1, 2, 5, 10) if end / (m * step) <= count)
    step = max(step, 1.0)
    return [float(step * k) for k in range(int(end / step + 1e-9) + 1)]


def tree_lines(level, i, j, roots):
    """The cell borders of a quadtree's leaves as an SVG path, in finest cells, v up.

    level, i, j : (n,) int   leaves; leaf (l, i, j) covers [i, i+1] x [j, j+1] of the (n_u 2^l) x (n_v 2^l) cells
    roots : (n_u, n_v)

    Returns (path, width, height); runs of borders are joined, so a full tree costs two lines a cell row.

    >>> tree_lines([0], [0], [0], (1, 1))
    ('M0 0h1M0 1h1M0 0v1M1 0v1', 1, 1)
    """
    level, i, j = (np.asarray(x, np.int64) for x in (level, i, j))
    deepest = int(level.max(initial=0))
    w, h = int(roots[0]) << deepest, int(roots[1]) << deepest
    size = np.int64(1) << (deepest - level)
    x, y = i * size, j * size
    path = ""
    for across in (True, False):  # lines along u, at every y; then along v, at every x
        a, b, length, lines = (x, y, w, h) if across else (y, x, h, w)
        steps = np.zeros((lines + 1, length + 1), np.int64)
        for line in (b, b + size):
            np.add.at(steps, (line, a), 1)
            np.add.at(steps, (line, a + size), -1)
        drawn = np.pad(np.cumsum(steps, 1)[:, :-1] > 0, ((0, 0), (1, 1))).astype(np.int8)
        change = np.diff(drawn, axis=1)
        line, first = np.nonzero(change == 1)
        last = np.nonzero(change == -1)[1]
        if across:
            line = h - line
            order = np.argsort(line, kind="stable")
            path += "".join(f"M{p} {q}h{r - p}" for p, q, r in zip(first[order], line[order], last[order], strict=True))
        else:
            path += "".join(f"M{q} {h - r}v{r - p}" for p, q, r in zip(first, line, last, strict=True))
    return path, w, h
