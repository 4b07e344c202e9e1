"""Settings with their units resolved: bytes, metres, one form for every level of detail."""

from lib.formats.quantities import METRES, metres, n_bytes

FOV = 50.0


def resolve(settings, largest_side):
    """What the rules read: units, up, bake, budget [bytes], lods, export, camera [m] or None.

    settings : merged and checked, of a SceneFolder;  largest_side : of the scene's bounding box [m]
    lods : list of {"deviation": metres}, {"triangles": n} or {"share": of the finest level's triangles}
    """
    unit = settings["units"]
    bake = dict(settings["bake"])
    for key in ("tolerance", "convergence", "sag"):
        bake[key] = float(bake[key])
    export = dict(settings["export"])
    if export["exposure"] != "auto":
        export["exposure"] = float(export["exposure"])
    return {
        "units": unit,
        "up": settings["up"],
        "bake": bake,
        "budget": n_bytes(settings["budget"]),
        "lods": [_lod(lod, unit, largest_side) for lod in settings["lods"]],
        "export": export,
        "camera": _camera(settings.get("camera"), METRES[unit]),
    }


def _lod(lod, unit, largest_side):
    if not isinstance(lod, dict):
        return {"share": float(lod)}
    if "deviation" in lod:
        return {"deviation": metres(lod["deviation"], unit, largest_side)}
    return dict(lod)


def _camera(camera, metre):
    if camera is None:
        return None
    eye, target = ([x * metre for x in camera[key]] for key in ("eye", "target"))
    return {"eye": eye, "target": target, "fov": float(camera.get("fov", FOV))}
