"""Plots on logarithmic axes as SVG, by hand: no plotting library is needed to measure."""

import math
from html import escape

WIDTH, HEIGHT, LEFT, RIGHT, TOP, FOOT = 660, 430, 66, 16, 34, 48
COLOURS = ["#c0392b", "#1f6fb2", "#2e8b57", "#8e5ba6", "#b9770e", "#555555"]
STYLE = (
    "text{font:12px system-ui,sans-serif;fill:#333}.title{font-size:14px;font-weight:600}"
    ".grid{stroke:#e3e3e3}.minor{stroke:#f3f3f3}.axis{stroke:#888;fill:none}"
)


def loglog(title, x_label, y_label, curves, marks=()):
    """An SVG of curves over two logarithmic axes.

    curves : [(name, [(x, y), ...])], positive numbers, drawn in the order given; a name ending in " fit" is dashed
    marks : [(x, y, text)], open circles, targets for instance
    """
    points = [p for _, line in curves for p in line] + [m[:2] for m in marks]
    x0, x1 = _ends([p[0] for p in points])
    y0, y1 = _ends([p[1] for p in points])

    def at(x, y):
        across = LEFT + (WIDTH - LEFT - RIGHT) * (math.log10(x) - x0) / (x1 - x0)
        up = HEIGHT - FOOT - (HEIGHT - TOP - FOOT) * (math.log10(y) - y0) / (y1 - y0)
        return across, up

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}">'
    ]
    parts.append(f'<style>{STYLE}</style><rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>')
    parts.append(f'<text class="title" x="{LEFT}" y="20">{escape(title)}</text>')
    for value, is_named in _lines(x0, x1):
        x = at(value, 10**y0)[0]
        parts.append(f'<path class="{"grid" if is_named else "minor"}" d="M{x:.1f} {TOP}V{HEIGHT - FOOT}"/>')
        if is_named:
            parts.append(f'<text x="{x:.1f}" y="{HEIGHT - FOOT + 16}" text-anchor="middle">{_short(value)}</text>')
    for value, is_named in _lines(y0, y1):
        y = at(10**x0, value)[1]
        parts.append(f'<path class="{"grid" if is_named else "minor"}" d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}"/>')
        if is_named:
            parts.append(f'<text x="{LEFT - 7}" y="{y + 4:.1f}" text-anchor="end">{_short(value)}</text>')
    parts.append(f'<path class="axis" d="M{LEFT} {TOP}V{HEIGHT - FOOT}H{WIDTH - RIGHT}"/>')
    parts.append(
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 10}" text-anchor="middle">{escape(x_label)}</text>'
    )
    turned = f'transform="translate(16 {(TOP + HEIGHT - FOOT) / 2}) rotate(-90)"'
    parts.append(f'<text {turned} text-anchor="middle">{escape(y_label)}</text>')
    key = WIDTH - RIGHT - 34 - 6.6 * max((len(name) for name, _ in curves), default=0)  # of 12 pixel letters
    for number, (name, line) in enumerate(curves):
        colour, dashed = COLOURS[number % len(COLOURS)], name.endswith(" fit")
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in (at(*p) for p in line))
        dash = ' stroke-dasharray="5 4"' if dashed else ""
        parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.8"{dash}/>')
        for p in () if dashed else line:
            x, y = at(*p)
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.2" fill="{colour}"/>')
        y = TOP + 14 + 17 * number
        parts.append(f'<path d="M{key:.0f} {y - 4}h22" stroke="{colour}" stroke-width="2.5"{dash}/>')
        parts.append(f'<text x="{key + 28:.0f}" y="{y}">{escape(name)}</text>')
    for x, y, text in marks:
        x, y = at(x, y)
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="none" stroke="#333"/>')
        parts.append(f'<text x="{x + 8:.1f}" y="{y + 4:.1f}">{escape(text)}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"


def _ends(values):
    low, high = math.log10(min(values)), math.log10(max(values))
    room = max(0.05 * (high - low), 0.05)
    return low - room, high + room


def _lines(low, high):
    """(value, whether it is written out) of grid lines between powers of ten low and high: 1, 2, 5 are written."""
    lines = [(m * 10.0**e, m in (1, 2, 5)) for e in range(math.floor(low), math.ceil(high) + 1) for m in range(1, 10)]
    return [(v, named) for v, named in lines if low <= math.log10(v) <= high]


def _short(value):
    """A number as short as it can be.

    >>> _short(20000.0), _short(0.5), _short(2e6)
    ('20 k', '0.5', '2 M')
    """
    for size, unit in ((1e6, " M"), (1e4, " k")):
        if value >= size * 0.999:
            return f"{value / (1e6 if unit == ' M' else 1e3):g}{unit}"
    return f"{value:g}"
