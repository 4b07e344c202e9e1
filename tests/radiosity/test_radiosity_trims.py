"""Light and trimmed faces that share their edges: nothing slips through, nothing is lost along a trim; and one model
in three forms has one light.
"""

from pathlib import Path

import numpy as np
import pytest

from lib.formats import geometry_file
from lib.maps.fill import one_deep
from lib.nurbs.evaluate import evaluate_grid
from lib.surfaces import charts, mesh_build
from lib.surfaces.measure import transformed
from tests.radiosity.test_radiosity_kinds import at
from tests.rooms import baked, cube
from tests.shapes import rectangle
from tests.surfaces.trimmed_shapes import can

PATH = Path(__file__).parents[1] / "data"


def moved(surface, scale, place):
    """The surface scaled, then moved."""
    M = np.diag([scale, scale, scale, 1.0])
    M[:3, 3] = place
    return transformed(surface, M)


def can_at(place, scale=0.25, **facts):
    """A can of trimmed faces: a wall with a seam, a lid and a bottom."""
    return {f"can {k}": (moved(face, scale, place), facts) for k, face in enumerate(can(64))}


def lamp_at(place, side=0.1, E=10.0):
    corner = np.array(place) - [side / 2, side / 2, 0]
    return {"lamp": (rectangle(corner, [0, side, 0], [side, 0, 0]), {"E": E, "is_black": True})}


def seen(H):
    """Light (n, 3) of the samples of a map that are not hidden."""
    value, hidden = H
    return value.sum(axis=2)[~hidden]


def test_no_light_leaves_a_closed_can(tmp_path):
    """A lamp in a can of trimmed faces, in a white room: the room is exactly dark."""
    scene = {**cube(), **can_at([0.5, 0.5, 0.3], flip=True), **lamp_at([0.5, 0.5, 0.42])}
    maps = baked(tmp_path, scene, {name: 0.0 if name == "lamp" else 0.8 for name in scene})
    assert all(seen(maps[f"can {k}"]).mean() > 0.1 for k in range(3))
    for k in range(6):
        assert not one_deep(*maps[f"wall {k}"]).any(), k


def test_no_light_enters_a_closed_can(tmp_path):
    """The lamp outside: the can's inside and a plate in it are exactly dark."""
    plate = {"plate": (rectangle([0.45, 0.45, 0.4], [0.1, 0, 0], [0, 0.1, 0]), {})}
    scene = {**cube(), **can_at([0.5, 0.5, 0.3], flip=True), **plate, **lamp_at([0.5, 0.5, 0.95])}
    maps = baked(tmp_path, scene, {name: 0.0 if name == "lamp" else 0.8 for name in scene})
    assert seen(maps["wall 0"]).mean() > 0.01
    for name in ("can 0", "can 1", "can 2", "plate"):
        assert not one_deep(*maps[name]).any(), name


def test_furnace_of_trimmed_faces(tmp_path):
    """Inside a can that glows everywhere the light is E / (1 - rho), along its trims and seam too."""
    scene = can_at([0, 0, 0], 1.0, flip=True, E=1.0)
    maps = baked(tmp_path, scene, 0.5, rays_per_element=256, gather_rays=256)
    for name, (face, _) in scene.items():
        uv = np.concatenate([face.uv, 0.5 + 0.9 * (face.uv - 0.5)])
        assert at(maps[name], *np.clip(uv, 0, 1).T) == pytest.approx(2.0, rel=0.02), name


def test_a_can_on_the_floor_shades_it_up_to_its_rim(tmp_path):
    """The floor under a standing can is dark, and beside the rim no brighter than a little farther off."""
    scene = {**cube(), **can_at([0.5, 0.5, 0.0], 0.2), **lamp_at([0.5, 0.5, 0.95], 0.3)}
    rho = {name: 0.0 if name == "lamp" else 0.5 for name in scene}
    H, hidden = baked(tmp_path, scene, rho, max_level=5)["wall 0"]
    light = one_deep(H, hidden).sum(axis=2)[..., 0]
    v, u = np.meshgrid(*(np.linspace(-0.5, 0.5, n) for n in light.shape), indexing="ij")
    r, texel = np.hypot(u, v), 1 / (light.shape[0] - 1)
    open_floor = light[r > 0.4].mean()
    assert light[r < 0.2 - 2 * texel].max(initial=0) < 0.01 * open_floor
    beside, farther = (light[(r > a) & (r < b)] for a, b in ((0.2 + texel, 0.24), (0.3, 0.4)))
    assert 0 < beside.max() < farther.max()


