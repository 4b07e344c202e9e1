"""geomdl's own exporter is read back exactly; broken files are named by surface and field."""

import copy
import json

import numpy as np
import pytest
from geomdl import NURBS, BSpline, exchange, multi

from lib.nurbs.evaluate import point
from tests.formats.reading import read, refused

RECORD = {
    "type": "spline",
    "rational": True,
    "dimension": 3,
    "degree_u": 2,
    "degree_v": 1,
    "knotvector_u": [0, 0, 0, 1, 1, 1],
    "knotvector_v": [0, 0, 1, 1],
    "size_u": 3,
    "size_v": 2,
    "control_points": {
        "points": [[1, 0, 0], [1, 0, 2], [1, 1, 0], [1, 1, 2], [0, 1, 0], [0, 1, 2]],
        "weights": [1, 1, 0.5**0.5, 0.5**0.5, 1, 1],
    },
    "delta": [0.05, 0.05],
}  # a quarter of a cylinder of radius 1 and height 2


def write(tmp_path, *records, **outer):
    shape = {"type": "surface", "count": len(records), "data": list(records), **outer}
    (tmp_path / "a.json").write_text(json.dumps({"shape": shape}))
    return tmp_path / "a.json"


def changed(**fields):
    record = copy.deepcopy(RECORD)
    record.update(fields)
    return record


def test_quarter_cylinder_keeps_its_radius(tmp_path):
    [patch] = read(write(tmp_path, RECORD)).patches
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 3)))
    S = point(patch.surface, u, v)
    assert np.abs(np.hypot(S[:, 0], S[:, 1]) - 1).max() < 1e-12
    assert S[:, 2] == pytest.approx(2 * v)


def test_what_geomdl_exports_is_read_back(tmp_path):
    rational, plain = NURBS.Surface(), BSpline.Surface()
    rng = np.random.default_rng(3)
    for shape in (rational, plain):
        shape.degree_u, shape.degree_v = 3, 2
        points = rng.uniform(-1, 1, (5 * 4, 3)).tolist()
        shape.ctrlpts_size_u, shape.ctrlpts_size_v = 5, 4
        shape.ctrlpts = points
        shape.knotvector_u, shape.knotvector_v = [0, 0, 0, 0, 0.3, 1, 1, 1, 1], [0, 0, 0, 0.6, 1, 1, 1]
    rational.weights = rng.uniform(0.5, 2, 20).tolist()
    exchange.export_json(multi.SurfaceContainer(rational, plain), str(tmp_path / "two.json"))
    patches = read(tmp_path / "two.json").patches
    u, v = rng.uniform(size=(2, 50))
    for patch, shape in zip(patches, (rational, plain), strict=True):
        expected = np.array(shape.evaluate_list(np.stack([u, v], axis=1).tolist()))
        assert np.abs(point(patch.surface, u, v) - expected).max() < 1e-13


def test_reversed_surfaces_are_flipped_and_names_selected(tmp_path):
    path = write(tmp_path, changed(name="in", reversed=1), changed(name="out"))
    assert [patch.flip for patch in read(path).patches] == [True, False]
    assert [patch.number for patch in read(path, only="o*").patches] == [2]
    assert "no surface left to read; the file holds in, out" in refused(path, only="x")


def test_trimmed_surfaces_are_refused_by_name_or_skipped(tmp_path):
    path = write(tmp_path, changed(trims={"count": 1, "data": []}), RECORD)
    assert (
        refused(path)
        == "a.json: surface part/1: trims: the surface is trimmed; `trimmed: skip` leaves trimmed surfaces out"
    )
    content = read(path, trimmed="skip")
    assert [patch.number for patch in content.patches] == [2] and content.notes == ["skipped: 1 trimmed surface"]


def points(**at):
    net = copy.deepcopy(RECORD["control_points"])
    net["points"][4] = at["point"]
    return net


def weights(*values):
    return {"points": RECORD["control_points"]["points"], "weights": list(values)}


