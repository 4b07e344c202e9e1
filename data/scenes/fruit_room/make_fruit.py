"""Write the fruit, the bowl, the lamp and the duck of this room as geomdl JSON files, beside this script.

    python make_fruit.py

Needs numpy alone and writes the same bytes every time.  All lengths are metres, z is up.

Round things are surfaces of revolution about z: exact circles in u (rational quadratics of nine points, The NURBS Book,
A7.1), a cubic through given points (r, z) in v (A9.1 with end slopes).  The profile starts below on the axis and is
walked so that S_u x S_v points out of the solid.  First and last column are the same numbers, a pole is one point:
closed things are exactly closed.  The banana and the stems are sweeps: sections across an arc, tapering to a point at
both ends.  The duck is the point lists of duck1, duck2, duck3 with the knots of the program they belong to.

Each fruit touches z = 0 with its lowest point, near the origin; the duck keeps the coordinates of its files.
"""

import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
DIGITS = 7  # coordinates are rounded to 0.1 um, so that no machine's last bit reaches the files
HALF = np.sqrt(0.5)
CIRCLE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
CIRCLE_WEIGHTS = np.array([1, HALF, 1, HALF, 1, HALF, 1, HALF, 1])
CIRCLE_KNOTS = np.array([0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1])


# Profiles, in millimetres (r, z), from the lowest point of the axis to the last one.
# fmt: off
APPLE = [
    (0, 6), (7, 3.2), (15, 0), (25, 3.5), (34, 17), (37.5, 36), (34, 53), (24, 65), (14, 67.5), (5.5, 62), (0, 57.5),
]
PEAR = [
    (0, 4), (6, 2), (12, 0), (24, 5), (33, 20), (34.5, 34), (29, 52), (20.5, 68), (16, 82), (13.5, 93), (8, 99),
    (0, 100),
]
BOWL = [
    (0, 4), (30, 3.6), (41, 2.4), (46, 0), (51, 2), (53, 6), (68, 12), (100, 31), (122, 58), (130, 78),
    (129.5, 82), (126, 82.5), (122.5, 77), (113, 57), (92, 34), (62, 16), (30, 9.5), (0, 8.5),
]
SHADE = [(120, 26), (114, 36), (98, 52), (74, 74), (52, 100), (40, 124), (28, 140), (12, 147), (0, 148)]
LENS = [(0, 0), (32, 2), (64, 7.5), (94, 16), (120, 26)]
# (degrees along the arc, radius of the section [mm])
BANANA = [
    (-58, 0), (-58, 3.6), (-56, 4.4), (-52, 4.6), (-47, 6), (-40, 12.5), (-28, 16.5), (-12, 17.2), (6, 17.2),
    (22, 16.5), (34, 13.5), (42, 8.5), (46, 4.8), (48, 3.6), (48, 0),
]
# fmt: on


def cubic_through(points):
    """A clamped cubic B-spline through points (m, d): knots (m + 6,), control points (m + 2, d).

    Chord-length parameters, the interior knots at the parameters.  An end on the axis (first coordinate 0) leaves it
    level, so that a surface of revolution is smooth at its pole; any other end points along its chord.
    """
    points = np.asarray(points, dtype=float)
    m = len(points)
    chord = np.linalg.norm(np.diff(points, axis=0), axis=1)
    t = np.concatenate([[0.0], np.cumsum(chord)]) / chord.sum()
    knots = np.concatenate([np.zeros(3), t, np.ones(3)])
    A, right = np.zeros((m + 2, m + 2)), np.zeros((m + 2, points.shape[1]))
    for row, value in enumerate(t):
        A[row], right[row] = [bspline(knots, 3, k, value) for k in range(m + 2)], points[row]
    for row, (first, last) in enumerate(((0, 1), (-2, -1))):
        leg = points[last] - points[first]
        if points[(0, -1)[row], 0] == 0:
            leg = np.linalg.norm(leg) * np.array([np.sign(leg[0]), 0])
        A[m + row, [first, last]] = -1, 1
        right[m + row] = leg / 3
    return knots, np.linalg.solve(A, right)


def bspline(knots, degree, k, t):
    """Basis function N_k of the degree at t, by the definition (Cox, de Boor); the last one is 1 at the end."""
    if degree == 0:
        last = t >= knots[-1] and knots[k] < knots[k + 1] == knots[-1]
        return float(knots[k] <= t < knots[k + 1] or last)
    left, right = knots[k + degree] - knots[k], knots[k + degree + 1] - knots[k + 1]
    value = 0.0
    if left > 0:
        value += (t - knots[k]) / left * bspline(knots, degree - 1, k, t)
    if right > 0:
        value += (knots[k + degree + 1] - t) / right * bspline(knots, degree - 1, k + 1, t)
    return value


