"""Geometry entries become named surfaces in world metres: orientation, units, placements, names; bad ones are named."""

from pathlib import Path

import numpy as np
import pytest

from lib.formats import names, placement, scene_geometry
from lib.nurbs.evaluate import frame, point
from lib.nurbs.shape import collapsed_sides, extent
from lib.refusal import Refusal

DATA = Path(__file__).parents[1] / "data"
SQUARE = {"origin": [0, 0, 0], "u": [2, 0, 0], "v": [0, 3, 0]}


def load(*entries, units="m", folder=DATA):
    return scene_geometry.load(list(entries), units, folder, "scene.yaml")


def refused(*entries, **options):
    with pytest.raises(Refusal) as caught:
        load(*entries, **options)
    return str(caught.value)


def middle(one):
    """Point and lit normal in the middle of a placed surface."""
    S, N = frame(one.surface, np.array([0.5]), np.array([0.5]))
    return S[0], N[0] * (-1 if one.flip else 1)


def test_rectangle_faces_u_cross_v():
    [one] = load({"name": "a", "rectangle": SQUARE})[0]
    S, N = middle(one)
    assert S == pytest.approx([1, 1.5, 0]) and N == pytest.approx([0, 0, 1]) and one.area == pytest.approx(6)
    assert extent(one.surface) == pytest.approx((2, 3))


def test_quadrangle_and_triangle_face_where_they_are_counter_clockwise():
    quad = {"name": "q", "quadrangle": [[0, 0, 0], [2, 0, 0], [3, 2, 0], [0, 1, 0]]}
    triangle = {"name": "t", "triangle": [[0, 0, 0], [2, 0, 0], [0, 2, 0]]}
    q, t = load(quad, triangle)[0]
    assert q.area == pytest.approx(3.5) and t.area == pytest.approx(2)
    assert middle(q)[1] == pytest.approx([0, 0, 1]) and middle(t)[1] == pytest.approx([0, 0, 1])
    corners = point(q.surface, np.array([0, 1, 1, 0.0]), np.array([0, 0, 1, 1.0]))
    assert np.array_equal(corners, quad["quadrangle"])
    assert collapsed_sides(t.surface).tolist() == [False, False, False, True]


def test_inline_nurbs_with_and_without_knots():
    points = [[[i, j, 0] for j in range(3)] for i in range(5)]
    net = {"degree_u": 2, "degree_v": 1, "points": points}
    knots = {"knots_u": [0, 0, 0, 1, 2, 3, 3, 3], "knots_v": [5, 5, 6, 7, 7], "weights": [[2] * 3] * 5}
    a, b = load({"name": "a", "nurbs": net}, {"name": "b", "nurbs": {**net, **knots}})[0]
    assert np.allclose(a.surface.Pw, b.surface.Pw, atol=1e-15) and np.allclose(a.surface.knots_u, b.surface.knots_u)
    assert a.area == pytest.approx(8)


@pytest.mark.parametrize("units, metre", [("mm", 1e-3), ("cm", 0.01), ("m", 1), ("in", 0.0254), ("ft", 0.3048)])
def test_units_of_the_scene(units, metre):
    [one] = load({"name": "a", "rectangle": SQUARE, "place": {"translate": [0, 0, 1]}}, units=units)[0]
    assert middle(one)[0] == pytest.approx(np.array([1, 1.5, 1]) * metre)
    assert one.area == pytest.approx(6 * metre**2)


def test_units_of_files():
    entry = {"name": "s", "file": "v7_my_surfaces.3dm"}  # millimetres, 2 x 4 x 6
    own, said, plain = (
        load(entry, units="cm")[0][0],
        load({**entry, "units": "m"}, units="cm")[0][0],
        load({"name": "t", "file": "teapot.bpt"}, units="cm")[0],
    )
    size = lambda one: np.ptp(one.surface.P.reshape(-1, 3), axis=0)  # noqa: E731
    assert size(said) == pytest.approx(1000 * size(own))
    P = np.concatenate([one.surface.P.reshape(-1, 3) for one in plain])
    assert np.ptp(P, axis=0) == pytest.approx([0.06525, 0.04, 0.0315])  # the file states no unit: the scene's


