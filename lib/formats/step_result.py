"""Faces of a STEP or IGES file as arrays: what the converter's process hands back.

A shape is a part as the file defines it; an instance is a place where it stands.
"""

from dataclasses import dataclass, field, fields

import numpy as np

from lib.formats import artefact
from lib.nurbs.surface import NurbsSurface

KIND, VERSION = "step_faces", 2
MAX_FACES = 1_000_000  # of all shapes
COUNTERS = ("face_first", "pole_first", "knot_first", "loop_first", "use_first", "uv_first", "edge_first")


@dataclass(frozen=True)
class StepFaces:
    """Of f faces of s shapes, with e edges, l loops and m uses of edges by loops.

    face_first : (s + 1,) first face of each shape;  body : (f,) faces of one solid or shell have the same number
    is_solid, is_trimmed, is_reversed : (f,) bool; reversed against S_u x S_v
    colour : (f,) index into `colours`, the face's or its solid's own, -1 without;  colours : (c, 3) linear RGB
    gap : (f,) largest distance of the edges' points from the surface at their (u, v) [size of the face]
    degree, count : (f, 2) in u, v, zero where the face could not be converted
    knots : all of a face's knots_u, then knots_v, from knot_first (f + 1,);  Pw : (., 4) rows of a face from pole_first
    loop_first : (f + 1,) loops of a face;  use_first : (l + 1,) uses of a loop;  edge : (m,) the edge of a use
    is_backward : (m,) bool, the use runs against its edge;  uv : (., 2) points of a use along the edge itself, in the
        surface's [0, 1]^2, from uv_first (m + 1,), as many as the edge has points
    S : (., 3) points of an edge from edge_first (e + 1,);  a pole is an edge of equal points
    see_through : indices of colours that the file has as such
    shapes : s names;  kinds : f names of kinds of surfaces
    instances : dicts, shape (index), matrix (12 numbers, rows of 3 x 4), labels (list of texts), colour (index, or -1)
    failed : {face: why} of faces without a surface;  notes : list of texts
    """

    face_first: np.ndarray
    body: np.ndarray
    is_solid: np.ndarray
    is_trimmed: np.ndarray
    is_reversed: np.ndarray
    colour: np.ndarray
    colours: np.ndarray
    gap: np.ndarray
    degree: np.ndarray
    count: np.ndarray
    knot_first: np.ndarray
    knots: np.ndarray
    pole_first: np.ndarray
    Pw: np.ndarray
    loop_first: np.ndarray
    use_first: np.ndarray
    edge: np.ndarray
    is_backward: np.ndarray
    uv_first: np.ndarray
    uv: np.ndarray
    edge_first: np.ndarray
    S: np.ndarray
    see_through: list
    shapes: list
    kinds: list
    instances: list
    failed: dict
    notes: list

    def surface(self, face):
        """The NurbsSurface of a face; ValueError as it."""
        (p, q), (n, m) = self.degree[face].tolist(), self.count[face].tolist()
        knots = self.knots[self.knot_first[face] : self.knot_first[face + 1]]
        Pw = self.Pw[self.pole_first[face] : self.pole_first[face + 1]].reshape(n, m, 4)
        return NurbsSurface(p, q, knots[: n + p + 1], knots[n + p + 1 :], Pw)


@dataclass
class Face:
    """One face on its way into StepFaces; the fields are as there.

    surface : NurbsSurface, or None and `why`
    loops : lists of (edge of the shape, is_backward, uv (k, 2) along the edge)
    """

    body: int
    is_solid: bool
    is_reversed: bool
    colour: int
    kind: str
    is_trimmed: bool = False
    gap: float = 0.0
    surface: NurbsSurface | None = None
    loops: list = field(default_factory=list)
    why: str = ""