def revolve(profile, stand=True):
    """The surface of revolution of a profile [mm]: u round, v along the profile; lowered to z = 0 if it is to stand."""
    knots, rz = cubic_through(np.asarray(profile) / 1000)
    if stand:
        rz[:, 1] -= lowest(knots, rz[:, 1])
    rz = np.round(rz, DIGITS)
    points = np.empty((9, len(rz), 3))
    points[:, :, :2] = CIRCLE[:, None, :] * rz[None, :, :1]
    points[:, :, 2] = rz[:, 1]
    return surface(2, 3, CIRCLE_KNOTS, knots, points, CIRCLE_WEIGHTS[:, None] * np.ones(len(rz)))


def lowest(knots, z):
    """The least value of the cubic with control values z: sampled, then bisected to rounding."""

    def value(t):
        return float(np.dot([bspline(knots, 3, k, t) for k in range(len(z))], z))

    t = np.linspace(0, 1, 801)
    at = int(np.argmin([value(x) for x in t]))
    a, b = t[max(at - 1, 0)], t[min(at + 1, 800)]
    for _ in range(80):
        x, y = a + (b - a) / 3, b - (b - a) / 3
        a, b = (a, y) if value(x) < value(y) else (x, b)
    return value((a + b) / 2)


def rod(radius, length):
    """An open cylinder from the origin up z."""
    points = np.empty((9, 2, 3))
    points[:, :, :2] = CIRCLE[:, None, :] * radius
    points[:, :, 2] = [0, length]
    return surface(2, 1, CIRCLE_KNOTS, [0, 0, 1, 1], points, CIRCLE_WEIGHTS[:, None] * np.ones(2))


def sweep(centre, tangent, up, radius, section, section_knots, section_weights):
    """Sections (k, 2) scaled by radius (m,), laid across the path at centre (m, 3): u round, v along; cubic in v."""
    tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    first = np.cross(up, tangent)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(tangent, first)
    points = centre[None] + radius[None, :, None] * (
        section[:, 0, None, None] * first[None] + section[:, 1, None, None] * second[None]
    )
    m = len(centre)
    knots = np.concatenate([np.zeros(3), np.linspace(0, 1, m - 2), np.ones(3)])
    points = np.round(points, DIGITS)
    points[-1] = points[0]
    return surface(2, 3, section_knots, knots, points, section_weights[:, None] * np.ones(m))


def banana():
    """An arc of 105 degrees lying on its side, five soft edges, a stem at one end and a blunt tip at the other."""
    # Five rational quadratics round: corner weights cos 36 = 0.809 would make a circle, heavier ones make soft edges.
    corner = np.deg2rad(18 + 36 * np.arange(11))
    reach = np.where(np.arange(11) % 2 == 1, 1 / np.cos(np.deg2rad(36)), 1.0)
    section = np.stack([reach * np.cos(corner), reach * np.sin(corner)], axis=1)
    section[-1] = section[0]
    weights = np.where(np.arange(11) % 2 == 1, 1.15, 1.0)
    knots = np.concatenate([[0, 0, 0], np.repeat([0.2, 0.4, 0.6, 0.8], 2), [1, 1, 1]])
    angle, radius = np.deg2rad([a for a, _ in BANANA]), np.array([r for _, r in BANANA]) / 1000
    arc = 0.098  # radius of the middle line
    zero = np.zeros_like(angle)
    centre = arc * np.stack([np.sin(angle), 1 - np.cos(angle), zero], axis=1)
    tangent = np.stack([np.cos(angle), np.sin(angle), zero], axis=1)
    shape = sweep(centre, tangent, np.array([0.0, 0, 1]), radius, section, knots, weights)
    return laid_down(shape, tilt=np.deg2rad(7))


def laid_down(shape, tilt):
    """Tilt a surface about x and let its lowest point touch z = 0 (to 0.1 um)."""
    points = np.array(shape["control_points"]["points"]).reshape(shape["size_u"], shape["size_v"], 3)
    c, s = np.cos(tilt), np.sin(tilt)
    points = points @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    weights = np.array(shape["control_points"]["weights"]).reshape(points.shape[:2])
    z = grid(shape, points, weights, 321)[..., 2]
    points = np.round(points - [0, 0, z.min()], DIGITS)
    points[-1] = points[0]
    return surface(2, 3, shape["knotvector_u"], shape["knotvector_v"], points, weights)


