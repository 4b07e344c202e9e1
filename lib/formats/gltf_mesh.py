"""Triangle meshes of a glTF 2.0 file (.glb, .gltf), one surface for each placed primitive.

Nodes are placed as the file says, in its own axes: y is up, lengths are metres.  Skins and morph targets stay in their
bind pose.  Source: Khronos, glTF 2.0 specification, sections 3.5 and 3.7.
"""

from collections import Counter
from functools import partial

import numpy as np

from lib.formats import names
from lib.formats.gltf_buffers import Broken, Container, dicts, numbers
from lib.formats.gltf_materials import Materials, table
from lib.formats.mistakes import listed
from lib.formats.patches import MAX_PATCHES, GeometryFile, Patch, is_selected
from lib.surfaces.mesh import Flat, Mesh
from lib.surfaces.mesh_build import Dropped, mesh

PACKED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
UNDERSTOOD = {
    "KHR_materials_unlit", "KHR_materials_emissive_strength", "KHR_texture_transform", "KHR_mesh_quantization",
    "KHR_materials_pbrSpecularGlossiness", "EXT_texture_webp", "KHR_lights_punctual",
}  # fmt: skip
LIGHT, SKIN = "light (KHR_lights_punctual)", "skin: its bind pose is taken"
PLACED_TOO = "EXT_mesh_gpu_instancing"
PLURAL = {
    "camera": "cameras", LIGHT: "lights (KHR_lights_punctual)", SKIN: "skins: their bind pose is taken",
    "animation": "animations", "set of lines or points": "sets of lines or points",
    "set of morph targets": "sets of morph targets",
}  # fmt: skip
MAX_DEPTH = 1000  # names above a node
TRIANGLES, STRIP, FAN = 4, 5, 6
RIGID = 6  # digits of a placement's lengths and angles within which two copies are of one shape


def read(data, report, only=None, folder="."):
    """Read the bytes of a .glb or .gltf as a GeometryFile; mistakes go to `report` (see patches).

    only : pattern of nodes, meshes, materials or numbers
    folder : where the file lies, for buffers and pictures beside it
    """
    try:
        container = Container(data, folder)
        _refuse_extensions(container)
        placed, skipped = _placed(container)
        report.total = total = len(placed)
        if not placed:
            raise Broken("holds no triangles")
        if total > MAX_PATCHES:
            raise Broken(f"{total} placed meshes; allowed: at most {MAX_PATCHES}")
        return _content(container, placed, skipped, report, only)
    except Broken as error:
        report.fatal(str(error))
    except TypeError:  # a list where a number belongs, and the like
        report.fatal("is not built as glTF 2.0 asks: a value is of another kind")


def _content(container, placed, skipped, report, only):
    materials = Materials(container)
    shapes = _Shapes(container, materials)
    patches, seen = [], {}
    total = len(placed)
    for number, (mesh_index, k, primitive, labels, M) in enumerate(placed, 1):
        material = primitive.get("material")
        name = None if material is None else materials.name(material)
        labels = tuple(dict.fromkeys([*labels, *([name] if name else []), str(number), names.padded(number, total)]))
        seen.update(dict.fromkeys(labels[:-1]))
        if not is_selected(labels, only):
            continue
        made = report.surface(partial(shapes.placed, mesh_index, k, primitive, M), number)
        if made is None:
            continue
        if "COLOR_0" in table(primitive, "attributes"):
            report.coloured.append(report.of(number))
        surface, shape = made
        patches.append(Patch(number, surface, labels=labels, material=name, shape=shape))
    if not patches and not len(report.mistakes):
        if only is None or report.flat:
            report.add("no triangle has an area")
        else:
            report.add(f"nothing matches '{only}'; nodes, meshes and materials: {listed(seen)}", field="only")
    used = {patch.material for patch in patches}
    kept = {name: found for name, found in materials.made.items() if name in used}
    named = [found.get(field, "") for found in kept.values() for field in ("texture", "emission_texture")]
    keys = {written.removeprefix("embedded:") for written in named}
    parts = [f"{n} {what if n == 1 else PLURAL.get(what, what)}" for what, n in sorted(skipped.items())]
    notes = [f"skipped: {', '.join(parts)}"] if parts else []
    notes += report.notes() + shapes.dropped.sentences() + materials.notes() + container.files.notes()
    return GeometryFile(
        patches, total, 1.0, notes, materials=kept, up="y",
        pictures={key: data for key, data in materials.pictures.items() if key in keys},
    )  # fmt: skip


