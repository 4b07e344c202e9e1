"""The pictures of the report: the exported levels, drawn; the maps, small; and what the viewer needs."""

import tempfile
from pathlib import Path

import numpy as np

from lib.formats import exported, pictures
from lib.formats.quantities import METRES
from lib.formats.report_html import Pictures, Thumbnail
from lib.report import camera as cameras
from lib.report import charts, picture, surfaces, thumbnails

HERO, SMALL = (960, 600), (400, 250)  # pixels
MOST_THUMBNAILS = 160


def draw(bake, facts, settings):
    """Pictures of the levels and maps, and what the viewer shows."""
    view, near, levels, hero, documents, textures = None, None, [], None, [], {}
    given = settings.get("camera")
    for level in facts["levels"]:
        path = bake.folder / level["file"]
        parts, loaded = exported.load(path)
        model = picture.join(parts)
        if view is None:
            view = scene_camera(given, settings) if given else cameras.automatic(model)
            near = cameras.closer(model, view, *SMALL)
            hero = png(picture.render(model, loaded, view, *HERO))
        levels.append(tuple(png(shot) for shot in picture.render_with_edges(model, loaded, near, *SMALL)))
        inlined = exported.inlined(path)
        if inlined and documents is not None:
            documents.append(inlined[0])
            textures.update(inlined[1])
        else:
            documents = None
    shown = (
        {
            "levels": documents,
            "textures": textures,
            "camera": {"eye": list(view.eye), "target": list(view.target), "fov": view.fov},
        }
        if documents
        else None
    )
    return Pictures(hero, levels, map_thumbnails(bake, facts)), shown


def scene_camera(given, settings):
    """The camera of scene.yaml, in its units and up axis, as one in metres with y up."""
    unit = METRES[settings.get("units", "m")]

    def place(p):
        x, y, z = (float(c) * unit for c in p)
        return (x, y, z) if settings.get("up", "z") == "y" else (x, z, -y)

    return cameras.Camera(place(given["eye"]), place(given["target"]), float(given.get("fov", 50)))


def map_thumbnails(bake, facts):
    """{name: Thumbnail} of the largest maps of light."""
    if bake.textures is None:
        return {}
    light = bake.textures.light
    w, h = light.sizes()
    exposure = (
        facts["exposure"] / np.pi if facts["exposure"] else thumbnails.automatic_exposure(light.value[~light.hidden])
    )
    drawn = {}
    for k in sorted(np.lexsort((np.arange(len(light)), -w * h))[:MOST_THUMBNAILS]):
        s = int(light.surface[k])
        own = [t[s] for t in bake.trees if s in t]
        codes = thumbnails.thumbnail(light.map(k), light.hidden_map(k), exposure)
        roots = tuple(int(r) for r in light.roots[k])
        path, cells_w, cells_h = "", *roots
        if own:
            path, cells_w, cells_h = charts.tree_lines(
                *(np.concatenate(x) for x in zip(*(surfaces.leaves(t) for t in own), strict=True)), roots
            )
        drawn[bake.scene.names[s]] = Thumbnail(png(codes), codes.shape[1::-1], path, cells_w, cells_h)
    return drawn


def png(codes):
    """PNG bytes of 8-bit codes (h, w, 3)."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.png"
        pictures.write_png8(path, codes)
        return path.read_bytes()