@pytest.mark.parametrize(
    "fields, said",
    [
        ({"degree_u": 2.5}, "degree_u: 2.5; expected a whole number from 1"),
        ({"degree_u": True}, "degree_u: true; expected a whole number"),
        ({"degree_u": "2"}, "degree_u: '2'; expected a whole number"),
        ({"degree_u": 0}, "degree_u: 0; expected"),
        ({"degree_u": 3, "knotvector_u": [0] * 7}, "degree_u: 3 needs at least 4 control points, found 3"),
        ({"size_u": 4}, "control_points.points: expected 4 x 2 = 8 points, found 6"),
        ({"size_v": 0}, "size_v: 0; expected"),
        ({"dimension": 2}, "dimension: 2; expected 3"),
        ({"knotvector_u": [0, 0, 0, 1, 1]}, "knots_u: 5 knots, expected 3 + 2 + 1 = 6"),
        ({"knotvector_u": [0, 0, 1, 0, 1, 1]}, "goes back"),
        ({"knotvector_u": [0, 0, 0, 0, 0, 0]}, "knots_u: empty domain"),
        ({"knotvector_v": [0, 0, "1", 1]}, "knotvector_v: expected a list of finite numbers"),
        ({"control_points": points(point=[1, 2])}, "control_points.points[4]: [1, 2]; expected 3 finite numbers"),
        ({"control_points": points(point=[1, 2, None])}, "control_points.points[4]"),
        ({"control_points": points(point=[1, 2, 1e101])}, "control_points.points[4]"),
        ({"control_points": points(point=[1, 2, True])}, "control_points.points[4]"),
        ({"control_points": weights(1, 1, 1, 1, 1)}, "control_points.weights: expected 6 finite numbers"),
        ({"control_points": weights(1, 1, 1, 1, 1, 0)}, "control_points.weights[5]: 0; expected > 0"),
        ({"control_points": weights(1, 1, 1, -1, 1, 1)}, "control_points.weights[3]: -1; expected > 0"),
        ({"degre_u": 2}, "degre_u: unknown key; did you mean degree_u?"),
    ],
)
def test_broken_surfaces_are_refused_by_name_and_field(tmp_path, fields, said):
    message = refused(write(tmp_path, RECORD, changed(**fields)))
    assert message.startswith("a.json: surface part/2: ") and said in message


def test_interior_knots_may_repeat_up_to_the_degree(tmp_path):
    crease = changed(size_u=5, knotvector_u=[0, 0, 0, 1, 1, 2, 2, 2])
    crease["control_points"] = {"points": [[i, j, abs(i - 2)] for i in range(5) for j in range(2)]}
    assert len(read(write(tmp_path, crease)).patches) == 1
    torn = {**crease, "size_u": 6, "knotvector_u": [0, 0, 0, 1, 1, 1, 2, 2, 2]}
    torn["control_points"] = {"points": [[i, j, 0] for i in range(6) for j in range(2)]}
    assert "knots_u: an interior knot has multiplicity > degree 2" in refused(write(tmp_path, torn))


@pytest.mark.parametrize(
    "text, said",
    [
        ("{", "is not JSON"),
        ('{"a": NaN}', "NaN is not a finite number"),
        ('{"a": 1, "a": 2}', "a: stands twice"),
        ("[1]", "holds no `shape`"),
        ('{"shape": {"type": "curve"}}', "shape.type: 'curve'; expected surface"),
        ('{"shape": {"type": "surface", "data": []}}', "shape.data: expected a list"),
        ('{"shape": {"type": "surface", "data": [5]}}', "expected an object, found 5"),
        ("[" * 200_000, "nested too deep"),
        ('{"a": ' + "9" * 10_000 + "}", "is not JSON"),
    ],
)
def test_files_that_are_no_geomdl_json_are_refused(tmp_path, text, said):
    (tmp_path / "a.json").write_text(text)
    assert said in refused(tmp_path / "a.json")
