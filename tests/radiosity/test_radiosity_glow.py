"""Light of surfaces that shine by a picture, against plain lamps in its places."""

from dataclasses import fields

import numpy as np
import pytest

from lib.maps.glow import Glow
from tests.maps.test_maps_emission import picture
from tests.maps.test_maps_mesh_texture import square_mesh
from tests.radiosity.test_radiosity_direct import FLOOR, LAMP, lamp_corners, light, points, polygon
from tests.radiosity.test_radiosity_kinds import half_square
from tests.rooms import shining, world_of
from tests.shapes import cylinder, rectangle, sphere
from tests.surfaces.trimmed_shapes import SQUARE, circle, cut_out
from tests.tolerances import FLOAT32

LEFT, RIGHT = lamp_corners(-0.5, 0.0), lamp_corners(0.0, 0.5)
HOLE = cut_out(LAMP, [SQUARE, circle([0.5, 0.5], 0.3, 64, is_hole=True)])
PICTURE = {"whole": 1e-3, "mesh": 2e-3}  # relative; a mesh's picture is linear between the centres of its pixels
DOWN = np.array([[-0.5, 0.5, 1], [0.5, 0.5, 1], [0.5, -0.5, 1], [-0.5, -0.5, 1]])  # corners of LAMP


def lamp_mesh(text):
    """LAMP as a mesh of two triangles with a picture."""
    made = square_mesh(V=DOWN)
    return shining(type(made)(made.V, made.F, -made.N, made.T, made.uv, made.chart, made.level), picture(text))


def lamps(text):
    return {"whole": shining(LAMP, picture(text)), "mesh": lamp_mesh(text)}


@pytest.mark.parametrize("kind", ["whole", "mesh"])
def test_half_a_lamp_black_is_half_a_lamp(kind):
    x = points(200)
    H, _ = light(FLOOR | {"lamp": lamps("w.")[kind]}, x)
    assert H[:, 0, 0] == pytest.approx(polygon(LEFT, x), rel=PICTURE[kind])


@pytest.mark.parametrize("kind", ["whole", "mesh"])
def test_colours_are_not_mirrored(kind):
    """Left half red, right half blue: the floor below the left is redder, as the polygons of the halves say."""
    x = points(200)
    H, _ = light(FLOOR | {"lamp": lamps("rb")[kind]}, x)
    assert H[:, 0] == pytest.approx(
        np.stack([polygon(LEFT, x), np.zeros(len(x)), polygon(RIGHT, x)], axis=1), rel=PICTURE[kind], abs=1e-6
    )
    left = x[:, 0] < 0
    assert (H[left, 0, 0] > H[left, 0, 2]).all() and (H[~left, 0, 0] < H[~left, 0, 2]).all()


def test_top_and_bottom_are_not_mirrored():
    """v runs towards -y: the top of the picture lies at y < 0."""
    H, _ = light(FLOOR | {"lamp": shining(LAMP, picture("r b"))}, [[0, -0.4, 0], [0, 0.4, 0]])
    assert H[0, 0, 0] > 1.5 * H[0, 0, 2] and H[1, 0, 2] > 1.5 * H[1, 0, 0]


def test_a_shadow_falls_from_the_part_that_shines():
    """A screen hides the left half, which alone shines: dark to the right of it, and in full light to the left."""
    screen = {"screen": (rectangle([-5, -5, 0.5], [5, 0, 0], [0, 10, 0]), {})}
    H, noise = light(FLOOR | screen | {"lamp": shining(LAMP, picture(".w"))}, [[0.6, 0.1, 0], [-0.6, 0.1, 0]])
    assert H[0, 0, 0] == pytest.approx(polygon(RIGHT, [[0.6, 0.1, 0]])[0], rel=PICTURE["whole"])
    assert H[1, 0, 0] == 0 and not noise.any()


def power(world):
    """W in the unit of the frame, (3,)."""
    emitters = world.emitters
    each = np.add.reduceat(emitters.facets.area * emitters.facets.weight, emitters.first[:-1])
    return each @ emitters.E


@pytest.mark.parametrize(
    "surface",
    [LAMP, sphere(), cylinder(), square_mesh(), half_square(), HOLE],
    ids=["flat", "sphere", "cylinder", "mesh", "half", "hole"],
)
@pytest.mark.parametrize("repeat", [(1, 1), (3, 1.5)])
def test_power_is_exact(surface, repeat):
    noise = np.random.default_rng(3).random((60, 90, 3)).astype(np.float32) ** 8
    lit = shining(surface, noise, [3.0, 2, 1], repeat)
    world, plain = (world_of({"floor": FLOOR["floor"], "lamp": lamp}) for lamp in (lit, (surface, {"E": lit[1]["E"]})))
    assert len(world.emitters.E) > 8
    assert power(world) == pytest.approx(power(plain), rel=1e-9)
    k = world.scene.names.index("lamp")
    assert power(world) == pytest.approx(world.casters.area[k] * lit[1]["E"], rel=1e-5)


def test_an_even_picture_is_plain_emission_bit_for_bit():
    for surface in (LAMP, sphere(), square_mesh()):
        lit = shining(surface, np.ones((4, 4, 3), np.float32), 7.0)
        assert lit[1]["glow"] is None
        x = points(50)
        assert (light(FLOOR | {"lamp": lit}, x)[0] == light(FLOOR | {"lamp": (surface, {"E": 7.0})}, x)[0]).all()


def test_parts_of_one_colour_are_the_whole():
    """A sphere cut into 64 equal parts gives the light of the sphere."""
    cells = np.stack(np.meshgrid(np.arange(8), np.arange(8)), axis=-1).reshape(-1, 2)
    box = np.stack([cells[:, 0], cells[:, 0] + 1, cells[:, 1], cells[:, 1] + 1], axis=1) / 8
    x = points(60, z=-1.5)
    lamp = sphere(0.5)
    cut = light({"lamp": (lamp, {"E": 1.0, "glow": Glow(box, np.ones((64, 3)))})}, x)[0]
    assert cut == pytest.approx(light({"lamp": (lamp, {"E": 1.0})}, x)[0], rel=FLOAT32)


def test_a_lit_surface_that_casts_nothing_is_no_emitter_of_its_own():
    """A mesh that only receives has no triangles in the shadow mesh; the lamp beside it keeps its light."""
    x = points(20)
    glow = {"glow": (square_mesh(), {"E": 5.0, "role": "receive_only"})}
    both, alone = (light(FLOOR | more | {"lamp": (LAMP, {"E": 1.0})}, x)[0] for more in (glow, {}))
    assert both == pytest.approx(alone, rel=1e-5)


def test_parts_are_facets_in_the_frame():
    """Every field of the facets has as many rows as there are facets, and none of a black part."""
    emitters = world_of({"floor": FLOOR["floor"], "lamp": lamps("w.")["whole"]}).emitters
    assert len(emitters.E) == 2  # the quarters of the half that shines
    assert {len(getattr(emitters.facets, f.name)) for f in fields(emitters.facets)} == {emitters.first[-1]}
