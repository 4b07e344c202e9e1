"""The two reference scenes as scene folders, and the irradiance of a finished bake at their points.

The surfaces are the exact ones of scene.json: rectangles cut round the holes of the lights, torus and sphere as
rational quadratics, the teapot's Bezier patches.  The reference's own (u, v) of torus and sphere are angles;
`at_points` converts them.
"""

import json
from pathlib import Path

import numpy as np
import yaml

HERE = Path(__file__).parent
CIRCLE = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)], dtype=float)
CIRCLE_W = np.array([1, np.sqrt(0.5)] * 4 + [1.0])
CIRCLE_KNOTS = np.repeat([0, 0.25, 0.5, 0.75, 1.0], [3, 2, 2, 2, 3])


def pieces(surface):
    """A surface of scene.json as [(name, uv box (u0, v0, u1, v1) of the original, nurbs dict)]."""
    shape = surface["shape"]
    if shape["type"] == "bilinear":
        boxes = around(surface["holes"])
        names = [surface["name"]] if len(boxes) == 1 else [f"{surface['name']} {k}" for k in range(len(boxes))]
        return [(n, b, bilinear(shape["corners"], b)) for n, b in zip(names, boxes, strict=True)]
    whole = (0.0, 0.0, 1.0, 1.0)
    make = {"torus": torus, "sphere": sphere, "bezier": bezier}[shape["type"]]
    return [(surface["name"], whole, make(shape))]


def around(holes):
    """Boxes that cover the unit square without the holes."""
    if not holes:
        return [(0.0, 0.0, 1.0, 1.0)]
    lines_u = sorted({0.0, 1.0, *(h[0] for h in holes), *(h[2] for h in holes)})
    boxes = []
    for u0, u1 in zip(lines_u, lines_u[1:], strict=False):
        v = 0.0
        for h in sorted((h for h in holes if h[0] < u1 - 1e-9 and h[2] > u0 + 1e-9), key=lambda h: h[1]):
            boxes.append((u0, v, u1, h[1]))
            v = h[3]
        boxes.append((u0, v, u1, 1.0))
    return [b for b in boxes if b[3] - b[1] > 1e-9]


def bilinear(corners, box):
    """The part of a bilinear surface (corners at uv 00, 10, 11, 01) over a uv box, as degree 1 x 1."""
    c = np.array(corners)

    def S(u, v):
        return c[0] * (1 - u) * (1 - v) + c[1] * u * (1 - v) + c[2] * u * v + c[3] * (1 - u) * v

    u0, v0, u1, v1 = box
    P = [[S(u0, v0), S(u0, v1)], [S(u1, v0), S(u1, v1)]]
    return nurbs(1, 1, [0, 0, 1, 1], [0, 0, 1, 1], P, np.ones((2, 2)))


def torus(shape):
    """R, r, axis: p runs along u, q along v."""
    w = np.array(shape["axis"]) / np.linalg.norm(shape["axis"])
    a = np.cross(w, (0, 0, 1.0))
    a /= np.linalg.norm(a)
    b = np.cross(w, a)
    ring = CIRCLE[:, :1] * a + CIRCLE[:, 1:] * b
    reach = shape["R"] + shape["r"] * CIRCLE[:, 0]
    P = (
        np.array(shape["centre"])
        + ring[:, None] * reach[None, :, None]
        + (shape["r"] * CIRCLE[:, 1])[None, :, None] * w
    )
    return nurbs(2, 2, CIRCLE_KNOTS, CIRCLE_KNOTS, P, np.outer(CIRCLE_W, CIRCLE_W))


def sphere(shape):
    """d = (sin q cos p, -cos q, -sin q sin p): p along u, q from the lower pole along v."""
    profile = np.array([(0, -1), (1, -1), (1, 0), (1, 1), (0, 1)], dtype=float)
    w = np.array([1, np.sqrt(0.5), 1, np.sqrt(0.5), 1.0])
    ring = np.stack([CIRCLE[:, 0], np.zeros(9), -CIRCLE[:, 1]], axis=1)
    P = ring[:, None] * profile[None, :, :1] + profile[None, :, 1:] * np.array([0, 1.0, 0])
    P = np.array(shape["centre"]) + shape["r"] * P
    return nurbs(2, 2, CIRCLE_KNOTS, [0, 0, 0, 0.5, 0.5, 1, 1, 1], P, np.outer(CIRCLE_W, w))