def test_placement_scales_then_turns_then_moves_in_the_scenes_units():
    place = {"scale": 2, "rotate": [{"axis": [0, 0, 5], "degrees": 90}, {"axis": [1, 0, 0], "degrees": 90}]}
    entry = {"name": "a", "rectangle": SQUARE, "place": {**place, "translate": [10, 0, 0]}}
    [one] = load(entry, units="cm")[0]
    S, N = middle(one)
    assert S == pytest.approx([0.07, 0, 0.02]) and N == pytest.approx([0, -1, 0])
    assert one.area == pytest.approx(24e-4)


@pytest.mark.parametrize("scale", [-1, [-1, 1, 1], [1, 1, -2], [-1, -1, 1]])
def test_a_mirrored_copy_keeps_its_lit_side(scale):
    """The outside of a teapot's body stays outside."""
    for one in load({"name": "t", "file": "teapot.bpt", "only": "05", "place": {"scale": scale}})[0]:
        S, N = middle(one)
        assert (S * [1, 1, 0]) @ N > 0
        assert one.flip == (np.prod(np.broadcast_to(scale, 3)) < 0)


def test_flip_comes_on_top_of_the_file_and_the_mirror():
    plain = load({"name": "s", "file": "v3_Speeder.3dm"})[0]
    turned = load({"name": "s", "file": "v3_Speeder.3dm", "flip": True, "place": {"scale": [1, -1, 1]}})[0]
    assert [one.flip for one in plain] == [one.flip for one in turned]
    assert sorted(one.flip for one in plain) == [False, True]


def test_quarter_turns_are_exact():
    for degrees in (90, -270, 450):
        R = placement.rotation([0, 0, 3], degrees)
        assert np.array_equal(R, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    R = placement.rotation([1, 2, 3], 77)
    assert np.allclose(R @ R.T, np.eye(3)) and np.trace(R) == pytest.approx(1 + 2 * np.cos(np.radians(77)))


def test_names_of_patches_and_copies():
    once = load({"name": "pot", "file": "teapot.bpt"})[0]
    assert [one.name for one in once[:2]] == ["pot/01", "pot/02"]
    twice = load({"file": "teapot.bpt", "place": [{}, {"translate": [9, 0, 0]}]})[0]
    assert [twice[0].name, twice[63].name] == ["teapot.1/01", "teapot.2/32"]
    assert [twice[0].object, twice[63].object] == ["teapot.1", "teapot.2"]
    [one, two] = load({"name": "a", "rectangle": SQUARE, "place": [{}, {"translate": [0, 0, 1]}]})[0]
    assert (one.name, two.name) == ("a.1", "a.2")
    assert load({"name": "o", "file": "v7_my_surfaces.3dm"})[0][0].name == "o/1"


def test_areas_of_copies_are_those_of_the_copies():
    places = [{}, {"scale": 3}, {"scale": [2, 1, 1]}, {"scale": -1, "rotate": {"axis": [1, 1, 1], "degrees": 20}}]
    found = load({"name": "p", "file": "teapot.bpt", "only": "05", "place": places})[0]
    again = [load({"name": "p", "file": "teapot.bpt", "only": "05", "place": place})[0][0].area for place in places]
    assert [one.area for one in found] == pytest.approx(again, rel=1e-12)
    assert found[1].area == pytest.approx(9 * found[0].area)


def test_very_thin_far_and_small_surfaces_are_surfaces():
    thin = {"origin": [1e5, 0, 0], "u": [1, 0, 0], "v": [0, 1e-6, 0]}
    assert load({"name": "a", "rectangle": thin})[0][0].area == pytest.approx(1e-6)
    for scale in (1e-6, 1e6):
        assert load({"name": "a", "rectangle": SQUARE, "place": {"scale": scale}})[0][0].area == pytest.approx(
            6 * scale**2
        )


@pytest.mark.parametrize(
    "entry, said",
    [
        ({"rectangle": {"origin": [0, 0, 0], "u": [1, 1, 0], "v": [2, 2, 0]}}, "the surface has no area"),
        ({"rectangle": {"origin": [5e4, 1, 7], "u": [1, 0.3, 0.1], "v": [0.1, 0.03, 0.01]}}, "the surface has no area"),
        ({"rectangle": {"origin": [0, 0, 0], "u": [0, 0, 0], "v": [0, 0, 0]}}, "the surface has no area"),
        ({"triangle": [[0, 0, 0], [1, 1, 1], [2, 2, 2]]}, "the surface has no area"),
        ({"quadrangle": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]}, "quadrangle: the corners cross or are concave"),
        ({"quadrangle": [[0, 0, 0], [4, 0, 0], [1, 1, 0], [0, 4, 0]]}, "quadrangle: the corners cross or are concave"),
        (
            {"rectangle": SQUARE, "place": {"rotate": {"axis": [0, 0, 0], "degrees": 3}}},
            "place.rotate.axis: [0, 0, 0] has no",
        ),
        ({"rectangle": SQUARE, "place": {"scale": 1e100, "translate": [1e100, 0, 0]}}, "place (points): NaN, Inf or"),
    ],
)
def test_degenerate_entries_are_refused_by_name(entry, said):
    message = refused({"name": "thing", **entry})
    assert message.startswith("scene.yaml: surface thing: ") and said in message


