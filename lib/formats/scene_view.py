"""Where the camera of scene.yaml stands, in the axes of what is exported."""

from lib.formats.quantities import METRES
from lib.report import camera as cameras


def scene_camera(given, settings):
    """The camera of scene.yaml, in its units and up axis, as one in metres with y up."""
    unit = METRES[settings.get("units", "m")]

    def place(p):
        x, y, z = (float(c) * unit for c in p)
        return (x, y, z) if settings.get("up", "z") == "y" else (x, z, -y)

    return cameras.Camera(place(given["eye"]), place(given["target"]), float(given.get("fov", 50)))