def is_visible(hidden, u, v):
    """(n,) bool: all four samples of a map around u, v (n,) are visible: handle and spout reach into the body."""
    h, w = hidden.shape
    i, j = np.minimum((u * (w - 1)).astype(int), w - 2), np.minimum((v * (h - 1)).astype(int), h - 2)
    return ~(hidden[j, i] | hidden[j, i + 1] | hidden[j + 1, i] | hidden[j + 1, i + 1])


CELLS = 24  # triangles along a side of a patch, in pairs
TOLERANCE = 0.02  # of either bake


def teapot_mesh(patches):
    """Newell's teapot as one mesh with charts, and the patch of each of its triangles."""
    t = np.linspace(0, 1, CELLS + 1)
    V = np.concatenate([evaluate_grid(patch, t, t)[0].reshape(-1, 3) for patch in patches])
    corner = np.arange((CELLS + 1) ** 2).reshape(CELLS + 1, CELLS + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    F = np.concatenate([np.stack([a, b, c], axis=2).reshape(-1, 3), np.stack([a, c, d], axis=2).reshape(-1, 3)])
    F = np.concatenate([F + k * corner.size for k in range(len(patches))])
    owner = np.repeat(np.arange(len(patches)), 2 * CELLS**2)
    area = mesh_build.normals_areas(V, F)[1]
    keep = area > 1e-9 * area.max()
    V, F = mesh_build.welded(np.round(V, 9), F[keep])
    mesh = mesh_build.mesh(V, F)[0]
    assert len(mesh.F) == keep.sum()
    return charts.charted(mesh, 0.005), owner[keep]


def teapot_room(pots):
    """A teapot on the floor of a room, a lamp above: the scene and its reflectances."""
    scene = {**cube(), **pots, **lamp_at([0.35, 0.4, 0.95], 0.25)}
    return scene, {name: 0.0 if name == "lamp" else 0.6 for name in scene}


def test_three_forms_of_the_teapot_have_one_light(tmp_path):
    """As .bpt and as teaset text to the last bit; as a mesh to the tolerance: on the floor, and on each patch."""
    place = 0.11, [0.5, 0.5, 1e-4]
    read = {}
    for name in ("teapot.bpt", "teapot.teaset.txt"):
        path = PATH / name
        found = geometry_file.read(path, name, "pot", None, "keep", PATH, None).patches
        read[name] = [moved(patch.surface, *place) for patch in found]
    assert all(np.array_equal(a.Pw, b.Pw) for a, b in zip(read["teapot.bpt"], read["teapot.teaset.txt"], strict=True))
    patches = read["teapot.bpt"]
    settings = {"tolerance": TOLERANCE, "max_level": 7, "elements": 3000}
    whole = baked(tmp_path / "1", *teapot_room({f"pot {k:02d}": (p, {}) for k, p in enumerate(patches)}), **settings)
    mesh, owner = teapot_mesh(patches)
    other = baked(tmp_path / "2", *teapot_room({"pot": (mesh, {})}), **settings)

    u, v = np.random.default_rng(1).random((2, 4000))
    one, two = at(whole["wall 0"], u, v)[:, 0], at(other["wall 0"], u, v)[:, 0]
    assert two.mean() == pytest.approx(one.mean(), rel=0.01)
    assert np.sqrt(((one - two) ** 2).mean()) < 0.03 * one.mean()

    middle = mesh.uv.mean(axis=1).T
    light = at(other["pot"], *middle)[:, 0]
    area = mesh_build.normals_areas(mesh.V, mesh.F)[1] * is_visible(other["pot"][1], *middle)
    t = (np.arange(24) + 0.5) / 24
    u, v = (x.ravel() for x in np.meshgrid(t, t))
    off = []
    for k, patch in enumerate(patches):
        H = whole[f"pot {k:02d}"]
        _, S_u, S_v = evaluate_grid(patch, t, t)
        weight = np.linalg.norm(np.cross(S_u, S_v), axis=2).ravel() * is_visible(H[1], u, v)
        mean, mine = np.average(at(H, u, v)[:, 0], weights=weight), owner == k
        found = np.average(light[mine], weights=area[mine])
        off.append((found - mean) / one.mean())
    assert np.sqrt(np.mean(np.square(off))) < TOLERANCE
    assert np.abs(off).max() < 3 * TOLERANCE  # the knob's patches are a few cells of the mesh's map
