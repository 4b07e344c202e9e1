"""Emitters as facets: the power of the exact surface, the side that shines."""

import numpy as np
import pytest

from lib.nurbs.shape import area, transformed
from lib.nurbs.surface import bilinear
from lib.radiosity.emitters import ENOUGH, facets_of, facets_of_triangles, gather_emitters, simplified
from lib.radiosity.form_factors import form_factor_facets
from tests.shapes import cylinder, disc, extruded, rectangle, sphere, triangle
from tests.tolerances import EXACT

AREAS = {
    "rectangle": (rectangle([1, 2, 3], [2, 0, 0], [0, 0, 3]), 6),
    "triangle": (triangle([0, 0, 0], [2, 0, 0], [0, 3, 0]), 3),
    "trapezium": (bilinear([0, 0, 0], [4, 0, 0], [3, 1, 0], [1, 1, 0]), 3),
    "sphere": (sphere(0.5), np.pi),
    "cylinder": (cylinder(0.5, 2.0), 2 * np.pi),
    "disc": (disc(2.0), 4 * np.pi),
    "corner": (extruded([[0, 0], [1, 0], [1, 1]], 1.0), 2),
}


@pytest.mark.parametrize("surface, expected", AREAS.values(), ids=AREAS)
@pytest.mark.parametrize("scale", [1e-6, 1, 1e6])
def test_power_is_that_of_the_exact_surface(surface, expected, scale):
    facets = facets_of(transformed(surface, np.diag([scale, scale, scale, 1])))
    assert facets.weight @ facets.area == pytest.approx(expected * scale**2, rel=1e-6)
    assert (facets.area > 0).all() and np.abs(np.linalg.norm(facets.normal, axis=1) - 1).max() < EXACT


def test_flat_ones_are_few():
    one = facets_of(AREAS["rectangle"][0])
    assert len(one.area) == 1 and not one.is_triangle[0] and one.weight[0] == pytest.approx(1, rel=EXACT)
    assert len(facets_of(AREAS["triangle"][0]).area) == 1
    assert len(facets_of(AREAS["trapezium"][0]).area) == 2


@pytest.mark.parametrize("flip", [False, True])
def test_normals_are_on_the_side_that_shines(flip):
    sign = -1 if flip else 1
    for surface in (sphere(0.5), cylinder(0.5, 2.0)):
        facets = facets_of(surface, flip)
        outwards = facets.centre * [1, 1, 0 if surface.degree_v == 1 else 1]
        assert (sign * (facets.normal * outwards).sum(axis=1) > 0).all()
    assert facets_of(disc(), flip).normal == pytest.approx(
        np.tile([0, 0, -sign], (len(facets_of(disc()).area), 1)), abs=1e-9
    )
    assert facets_of(rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), flip).normal.tolist() == [[0, 0, sign]]


def test_facets_stay_close_to_the_surface():
    """Corners on the sphere, centres within 1 % of its size of it."""
    facets = facets_of(sphere(0.5))
    corners = facets.corners().reshape(-1, 3)
    assert np.linalg.norm(corners, axis=1) == pytest.approx(np.full(len(corners), 0.5), rel=1e-9)
    assert np.linalg.norm(facets.centre, axis=1).min() > 0.5 - 0.02


def test_a_hollow_fills_the_view_from_within():
    """From the middle of a sphere that shines inwards the facets around the equator are as far out as in, weight 1."""
    facets = facets_of(sphere(0.5), flip=True)
    corners = np.linalg.norm(facets.corners(), axis=2)
    assert 0.5 < corners.min() and corners.max() < 0.51
    assert 0.49 < np.linalg.norm(facets.centre, axis=1).min() < 0.5
    assert (facets.weight == 1).all()


def test_a_tube_is_round_however_long():
    facets = facets_of(cylinder(1e-3, 1.0))
    assert facets.weight @ facets.area == pytest.approx(2e-3 * np.pi, rel=1e-6)
    assert facets.weight == pytest.approx(np.ones(len(facets.weight)), abs=0.01)


def test_corners_and_centres():
    facets = facets_of(rectangle([1, 1, 1], [2, 0, 0], [0, 4, 0]))
    assert facets.corners()[0].tolist() == [[1, 1, 1], [3, 1, 1], [3, 5, 1], [1, 5, 1]]
    assert facets.centre.tolist() == [[2, 3, 1]]
    three = facets_of(triangle([0, 0, 0], [3, 0, 0], [0, 3, 0]))
    assert three.centre == pytest.approx(np.array([[1, 1, 0]]), abs=EXACT)
    assert len(np.unique(three.corners()[0], axis=0)) == 3


def test_the_emitters_of_a_scene():
    surfaces = [rectangle([0, 0, 0], [1, 0, 0], [0, 1, 0]), None, sphere(), None, disc()]
    E = np.zeros((5, 3))
    E[2], E[4, 1] = [1, 2, 3], 7
    found = gather_emitters(surfaces, np.array([False, False, False, False, True]), E, np.array([0, 0, 1, 0, 2]))
    assert found.surface.tolist() == [2, 4] and found.group.tolist() == [1, 2]
    assert found.E.tolist() == [[1, 2, 3], [0, 7, 0]] and found.is_curved.all()
    assert found.first[0] == 0 and found.first[-1] == len(found.facets.area)
    of_disc = slice(found.first[1], found.first[2])
    assert (found.facets.normal[of_disc, 2] > 0).all()  # flipped: S_u x S_v looks down
    power = [(found.facets.area * found.facets.weight)[found.first[k] : found.first[k + 1]].sum() for k in (0, 1)]
    assert power == pytest.approx([area(sphere()), np.pi], rel=1e-6)


def test_no_emitters():
    none = gather_emitters([None], np.zeros(1, bool), np.zeros((1, 3)), np.zeros(1, int))
    assert len(none.E) == 0 and none.first.tolist() == [0] and none.facets.corners().shape == (0, 4, 3)


def test_many_triangles_become_few_with_the_same_light():
    """A glowing sphere of 20,000 triangles: the light of the exact one, from ENOUGH facets."""
    angle = np.linspace(0, np.pi, 101)
    ring = np.linspace(0, 2 * np.pi, 101)[:-1]
    V = np.stack(
        [
            np.outer(np.sin(angle), np.cos(ring)).ravel(),
            np.outer(np.sin(angle), np.sin(ring)).ravel(),
            np.repeat(np.cos(angle), len(ring)),
        ],
        axis=1,
    )
    j, i = (k.ravel() for k in np.meshgrid(np.arange(100), np.arange(100), indexing="ij"))
    a, b = j * 100 + i, j * 100 + (i + 1) % 100
    F = np.concatenate([np.stack([a, a + 100, b + 100], axis=1), np.stack([a, b + 100, b], axis=1)])
    ((P, few),) = simplified([(V, F)])
    assert ENOUGH / 2 < len(few) <= 1.5 * ENOUGH
    facets = facets_of_triangles(tuple(P[few[:, k]] for k in range(3)), 4 * np.pi)
    assert facets.weight @ facets.area == pytest.approx(4 * np.pi, rel=1e-9)
    x = np.array([[3.0, 0, 0], [0, -1.5, 0], [0, 0, 2], [1.2, 1.2, 1.2]])
    r = np.linalg.norm(x, axis=1)
    F = form_factor_facets(x, -x / r[:, None], facets) @ facets.weight
    assert F == pytest.approx(1 / r**2, rel=0.02)


def test_few_triangles_stay():
    V, F = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
    ((P, same),) = simplified([(V, F)])
    assert P is V and same is F