def bezier(shape):
    """4 x 4 control points [u][v]."""
    P = np.array(shape.get("points", shape.get("control_points", shape.get("P"))))
    return nurbs(3, 3, [0] * 4 + [1] * 4, [0] * 4 + [1] * 4, P, np.ones((4, 4)))


def nurbs(degree_u, degree_v, knots_u, knots_v, P, w):
    """The `nurbs` entry of a scene.yaml."""
    return {
        "degree_u": degree_u,
        "degree_v": degree_v,
        "knots_u": [float(k) for k in knots_u],
        "knots_v": [float(k) for k in knots_v],
        "points": np.asarray(P).tolist(),
        "weights": np.asarray(w).tolist(),
    }


def write_scene(name, folder, bake):
    """Write the scene `name` as a folder with a scene.yaml; bake: its settings."""
    data = json.loads((HERE / "reference" / name / "scene.json").read_text())
    geometry, materials, overrides = [], {}, {}
    for surface in data["surfaces"]:
        material = {"reflectance": surface["rho"]}
        if max(surface["emission"]) > 0:
            material["emission"] = [float(np.pi * e) for e in surface["emission"]]  # the file gives radiance
        materials[f"m {surface['name']}"] = material
        for piece, _, shape in pieces(surface):
            geometry.append({"name": piece, "nurbs": shape, "material": f"m {surface['name']}"})
            if surface["flip"]:
                overrides[piece] = {"flip": True}
    units = "m" if data["units"] == "metres" else "mm"
    scene = {
        "units": units,
        "up": "y",
        "geometry": geometry,
        "materials": materials,
        "surfaces": overrides,
        "bake": bake,
    }
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.yaml").write_text(yaml.safe_dump(scene, sort_keys=False))


def angle_to_parameter(turn):
    """Parameter of the rational circle at `turn` full turns: inverse of the quarter arc's rational quadratic."""
    quarter = np.minimum(np.floor(turn * 4), 3)
    t = np.tan((turn * 4 - quarter) * np.pi / 4)  # of half the angle
    # cos = ((1-x)^2 + sqrt2 x(1-x)) / w, sin = (x^2 + sqrt2 x(1-x)) / w give t = x / (x + sqrt2 (1 - x)); solved for x
    x = np.sqrt(2) * t / (1 + (np.sqrt(2) - 1) * t)
    return (quarter + x) / 4


def points_on_pieces(name):
    """Reference points as (piece names (k,), parameters (k, 2) of those pieces, irradiance E, se (k, 3))."""
    folder = HERE / "reference" / name
    data = json.loads((folder / "scene.json").read_text())
    points, truth = np.load(folder / "points.npz"), np.load(folder / "reference.npz")
    names, uv = np.empty(len(points["uv"]), dtype=object), points["uv"].astype(float).copy()
    for index, surface in enumerate(data["surfaces"]):
        mine = np.flatnonzero(points["surface"] == index)
        parts = pieces(surface)
        kind = surface["shape"]["type"]
        if kind == "torus":
            uv[mine] = angle_to_parameter(uv[mine] % 1.0)
        elif kind == "sphere":
            uv[mine, 0] = angle_to_parameter(uv[mine, 0] % 1.0)
            uv[mine, 1] = angle_to_parameter(uv[mine, 1] / 2) * 2
        for piece, (u0, v0, u1, v1), _ in parts:
            inside = mine[((uv[mine] >= (u0 - 1e-9, v0 - 1e-9)) & (uv[mine] <= (u1 + 1e-9, v1 + 1e-9))).all(axis=1)]
            names[inside] = piece
            if len(parts) > 1:
                uv[inside] = (uv[inside] - (u0, v0)) / (u1 - u0, v1 - v0)
                mine = np.setdiff1d(mine, inside)
    return names, np.clip(uv, 0, 1), truth["E"].astype(float), truth["se"].astype(float)


def shares_of_area(name):
    """Share of the scene's area that each reference point stands for: that of its surface, over its points.  (k,)."""
    folder = HERE / "reference" / name
    data, mesh = json.loads((folder / "scene.json").read_text()), np.load(folder / "mesh.npz")
    a, b, c = np.moveaxis(mesh["V"][mesh["F"]].astype(float), 1, 0)
    face = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    area = np.array([face[s["face_begin"] : s["face_end"]].sum() for s in data["surfaces"]])
    of = np.load(folder / "points.npz")["surface"]
    share = (area / np.maximum(np.bincount(of, minlength=len(area)), 1))[of]
    return share / share.sum()
