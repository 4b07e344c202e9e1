"""Bezier patches as text: .bpt, and the indexed teaset form of the Newell models.

.bpt    number of patches; per patch a header of two integers, then its points `x y z`, one a line.  Two forms of the
        header are in use: the degrees (`3 3` before 16 points) or the points per side (`4 4` before 16); which one it
        is follows from the number of points before the next header.
teaset  number of patches; per patch 16 comma-separated indices from 1; number of vertices; per vertex `x,y,z`.

The formats state no normal.  Points are taken to run along u first, point k of rows of n is P[k % n, k // n]: so
S_u x S_v points out of Newell's teapot.  Formats as in holmes3d.net/graphics/teapot and sjbaker.org's teaset.
"""

import re

import numpy as np

from lib.formats import names
from lib.formats.patches import MAX_PATCHES, GeometryFile, Patch, is_selected
from lib.nurbs.surface import bezier

MAX_DEGREE = 20


def read(text, report, only=None, teaset=False):
    """Read the text of a .bpt, or of a teaset file, as a GeometryFile; mistakes go to `report` (see patches)."""
    lines = [(number, line.split("#")[0]) for number, line in enumerate(text.splitlines(), 1)]
    rows = [(number, re.split(r"[\s,]+", line.strip(" \t,"))) for number, line in lines if line.strip(" \t,")]
    if not rows:
        report.fatal("is empty")
    count = _counts(rows[0], 1, report, "number of patches")[0]
    if not 1 <= count <= MAX_PATCHES:
        report.fatal(f"{count} patches; allowed: 1 to {MAX_PATCHES}", line=rows[0][0])
    report.total = count
    nets = _indexed(rows, count, report) if teaset else _listed(rows, count, report)
    patches = []
    for number, (line, P) in enumerate(nets, 1):
        labels = (str(number), names.padded(number, count))
        if not is_selected(labels, only):
            continue
        surface = report.surface(lambda P=P: bezier(P.swapaxes(0, 1)), number, line)
        if surface is not None:
            patches.append(Patch(number, surface, labels=labels))
    if not patches:
        report.add(f"no patch matches '{only}'; patches are called 1 to {count}", field="only")
    return GeometryFile(patches, count)


def _listed(rows, count, report):
    """Nets of a .bpt: (line, rows of points) per patch."""
    at, nets = 1, []
    for number in range(1, count + 1):
        if at >= len(rows):
            report.fatal(f"ends before patch {number} of {count}", number)
        line = rows[at][0]
        header = _counts(rows[at], 2, report, "header", number)
        end = at + 1
        while end < len(rows) and len(rows[end][1]) == 3:
            end += 1
        found = end - at - 1
        sides = next((s for s in ((header[0] + 1, header[1] + 1), header) if s[0] * s[1] == found), None)
        if min(header) < 1 or max(header) > MAX_DEGREE or sides is None or min(sides) < 2:
            a, b = header
            report.fatal(
                f"header {a} {b} is followed by {found} points; expected {(a + 1) * (b + 1)} (degrees {a} {b}) "
                f"or {a * b} ({a} x {b} points), degrees 1 to {MAX_DEGREE}",
                number,
                line=line,
            )
        P = np.array([_point(row, report, number) for row in rows[at + 1 : end]]).reshape(*sides, 3)
        nets.append((line, P))
        at = end
    if at < len(rows):
        report.fatal(f"goes on after its {count} patches", line=rows[at][0])
    return nets


def _indexed(rows, count, report):
    """Nets of a teaset file: (line, 4 rows of 4 points) per patch."""
    if len(rows) < count + 2:
        report.fatal(f"ends before its {count} patches and the number of vertices")
    n_vertices = _counts(rows[count + 1], 1, report, "number of vertices")[0]
    vertices = rows[count + 2 :]
    if len(vertices) != n_vertices:
        report.fatal(f"{n_vertices} vertices are announced, {len(vertices)} follow", line=rows[count + 1][0])
    V = np.array([_point(row, report, None) for row in vertices]).reshape(-1, 3)
    nets = []
    for number, row in enumerate(rows[1 : count + 1], 1):
        index = np.array(_counts(row, 16, report, "indices", number))
        if index.min() < 1 or index.max() > n_vertices:
            report.fatal(f"an index is outside 1 to {n_vertices}", number, line=row[0])
        nets.append((row[0], V[index - 1].reshape(4, 4, 3)))
    return nets


def _counts(row, n, report, what, number=None):
    line, words = row
    if len(words) != n or not all(re.fullmatch(r"[0-9]{1,9}", word) for word in words):
        report.fatal(
            f"expected the {what} ({n} whole number{'s' * (n > 1)}), found '{' '.join(words)[:40]}'", number, line=line
        )
    return tuple(int(word) for word in words)


def _point(row, report, number):
    line, words = row
    try:
        point = [float(word) for word in words]
        if len(point) == 3 and all(abs(x) <= 1e100 for x in point):  # NaN fails the comparison
            return point
    except ValueError:
        pass
    report.fatal(
        f"expected a point (3 finite numbers within 1e100), found '{' '.join(words)[:40]}'", number, "points", line
    )
