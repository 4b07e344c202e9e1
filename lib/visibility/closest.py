"""Closest points of a triangle mesh, by open3d (this module is its one importer).

For distances between meshes. Rays are cast by lib.visibility.tracer, which starts faster.

The compiled core of open3d is loaded past the package's own `__init__`, which imports its viewers, its plots and the
machine learning add-ons: 0.46 s instead of 1.03 s (measured, version 0.20, warm files).
"""

import importlib
import importlib.util
import sys
import types
from dataclasses import dataclass

import numpy as np

from lib.visibility.framing import framed


@dataclass(frozen=True)
class Mesh:
    """A mesh prepared for queries: float32 copy, centred and scaled to side 1 in float64 before (`centre`, `scale`)."""

    V: np.ndarray  # (n_v, 3) float64, as given
    F: np.ndarray  # (n_f, 3) int64
    centre: np.ndarray  # (3,)
    scale: float
    handle: object  # open3d RaycastingScene, None for a mesh without triangles


def prepare(V, F):
    """Build the search tree of a mesh.

    V : (n_v, 3) float64, any unit. F : (n_f, 3) int, n_f = 0 allowed: nothing is hit then.
    Raises ValueError on another shape, a non-finite vertex or an index out of range.
    """
    V, F, centre, scale = framed(V, F)
    if not len(F):
        return Mesh(V, F, centre, scale, None)
    core, geometry = _open3d()
    handle = geometry.RaycastingScene()
    handle.add_triangles(core.Tensor(((V - centre) / scale).astype(np.float32)), core.Tensor(F.astype(np.uint32)))
    return Mesh(V, F, centre, scale, handle)


def closest(mesh, points):
    """The closest point of a mesh to each point.

    points : (n, 3) float64, in the unit of V.
    Returns distance (n,), face (n,) int64, weight (n, 3): open3d finds the face in float32, the distance is taken to
    the point of that face in float64, so it is exact to about 1e-7 of the size of the mesh.
    Raises ValueError where the mesh has no triangle.
    """
    if mesh.handle is None:
        raise ValueError("no triangle to be close to")
    points = np.asarray(points, float).reshape(-1, 3)
    core, _ = _open3d()
    query = core.Tensor(((points - mesh.centre) / mesh.scale).astype(np.float32))
    found = mesh.handle.compute_closest_points(query)
    face = found["primitive_ids"].numpy().astype(np.int64)
    uv = found["primitive_uvs"].numpy().astype(float)
    weight = np.stack([1 - uv.sum(1), uv[:, 0], uv[:, 1]], axis=1)
    at = np.einsum("nk,nkx->nx", weight, mesh.V[mesh.F[face]])
    return np.linalg.norm(at - points, axis=1), face, weight


def _open3d():
    """(open3d.core, open3d.t.geometry) from the compiled module alone."""
    module = sys.modules.get("open3d.pybind")
    if module is None:
        spec = importlib.util.find_spec("open3d")
        if spec is None:
            raise ImportError("open3d is not installed")
        package = types.ModuleType("open3d")
        package.__path__ = list(spec.submodule_search_locations)
        package.__spec__ = spec
        sys.modules["open3d"] = package
        try:
            module = importlib.import_module("open3d.pybind")
        finally:
            del sys.modules["open3d"]  # an import of the whole package elsewhere still works
    return module.core, module.t.geometry
