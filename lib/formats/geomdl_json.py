"""Surfaces of a geomdl JSON file, as its exchange.export_json writes it.

`{"shape": {"type": "surface", "count": 1, "data": [{degree_u, degree_v, knotvector_u, knotvector_v, size_u, size_v,
control_points: {points, weights}}, ...]}}`; points are listed along v first and are not multiplied by the weights.
"""

import json
import math

import numpy as np

from lib.formats import names
from lib.formats.mistakes import nearest, shown
from lib.formats.patches import MAX_PATCHES, GeometryFile, Patch, is_selected
from lib.nurbs.surface import from_points

MAX_DEGREE = 20
MAX_POINTS = 1_000_000
_REQUIRED = ("degree_u", "degree_v", "knotvector_u", "knotvector_v", "size_u", "size_v", "control_points")
_KNOWN = (*_REQUIRED, "type", "rational", "dimension", "delta", "name", "id", "trims", "reversed")


def read(text, report, only=None, trimmed="refuse"):
    """Read the text of a geomdl JSON file as a GeometryFile; mistakes go to `report` (see patches)."""
    records = _records(_parse(text, report), report)
    report.total = len(records)
    patches, skipped, labels_seen = [], [], []
    for number, record in enumerate(records, 1):
        labels = _labels(record, number, len(records))
        labels_seen.append(labels[0])
        if not is_selected(labels, only):
            continue
        if isinstance(record, dict) and record.get("trims"):
            if trimmed == "skip":
                skipped.append(number)
            else:
                report.add("the surface is trimmed; `trimmed: skip` leaves trimmed surfaces out", number, "trims")
            continue
        if _check(record, number, report):
            patches.append(Patch(number, _surface(record), bool(record.get("reversed")), labels))
    if not patches and not len(report.mistakes):
        report.add(
            f"no surface left to read; the file holds {', '.join(labels_seen[:12])}", field="only" if only else None
        )
    notes = [f"skipped: {len(skipped)} trimmed surface{'s' * (len(skipped) > 1)}"] if skipped else []
    return GeometryFile(patches, len(records), notes=notes, trimmed=skipped)


def _labels(record, number, total):
    name = record.get("name") if isinstance(record, dict) else None
    own = (name,) if isinstance(name, str) and name else ()
    return (*own, str(number), names.padded(number, total))


def _parse(text, report):
    def pairs(items):
        keys = [key for key, _ in items]
        double = next((key for key in keys if keys.count(key) > 1), None) if len(keys) < 1000 else None
        if double is not None:
            report.fatal("stands twice in one object", field=double[:60])
        return dict(items)

    def constant(word):
        report.fatal(f"{word} is not a finite number")

    try:
        return json.loads(text, object_pairs_hook=pairs, parse_constant=constant)
    except RecursionError:
        report.fatal("is nested too deep")
    except ValueError as error:
        report.fatal(
            f"is not JSON: {getattr(error, 'msg', 'a number is too long')}", line=getattr(error, "lineno", None)
        )


def _records(content, report):
    shape = content.get("shape") if isinstance(content, dict) else None
    if not isinstance(shape, dict):
        report.fatal("holds no `shape`; expected a geomdl JSON file")
    if shape.get("type") != "surface":
        report.fatal(f"{shown(shape.get('type'))}; expected surface", field="shape.type")
    data = shape.get("data")
    data = [data] if isinstance(data, dict) else data
    if not isinstance(data, list) or not 1 <= len(data) <= MAX_PATCHES:
        report.fatal(f"expected a list of 1 to {MAX_PATCHES} surfaces", field="shape.data")
    return data


def _check(record, number, report):
    """Note what keeps a record from being a surface; True if nothing does."""
    before = len(report.mistakes)
    if not isinstance(record, dict):
        report.add(f"expected an object, found {shown(record)}", number)
        return False
    for key in record:
        if key not in _KNOWN:
            report.add(f"unknown key{nearest(key, _KNOWN)}", number, key[:60])
    for key in _REQUIRED:
        if key not in record:
            report.add("is missing", number, key)
    if record.get("dimension", 3) != 3:
        report.add(f"{shown(record['dimension'])}; expected 3", number, "dimension")
    for key, high in (
        ("degree_u", MAX_DEGREE),
        ("degree_v", MAX_DEGREE),
        ("size_u", MAX_POINTS),
        ("size_v", MAX_POINTS),
    ):
        value = record.get(key, 1)
        if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= high:
            report.add(f"{shown(value)}; expected a whole number from 1 to {high}", number, key)
    for key in ("knotvector_u", "knotvector_v"):
        if key in record and not _numbers(record[key]):
            report.add("expected a list of finite numbers", number, key)
    if len(report.mistakes) > before:
        return False
    _check_net(record, number, report)
    return len(report.mistakes) == before


def _check_net(record, number, report):
    net = record["control_points"]
    n_u, n_v = record["size_u"], record["size_v"]
    points = net.get("points") if isinstance(net, dict) else None
    if not isinstance(points, list) or len(points) != n_u * n_v:
        found = f"{len(points)}" if isinstance(points, list) else "no list"
        report.add(f"expected {n_u} x {n_v} = {n_u * n_v} points, found {found}", number, "control_points.points")
        return
    bad = next((k for k, point in enumerate(points) if not (_numbers(point) and len(point) == 3)), None)
    if bad is not None:
        what = f"{shown(points[bad])}; expected 3 finite numbers within 1e100"
        report.add(what, number, f"control_points.points[{bad}]")
        return
    weights = net.get("weights", [1.0] * len(points))
    if not _numbers(weights) or len(weights) != len(points):
        report.add(f"expected {len(points)} finite numbers", number, "control_points.weights")
        return
    bad = next((k for k, weight in enumerate(weights) if not weight > 0), None)
    if bad is not None:
        report.add(f"{shown(weights[bad])}; expected > 0", number, f"control_points.weights[{bad}]")
        return
    report.surface(lambda: _from_arrays(record, points, weights, n_u, n_v), number)


def _from_arrays(record, points, weights, n_u, n_v):
    P, w = (
        np.array(points, dtype=np.float64).reshape(n_u, n_v, 3),
        np.array(weights, dtype=np.float64).reshape(n_u, n_v),
    )
    knots = record["knotvector_u"], record["knotvector_v"]
    return from_points(record["degree_u"], record["degree_v"], *knots, P, w)


def _surface(record):
    from lib.nurbs import model  # geomdl, for files of its kind alone

    return model.from_record(record)


def _numbers(values):
    return isinstance(values, list) and all(
        isinstance(x, (int, float)) and not isinstance(x, bool) and abs(x) <= 1e100 and math.isfinite(x) for x in values
    )
