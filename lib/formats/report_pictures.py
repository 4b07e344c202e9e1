"""The pictures of the report: the exported levels, drawn; the maps, small; and what the viewer needs."""

import numpy as np

from lib import forks
from lib.formats import exported, pictures
from lib.formats.report_html import Pictures, Thumbnail
from lib.formats.scene_view import scene_camera
from lib.report import camera as cameras
from lib.report import charts, picture, surfaces, thumbnails

HERO, SMALL = (960, 600), (400, 250)  # pixels
MOST_THUMBNAILS = 160


def draw(bake, facts, settings):
    """Pictures of the levels and maps, and what the viewer shows (None where that is too large to inline)."""
    files = [bake.folder / level["file"] for level in facts["levels"]]
    given = settings.get("camera")
    view = scene_camera(given, settings) if given else None
    tasks = (lambda: _levels(files, view)), (lambda: (_hero(files[0], view), map_thumbnails(bake, facts)))
    (levels, place, inlined), (hero, maps) = forks.mapped(lambda task: task(), tasks, few=1)
    return Pictures(hero, levels, maps, place), None if None in inlined else _viewer_model(inlined, place)


def _hero(file, view):
    """PNG of the finest level, seen from `view` or where most of it shows."""
    parts, textures = exported.load(file)
    model = picture.join(parts)
    return pictures.png_bytes(picture.render(model, textures, view or cameras.automatic(model), *HERO))


def _levels(files, view):
    """(two PNGs of each level, where the camera stands, what the viewer needs of each file)."""
    known, levels, near = {}, [], None
    for file in files:
        parts, textures = exported.load(file, known)
        model = picture.join(parts)
        if near is None:
            view = view or cameras.automatic(model)
            near = cameras.closer(model, view, *SMALL)
        levels.append(tuple(map(pictures.png_bytes, picture.render_with_edges(model, textures, near, *SMALL))))
    place = {"eye": [float(x) for x in view.eye], "target": [float(x) for x in view.target], "fov": float(view.fov)}
    return levels, place, [exported.inlined(file) for file in files]


def _viewer_model(inlined, place):
    """What viewer.js reads: the levels as glTF documents, each picture once, where to stand."""
    return {
        "levels": [document for document, _ in inlined],
        "textures": {uri: data for _, named in inlined for uri, data in named.items()},
        "camera": place,
    }


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
        drawn[bake.scene.names[s]] = Thumbnail(pictures.png_bytes(codes), codes.shape[1::-1], path, cells_w, cells_h)
    return drawn
