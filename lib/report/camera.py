"""Cameras: the rays of a pinhole, and a sensible place for one where the scene names none. World y up."""

from dataclasses import dataclass

import numpy as np

from lib.report import picture

PROBE = (48, 30)  # rays across and down by which a place is judged
FINE = 240  # rays across by which the places where triangles meet are found
ZOOM = 0.4


@dataclass(frozen=True)
class Camera:
    """eye, target (3,) in metres, y up; fov: vertical angle of view in degrees, 0 < fov < 180."""

    eye: tuple
    target: tuple
    fov: float = 50.0

    def rays(self, width, height, top=0, below=None):
        """Rays through the pixel centres of rows top..below-1, row after row: origin (n, 3), direction (n, 3).

        The direction has length 1 along the axis of view. Raises ValueError where eye and target coincide.
        """
        eye = np.asarray(self.eye, float)
        forward = np.asarray(self.target, float) - eye
        length = np.linalg.norm(forward)
        if not length > 0:
            raise ValueError(f"camera: eye and target are the same point {tuple(self.eye)}")
        forward = forward / length
        up = np.array([0.0, 1.0, 0.0]) if abs(forward[1]) < 0.9999 else np.array([0.0, 0.0, -np.sign(forward[1])])
        right = np.cross(forward, up)
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        half = np.tan(np.radians(self.fov) / 2)
        rows = np.arange(top, height if below is None else below)
        y = half * (1 - 2 * (rows + 0.5) / height)
        x = half * width / height * (2 * (np.arange(width) + 0.5) / width - 1)
        direction = forward + x[None, :, None] * right + y[:, None, None] * up
        direction = direction.reshape(-1, 3)
        return np.broadcast_to(eye, direction.shape), direction

    def pixel(self, height):
        """Width of one of `height` rows of pixels, on a plane across the axis of view at the distance 1."""
        return 2 * np.tan(np.radians(self.fov) / 2) / height


def automatic(model, fov=50.0):
    """A camera that shows most of a model: inside where it is a room, outside where it is an object.

    Candidates stand near the corners and sides of the bounding box, at a little above half of its height, and all round
    it outside; each is judged by a coarse picture (`PROBE`): shares of the picture covered by faces seen from the
    front, how many parts are seen (square root of their shares, so that small objects count), nothing right before
    the lens.
    """
    V = model.mesh.V[np.unique(model.mesh.F)] if len(model.mesh.F) else np.zeros((1, 3))
    low, high = V.min(0), V.max(0)
    centre, extent = (low + high) / 2, np.maximum(high - low, 1e-9 * max((high - low).max(), 1e-300))
    best, best_score = None, -np.inf
    for eye, target, angle in _candidates(centre, extent, fov):
        camera = Camera(tuple(eye), tuple(target), angle)
        score = _score(model, camera, float(np.linalg.norm(extent)))
        if score > best_score + 1e-9:
            best, best_score = camera, score
    return best


def closer(model, camera, width, height):
    """A camera in the same place that looks at where most triangles meet, for comparing levels of detail.

    Of all windows of `ZOOM` of the picture's sides it takes the one with the most borders of triangles, coarsely;
    the given camera where none holds half of them.
    """
    w, h = FINE, round(FINE * height / width)
    origin, direction = camera.rays(w, h)
    face = picture.first_visible(model, origin, direction)[1].reshape(h, w)
    below = np.pad(picture.borders(face).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    m, n = round(ZOOM * h), round(ZOOM * w)
    inside = below[m:, n:] - below[:-m, n:] - below[m:, :-n] + below[:-m, :-n]
    top, left = np.unravel_index(np.argmax(inside), inside.shape)
    if inside[top, left] < below[-1, -1] / 2:
        return camera
    aim = direction.reshape(h, w, 3)[top + m // 2, left + n // 2]
    fov = 2 * np.degrees(np.arctan(ZOOM * np.tan(np.radians(camera.fov) / 2)))
    distance = np.linalg.norm(np.subtract(camera.target, camera.eye))
    return Camera(tuple(camera.eye), tuple(np.asarray(camera.eye) + distance * aim), float(fov))


def _candidates(centre, extent, fov):
    """(eye, target, fov) in a fixed order."""
    half = extent / 2
    for x, z in [(1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0)]:
        for depth in (0.86, 0.6):
            for lift in (0.15, -0.1):
                eye = centre + half * np.array([depth * x, lift, depth * z])
                yield eye, centre + half * np.array([-0.25 * x, -0.25, -0.25 * z]), fov + 10
    radius = np.linalg.norm(half)
    for x, z in [(0.5, 1), (-0.5, 1), (1, 0.5), (-1, 0.5), (0.5, -1), (-0.5, -1), (0, 1), (1, 0), (-1, 0), (0, -1)]:
        away = np.array([x, 0.4, z]) / np.linalg.norm([x, 0.4, z])
        yield centre + away * radius / np.sin(np.radians(fov - 12) / 2), centre, fov - 10


def _score(model, camera, size):
    w, h = PROBE
    origin, direction = camera.rays(w, h)
    t, face, _ = picture.first_visible(model, origin, direction)
    hit = face >= 0
    if not hit.any():
        return -1.0
    share = np.bincount(model.face_part[face[hit]], minlength=len(model.parts)) / (w * h)
    variety = np.sqrt(share).sum() / np.sqrt(max(1, min(len(model.parts), 40)))
    near = (hit & (t * np.linalg.norm(direction, axis=1) < 0.04 * size)).mean()
    depth = np.median(np.where(hit, t, 0)) / size
    return float(variety + 0.6 * hit.mean() + 0.5 * min(depth, 0.5) - 3 * near)