def _refuse_extensions(container):
    used, required = ([x for x in container.json.get(key, []) if isinstance(x, str)] for key in
                      ("extensionsUsed", "extensionsRequired"))  # fmt: skip
    for name in PACKED:
        if name in required or name in used:
            raise Broken(f"is compressed with {name}, which is not read; export it without compression")
    if PLACED_TOO in used:
        raise Broken(f"places copies with {PLACED_TOO}, which is not read; export them as nodes")
    strange = [name for name in required if name not in UNDERSTOOD and not name.startswith("KHR_materials_")]
    if strange:
        raise Broken(f"needs {listed(strange)}, which is not read")


def _placed(container):
    """Primitives with triangles as the scene's nodes place them: list of (mesh, k, primitive, labels, M (4, 4)) in the
    order of the nodes, and a Counter of what is passed over.
    """
    nodes, skipped, placed = container.items("nodes"), Counter(), []
    scenes = container.items("scenes")
    if scenes:
        roots = container.item("scenes", container.json.get("scene", 0)).get("nodes", [])
    else:
        below = {child for node in nodes for child in _indices(node.get("children", []), "children")}
        roots = [k for k in range(len(nodes)) if k not in below]
    left = [(index, np.eye(4), ()) for index in reversed(_indices(roots, "nodes of the scene"))]
    visited = set()
    while left:
        index, above, path = left.pop()
        node = container.item("nodes", index)
        if index in visited or len(path) > MAX_DEPTH:
            raise Broken(f"nodes[{index}] stands twice in the scene, or too deep: nodes form a tree")
        visited.add(index)
        M = above @ _matrix(node)
        path = (*path, node["name"]) if isinstance(node.get("name"), str) and node["name"] else path
        children = _indices(node.get("children", []), "children")
        left += [(child, M, path) for child in reversed(children)]
        skipped["camera"] += "camera" in node
        skipped[LIGHT] += "KHR_lights_punctual" in table(node, "extensions")
        skipped[SKIN] += "skin" in node
        if "mesh" in node:
            found = container.item("meshes", node["mesh"])
            labels = (*reversed(path), *([found["name"]] if isinstance(found.get("name"), str) else []))
            for k, primitive in enumerate(dicts(found.get("primitives", []), "primitives")):
                if primitive.get("mode", TRIANGLES) in (TRIANGLES, STRIP, FAN):
                    placed.append((node["mesh"], k, primitive, labels, M))
                else:
                    skipped["set of lines or points"] += 1
                skipped["set of morph targets"] += bool(primitive.get("targets"))
    skipped["animation"] += len(container.items("animations"))
    return placed, +skipped


def _indices(values, what):
    if not isinstance(values, list) or not all(isinstance(v, int) and not isinstance(v, bool) for v in values):
        raise Broken(f"{what}: expected a list of whole numbers")
    return values


