"""Open sheets in a lit scene: which are turned, and which get both sides."""

import pytest

from lib.formats import scene_model

CUP = {  # five walls of a box open at the top, each with its front inside
    "bottom": ([0, 0, 0], [1, 0, 0], [0, 1, 0]),
    "left": ([0, 0, 0], [0, 1, 0], [0, 0, 1]),
    "right": ([1, 0, 0], [0, 0, 1], [0, 1, 0]),
    "front": ([0, 0, 0], [0, 0, 1], [1, 0, 0]),
    "back": ([0, 1, 0], [1, 0, 0], [0, 0, 1]),
}
LID = ([0, 0, 1], [0, 1, 0], [1, 0, 0])
LAMPS = {"above": ([-1, -1, 3], [0, 3, 0], [3, 0, 0]), "inside": ([0.4, 0.4, 0.5], [0, 0.2, 0], [0.2, 0, 0])}


@pytest.fixture
def read(tmp_path):
    def read(rectangles, lamps):
        rows = [(name, *corners, "default") for name, corners in rectangles.items()]
        rows += [(name, *LAMPS[name], "glow") for name in lamps]
        entries = [
            f"- {{name: {name}, rectangle: {{origin: {o}, u: {u}, v: {v}}}, material: {material}, two_sided: auto}}"
            for name, o, u, v, material in rows
        ]
        text = ["materials: {glow: {emission: 10}}", "geometry:", *entries]
        (tmp_path / "scene.yaml").write_text("\n".join(text))
        model = scene_model.read(tmp_path)
        turned = {one.name for one in model.placed if model.table[one.name]["turn"] and one.front is None}
        return turned, {one.front for one in model.placed if one.front}

    return read


def test_walls_that_hang_together_are_turned_together(read):
    """A closed box with its fronts inside, light outside: its dark bottom turns with the others."""
    turned, both = read({**CUP, "lid": LID}, ["above"])
    assert turned == {*CUP, "lid"} and not both


def test_light_on_the_other_side_gives_both(read):
    """A lamp in the closed box, and a brighter one outside: no wall loses its lit side, the dark bottom neither."""
    turned, both = read({**CUP, "lid": LID}, ["above", "inside"])
    assert not turned and both == {*CUP, "lid"}


def test_neighbours_that_face_to_different_sides_come_to_face_to_one(read):
    floor = ([0, 0, 0], [3, 0, 0], [0, 3, 0])
    slope = ([0, 0, 0], [-0.5, 0, -0.5], [0, 3, 0])  # its front down
    assert read({"floor": floor, "slope": slope}, ["above"]) == ({"slope"}, set())


@pytest.mark.parametrize("solids, is_open", [(4, True), (5, False)])
def test_a_mesh_of_closed_shells_with_a_little_beside_is_no_open_sheet(tmp_path, solids, is_open):
    """Two triangles lit from above and below, in one mesh with tetrahedra: open with four of these, 89 % of it."""
    lines = ["v 0 0 1", "v 3 0 1", "v 3 3 1", "v 0 3 1", "f 1 2 3", "f 1 3 4"]
    for k in range(solids):
        lines += [f"v {5 + 2 * k + x} {y} {z}" for x, y, z in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))]
        o, x, y, z = range(5 + 4 * k, 9 + 4 * k)
        lines += [f"f {o} {y} {x}", f"f {o} {x} {z}", f"f {o} {z} {y}", f"f {x} {y} {z}"]
    (tmp_path / "thing.obj").write_text("\n".join(lines))
    (tmp_path / "scene.yaml").write_text(
        "materials: {glow: {emission: 10}}\n"
        "geometry:\n"
        "- {name: thing, file: thing.obj, two_sided: auto}\n"
        "- {name: above, rectangle: {origin: [-1, -1, 3], u: [0, 5, 0], v: [5, 0, 0]}, material: glow}\n"
        "- {name: below, rectangle: {origin: [-1, -1, -1], u: [5, 0, 0], v: [0, 5, 0]}, material: glow}\n"
    )
    model = scene_model.read(tmp_path)
    assert [one.front for one in model.placed if one.front] == ["thing/1"] * is_open