def packed(shapes, colours, see_through, instances, notes):
    """StepFaces of shapes, a list of (name, list of Face, list of edges' points (k, 3)); bodies count on per shape."""
    faces = [face for _, those, _ in shapes for face in those]
    made = [face.surface for face in faces]
    uses = [use for face in faces for loop in face.loops for use in loop]
    edges = [S for _, _, those in shapes for S in those]
    first_edge = np.repeat(_first([len(those) for *_, those in shapes])[:-1], [_uses(those) for _, those, _ in shapes])
    first_body = _first([max((face.body + 1 for face in those), default=0) for _, those, _ in shapes])
    counts = [len(those) for _, those, _ in shapes]
    knots = [a for s in made if s for a in (s.knots_u, s.knots_v)]
    return StepFaces(
        face_first=_first(counts),
        body=np.array([face.body for face in faces], dtype=np.int64) + np.repeat(first_body[:-1], counts),
        is_solid=np.array([face.is_solid for face in faces], dtype=bool),
        is_trimmed=np.array([face.is_trimmed for face in faces], dtype=bool),
        is_reversed=np.array([face.is_reversed for face in faces], dtype=bool),
        colour=np.array([face.colour for face in faces], dtype=np.int64),
        colours=np.array(colours, dtype=np.float64).reshape(-1, 3),
        gap=np.array([face.gap for face in faces], dtype=np.float64),
        degree=np.array([(s.degree_u, s.degree_v) if s else (0, 0) for s in made], dtype=np.int64).reshape(-1, 2),
        count=np.array([s.Pw.shape[:2] if s else (0, 0) for s in made], dtype=np.int64).reshape(-1, 2),
        knot_first=_first([s.knots_u.size + s.knots_v.size if s else 0 for s in made]),
        knots=np.concatenate([np.zeros(0), *knots]),
        pole_first=_first([s.Pw[..., 0].size if s else 0 for s in made]),
        Pw=np.concatenate([np.zeros((0, 4)), *(s.Pw.reshape(-1, 4) for s in made if s)]),
        loop_first=_first([len(face.loops) for face in faces]),
        use_first=_first([len(loop) for face in faces for loop in face.loops]),
        edge=first_edge + np.array([use[0] for use in uses], dtype=np.int64),
        is_backward=np.array([use[1] for use in uses], dtype=bool),
        uv_first=_first([len(use[2]) for use in uses]),
        uv=np.concatenate([np.zeros((0, 2)), *(use[2] for use in uses)]),
        edge_first=_first([len(S) for S in edges]),
        S=np.concatenate([np.zeros((0, 3)), *edges]),
        see_through=see_through,
        shapes=[name for name, *_ in shapes],
        kinds=[face.kind for face in faces],
        instances=instances,
        failed={str(k): face.why for k, face in enumerate(faces) if face.surface is None},
        notes=notes,
    )


def _first(counts):
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])


def _uses(faces):
    return sum(len(loop) for face in faces for loop in face.loops)


FLAGS = ("is_solid", "is_trimmed", "is_reversed", "is_backward")
NUMBERS = ("body", "colour", "degree", "count", "edge")
WORDS = ("see_through", "shapes", "kinds", "instances", "failed", "notes")
ARRAYS = [item.name for item in fields(StepFaces) if item.name not in WORDS]