def nurbs(**fields):
    points = [[[i, j, i * j] for j in range(3)] for i in range(4)]
    return {"name": "n", "nurbs": {"degree_u": 2, "degree_v": 2, "points": points, **fields}}


@pytest.mark.parametrize(
    "entry, said",
    [
        (nurbs(degree_u=4), "nurbs.degree_u: 4 needs at least 5 control points, found 4"),
        (nurbs(knots_u=[0, 0, 0, 1, 1, 1]), "nurbs.knots_u: 6 knots, expected 4 + 2 + 1 = 7"),
        (nurbs(knots_u=[0, 0, 0, -1, 1, 1, 1]), "nurbs.knots_u: knot 3 goes back"),
        (nurbs(knots_v=[1, 1, 1, 1, 1, 1]), "nurbs.knots_v: empty domain [1, 1]"),
        (nurbs(points=[[[0, 0, 0], [1, 0, 0]], [[0, 1, 0]]]), "nurbs.points[1]: 1 points, the first row has 2"),
        (nurbs(weights=[[1, 1, 1]] * 3), "nurbs.weights: expected 4 rows of 3 weights"),
        (nurbs(weights=[[1, 1, 1]] * 3 + [[1, 1]]), "nurbs.weights: expected 4 rows of 3 weights"),
    ],
)
def test_broken_inline_nurbs_are_refused_by_field(entry, said):
    assert refused(entry).startswith(f"scene.yaml: surface n: {said}")


def test_mistakes_of_several_entries_and_files_are_listed_together(tmp_path):
    (tmp_path / "a.bpt").write_text("1\n1 1\n0 0 0\n")
    flat = {"name": "flat", "triangle": [[0, 0, 0], [1, 0, 0], [2, 0, 0]]}
    message = refused({"name": "a", "file": "a.bpt"}, flat, nurbs(degree_u=4), folder=tmp_path)
    assert sorted(line.split(": ")[1] for line in message.splitlines()) == ["surface a/1", "surface flat", "surface n"]


def test_equal_names_of_surfaces_are_refused():
    one = {"name": "pot/01", "rectangle": SQUARE}
    assert "surface pot/01: name: another surface has this name" in refused(one, {"name": "pot", "file": "teapot.bpt"})


@pytest.mark.parametrize(
    "name", ["", " ", "../x", "a/../b", "/etc/x", "a//b", "a\nb", "a\0b", "x" * 300, "C:\\x", "a/"]
)
def test_names_that_are_refused(name):
    assert names.complaint(name)


@pytest.mark.parametrize(
    "name", ["my wall", "Wand Süd", "日本", "-x", "a'b\"c", "{x}", "$(rm -rf)", "a;b&c|d", "wall/left"]
)
def test_odd_names_are_kept_and_their_files_are_plain(name):
    assert names.complaint(name) is None
    [stem] = names.numbered_stems([name])
    assert stem.startswith("000-") and all(c.isalnum() or c in "-_." for c in stem) and stem.isascii()


def test_names_that_differ_in_case_only_keep_both_files():
    stems = names.numbered_stems(["Wall", "wall", "wäll"])
    assert len({stem.lower() for stem in stems}) == 3
