"""report.html: one offline file, everything inlined, readable in light and dark.

The page is made from the figures of report.json, pictures as PNG bytes, and the viewer's bundle; nothing is computed
here. Names and settings are user text: every one passes through `html.escape`, and JSON inside a script has its
`<` escaped, so no name can end the element it stands in.
"""

from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from lib.formats import report_sections as sections
from lib.formats.artefact import atomic
from lib.formats.html_pieces import script_file, script_json

HERE = Path(__file__).parent / "viewer"
STYLE = HERE / "report.css"
SORTER = HERE / "report.js"
BUNDLE = HERE / "viewer.bundle.js"
POLICY = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
    "connect-src data: blob:"
)


@dataclass(frozen=True)
class Thumbnail:
    """A surface's map as PNG bytes, samples (w, h) in it, and cell borders as an SVG path over width x height cells.

    Samples lie on the crossings of cells, borders included, so the picture reaches half a sample over the border.
    """

    png: bytes
    samples: tuple
    path: str
    width: int
    height: int


@dataclass(frozen=True)
class Pictures:
    """PNG bytes: the finest level; per level the picture and the picture with its triangles; thumbnails by name.

    camera : of the finest level's picture, {"eye", "target", "fov"} in metres, y up
    """

    hero: bytes | None = None
    levels: list = field(default_factory=list)
    thumbnails: dict = field(default_factory=dict)
    camera: dict | None = None


def save(path, figures, pictures, model=None):
    """Write the page. model: what the viewer shows (see lib.formats.report_pictures), or None for no viewer."""
    with atomic(path) as file:
        file.write(page(figures, pictures, model).encode())


def page(figures, pictures, model=None):
    """The whole page as text.

    figures : dict of lib.report.figures, pictures : Pictures
    model : dict for the viewer, or None
    """
    name = escape(str(figures["scene"]))
    body = [
        sections.head(figures, pictures),
        sections.warnings(figures),
        sections.viewer(model),
        sections.levels(figures, pictures),
        sections.light(figures),
        sections.cost(figures),
        sections.maps(figures, pictures),
        sections.budget(figures),
        sections.gouraud(figures),
        sections.savings(figures),
        sections.seams(figures),
        sections.settings(figures),
    ]
    scripts = f"<script>{script_file(SORTER)}</script>"
    if model is not None:
        scripts += f'<script type="application/json" id="model">{script_json(model)}</script>'
        scripts += f"<script>{script_file(BUNDLE)}</script>"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{name} - bake report</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="color-scheme" content="light dark"><link rel="icon" href="data:,">'
        f"<style>{STYLE.read_text(encoding='utf-8')}</style></head>\n"
        f"<body><main>{''.join(body)}</main>{scripts}</body></html>\n"
    )