def check(x):
    """Raise ValueError naming the field that breaks the contract."""
    f, ends = len(x.body), {"loop_first": len(x.use_first) - 1, "use_first": len(x.edge), "edge_first": len(x.S)}
    ends |= {"face_first": f, "pole_first": len(x.Pw), "knot_first": len(x.knots), "uv_first": len(x.uv)}
    for name in COUNTERS:
        a = getattr(x, name)
        _hold(a.ndim == 1 and a.dtype.kind in "iu" and len(a) > 0, name, "no list of whole numbers")
        _hold(a[0] == 0 and (np.diff(a) >= 0).all() and a[-1] == ends[name], name, "does not count what there is")
    for name in FLAGS + NUMBERS:
        _hold(getattr(x, name).dtype.kind in ("b" if name in FLAGS else "iu"), name, "of another type")
    for name in (*FLAGS[:3], "body", "colour", "gap"):
        _hold(getattr(x, name).shape == (f,), name, "not one for each face")
    _hold(f <= MAX_FACES and (x.body >= 0).all() and (x.body < max(f, 1)).all(), "body", "no such body")
    for name in ("pole_first", "knot_first", "loop_first"):
        _hold(len(getattr(x, name)) == f + 1, name, "not one for each face")
    for name, columns in (("colours", 3), ("degree", 2), ("count", 2), ("Pw", 4), ("uv", 2), ("S", 3)):
        a = getattr(x, name)
        _hold(a.ndim == 2 and a.shape[1] == columns and np.isfinite(a).all(), name, f"not finite rows of {columns}")
    _hold(len(x.degree) == len(x.count) == len(x.kinds) == f, "kinds", "not one for each face")
    for name in ("gap", "knots"):
        _hold(getattr(x, name).ndim == 1 and np.isfinite(getattr(x, name)).all(), name, "NaN or Inf")
    _hold(((x.colours >= 0) & (x.colours <= 1)).all(), "colours", "outside [0, 1]")
    _hold(((x.colour >= -1) & (x.colour < len(x.colours))).all(), "colour", "no such colour")
    _hold(all(k in range(len(x.colours)) for k in x.see_through), "see_through", "no such colour")
    _hold(x.is_backward.shape == x.edge.shape == (len(x.uv_first) - 1,), "uv_first", "not one for each use")
    _hold(((x.edge >= 0) & (x.edge < len(x.edge_first) - 1)).all(), "edge", "no such edge")
    _hold((np.diff(x.uv_first) == np.diff(x.edge_first)[x.edge]).all(), "uv", "not one for each point of the edge")
    (p, q), (n, m) = x.degree.T, x.count.T
    _hold((np.diff(x.pole_first) == n * m).all(), "Pw", "not as many as counted")
    _hold((np.diff(x.knot_first) == np.where(n > 0, n + p + 1 + m + q + 1, 0)).all(), "knots", "not as many as counted")
    _hold(len(x.face_first) == len(x.shapes) + 1, "shapes", "not as many as counted")
    missing = {str(face) for face in np.flatnonzero(n == 0)}
    _hold(set(x.failed) == missing, "failed", "not the faces without a surface")
    for instance in x.instances:
        _hold(0 <= instance["shape"] < len(x.shapes), "instances", "no such shape")
        _hold(-1 <= instance["colour"] < len(x.colours), "instances", "no such colour")
        matrix = np.asarray(instance["matrix"], dtype=np.float64)
        _hold(matrix.shape == (12,) and np.isfinite(matrix).all(), "instances", "no finite matrix")
        _hold(_are_texts(instance["labels"]), "instances", "labels that are no texts")
    for name in ("shapes", "kinds", "notes"):
        _hold(_are_texts(getattr(x, name)), name, "no list of texts")


def _are_texts(found):
    return isinstance(found, list) and all(isinstance(text, str) for text in found)


def _hold(is_so, name, what):
    if not is_so:
        raise ValueError(f"step_faces: {name}: {what}")


def save(path, x):
    """Write the faces."""
    check(x)
    arrays = {name: np.asarray(getattr(x, name)) for name in ARRAYS}
    artefact.write(path, KIND, VERSION, {name: getattr(x, name) for name in WORDS}, arrays)


def load(path):
    """Read the faces; ArtefactError names what is wrong with them."""
    header, arrays = artefact.read(path, KIND, VERSION)
    try:
        x = StepFaces(**{name: arrays[name] for name in ARRAYS}, **{name: header[name] for name in WORDS})
        check(x)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise artefact.ArtefactError(f"{path}: damaged ({error})") from error
    return x