def _matrix(node):
    """The (4, 4) placement of a node in the one above."""
    if "matrix" in node:
        return numbers(node, "matrix", 16, None).reshape(4, 4).T
    x, y, z, w = q = numbers(node, "rotation", 4, [0.0, 0.0, 0.0, 1.0])
    n = q @ q
    if not n > 0:
        raise Broken("rotation: a quaternion of length 0")
    s = 2 / n
    M = np.eye(4)
    M[:3, :3] = [
        [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
    ]
    M[:3, :3] *= numbers(node, "scale", 3, [1.0] * 3)
    M[:3, 3] = numbers(node, "translation", 3, [0.0] * 3)
    return M


class _Shapes:
    """Primitives as meshes in their own axes, each built once; `dropped` sums up over those."""

    def __init__(self, container, materials):
        self.container, self.materials, self.dropped, self._made = container, materials, Dropped(), {}

    def placed(self, mesh_index, k, primitive, M):
        """(Mesh, shape) of primitive k of a mesh in the place M, see `_moved`; ValueError as mesh_build.mesh."""
        return _moved(self._mesh(mesh_index, k, primitive), M, f"{mesh_index}.{k}")

    def _mesh(self, mesh_index, k, primitive):
        key = mesh_index, k
        if key not in self._made:
            try:
                self._made[key], dropped = self._build(primitive)
                self.dropped += dropped
            except Broken as error:
                raise Broken(f"meshes[{mesh_index}].primitives[{k}]: {error}") from None
            except ValueError as error:
                self._made[key] = error
        if isinstance(self._made[key], ValueError):
            raise self._made[key]
        return self._made[key]

    def _build(self, primitive):
        material = primitive.get("material")
        attributes, read = table(primitive, "attributes"), self.container.accessor
        if "POSITION" not in attributes:
            raise Broken("has no POSITION")
        V = read(attributes["POSITION"], 3)
        index = read(primitive["indices"], 0) if "indices" in primitive else np.arange(len(V))
        if len(index) and index.max() >= len(V):
            raise Broken(f"an index is {index.max()}; there are {len(V)} positions")
        F = _triangles(index, primitive.get("mode", TRIANGLES))
        N = read(attributes["NORMAL"], 3) if "NORMAL" in attributes else None
        wanted = self.materials.coordinates(material)
        which, change = wanted or (0, np.eye(2, 3))
        T = read(attributes[f"TEXCOORD_{which}"], 2) if f"TEXCOORD_{which}" in attributes else None
        if any(len(a) != len(V) for a in (N, T) if a is not None):
            raise Broken("its attributes differ in length")
        if T is not None:
            if not (np.abs(T) < 1e30).all():
                raise Broken("a texture coordinate is not finite")
            T = T @ change[:, :2].T + change[:, 2]
            if T.size and (T.min() < -1e-3 or T.max() > 1 + 1e-3):
                self.materials.note_outside(material)
            T = np.stack([T[:, 0], 1.0 - T[:, 1]], axis=1)[F]
        elif wanted is not None:
            self.materials.note_unplaced(material)
            T = np.zeros((len(F), 3, 2))
        return mesh(V, F, None if N is None else N[F], T)


def _triangles(index, mode):
    """(m, 3) triangles of a list, strip or fan of vertices."""
    if mode == TRIANGLES:
        return index[: len(index) // 3 * 3].reshape(-1, 3)
    n = max(len(index) - 2, 0)
    k = np.arange(n)
    if mode == STRIP:
        return np.stack([index[k], index[k + 1 + k % 2], index[k + 2 - k % 2]], axis=1)
    return np.stack([index[k + 1], index[k + 2], index[np.zeros(n, dtype=np.int64)]], axis=1)


def _moved(local, M, key):
    """A mesh moved by M (4, 4), and its shape: equal for copies that differ by a rigid motion only.

    A placement that mirrors turns the winding of the triangles, so that their lit side stays outside.
    """
    A = M[:3, :3]
    mirrored = np.linalg.det(A) < 0
    if not np.linalg.matrix_rank(A) == 3:
        raise Flat("triangles: flattened by the placement")
    V = local.V @ A.T + M[:3, 3]
    if not (np.abs(V) <= 1e100).all():
        raise ValueError("positions: beyond 1e100")
    N = local.N @ np.linalg.inv(A)
    N /= np.linalg.norm(N, axis=2)[..., None]
    turn = [0, 2, 1] if mirrored else [0, 1, 2]
    T = None if local.T is None else local.T[:, turn]
    lengths = A.T @ A
    scale = np.sqrt(np.trace(lengths) / 3)
    form = np.round(lengths / scale**2, RIGID) + 0.0
    shape = f"{key} {'mirrored ' if mirrored else ''}{scale:.{RIGID}g} {form[np.triu_indices(3)].tolist()}"
    return Mesh(V, np.ascontiguousarray(local.F[:, turn]), np.ascontiguousarray(N[:, turn]), T), shape