def grid(shape, points, weights, n):
    """Points of the surface on n x n parameters."""
    rows = []
    for degree, knots, count in ((shape["degree_u"], shape["knotvector_u"], shape["size_u"]),
                                 (shape["degree_v"], shape["knotvector_v"], shape["size_v"])):  # fmt: skip
        rows.append(np.array([[bspline(knots, degree, k, t) for k in range(count)] for t in np.linspace(0, 1, n)]))
    homogeneous = np.concatenate([points * weights[..., None], weights[..., None]], axis=2)
    S = np.einsum("ia,jb,abc->ijc", rows[0], rows[1], homogeneous)
    return S[..., :3] / S[..., 3:]


def stem(foot, height, lean, radius):
    """A bent stem about (0, 0, foot) [mm], leaning by lean at its upper end, thicker there; both ends closed."""
    t = np.array([0, 0, 0.15, 0.4, 0.7, 0.93, 1, 1])
    taper = np.array([0, 1, 1, 0.9, 0.95, 1.25, 1.25, 0])
    zero = np.zeros_like(t)
    centre = np.stack([lean * t**2, zero, foot + height * t], axis=1) / 1000
    tangent = np.stack([2 * lean * t, zero, height + zero], axis=1)
    return sweep(centre, tangent, np.array([0.0, 1, 0]), taper * radius / 1000, CIRCLE, CIRCLE_KNOTS, CIRCLE_WEIGHTS)


def duck():
    """Body, upper and lower beak from their point lists."""
    half_turn, turn = 1.5708, 3.14159
    body_u = [-half_turn] * 4 + [-1.0472, -0.523599, 0, 0.523599, 0.808217, 1.04015, 1.0472, 1.24824, 1.29714, 1.46148]
    body_v = [-turn] * 4 + [-2.61799, -2.0944, -1.0472, -0.523599, 6.66134e-016, 0.523599, 1.0472, 2.0944, 2.61799]
    upper_u = [0] * 4 + [0.145456, 0.265731, 0.436096, 0.583258, 0.847704] + [1] * 4
    upper_v = [0] * 4 + [0.179541, 0.317924, 0.485586, 0.507528, 0.709398, 0.813231] + [1] * 4
    lower = [0] * 4 + [0.333333, 0.666667] + [1] * 4
    weights = [float(w) for w in (HERE / "duck1.weights").read_text().replace("\n", ",").split(",") if w.strip()]

    def points(name, n_u, n_v):
        return np.array((HERE / name).read_text().split(), dtype=float).reshape(n_u, n_v, 3)

    return [
        surface(3, 3, body_u + [half_turn] * 4, body_v + [turn] * 4, points("duck1.ctrlpts", 14, 13),
                np.reshape(weights, (14, 13))),
        surface(3, 3, upper_u, upper_v, points("duck2.ctrlpts", 9, 10)),
        surface(3, 3, lower, lower, points("duck3.ctrlpts", 6, 6)),
    ]  # fmt: skip


def surface(degree_u, degree_v, knots_u, knots_v, points, weights=None):
    """One surface in geomdl's dictionary: points (n_u, n_v, 3) without weights multiplied in, v running fastest."""
    n_u, n_v, _ = points.shape
    data = {
        "type": "spline",
        "rational": weights is not None,
        "dimension": 3,
        "degree_u": degree_u,
        "degree_v": degree_v,
        "knotvector_u": [float(k) for k in knots_u],
        "knotvector_v": [round(float(k), 12) for k in knots_v],
        "size_u": n_u,
        "size_v": n_v,
        "control_points": {"points": (points.reshape(-1, 3) + 0.0).tolist()},
    }
    if weights is not None:
        data["control_points"]["weights"] = np.asarray(weights, dtype=float).ravel().tolist()
    return data


def write(name, *surfaces):
    """Write geomdl's JSON for one or more surfaces."""
    text = json.dumps(
        {"shape": {"type": "surface", "count": len(surfaces), "data": list(surfaces)}}, separators=(",", ":")
    )
    (HERE / name).write_text(text.replace("],[", "],\n[").replace('{"type"', '\n{"type"') + "\n", encoding="utf-8")


def main():
    """Write every file."""
    write("apple.json", revolve(APPLE), stem(54, 20, 5, 1.4))
    write("pear.json", revolve(PEAR), stem(97, 22, -7, 1.5))
    write("banana.json", banana())
    write("bowl.json", revolve(BOWL))
    write("shade.json", revolve(SHADE, stand=False))
    write("lens.json", revolve(LENS, stand=False))
    write("cord.json", rod(0.004, 1.025))
    write("table_leg.json", rod(0.03, 0.705))
    write("duck.json", *duck())


if __name__ == "__main__":
    main()
