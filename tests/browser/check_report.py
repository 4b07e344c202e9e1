"""The report opened in headless Chromium: it starts without a network, and its viewer draws what the ray caster draws.

Not part of the plain suite, since it needs a browser: `make check-export` runs it, or
`python -m pytest tests/browser/check_report.py`. RESULTS (environment) names the bake, default results/fruit_room;
CHROMIUM the browser.
"""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from lib.formats import exported
from lib.formats.artefact import read_json
from lib.report import picture
from lib.report.camera import Camera

RESULTS = Path(os.environ.get("RESULTS", "results/fruit_room"))
CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--window-size=1200,900",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # no name resolves: a page that needs the network fails here
    "--virtual-time-budget=60000",
    "--dump-dom",
]
CODES = (
    6  # of 255: between one ray a pixel with bilinear lookup, and a GPU's mipmaps and multisampling in an even place
)


@pytest.fixture(scope="module")
def page():
    """The page's HTML after its scripts have run."""
    if not CHROMIUM:
        pytest.fail("no Chromium found; name one by CHROMIUM=/path/to/chromium")
    html = (RESULTS / "report.html").resolve()
    done = subprocess.run([CHROMIUM, *FLAGS, html.as_uri()], capture_output=True, text=True, timeout=180, check=True)
    return done.stdout


def attribute(page, name):
    found = re.search(rf'<div class="viewer"[^>]* data-{name}="([^"]*)"', page)
    assert found, f"the viewer did not start: {re.findall('<output>(.*?)</output>', page)}"
    return found[1]


def test_every_level_is_loaded_and_textures_are_shared(page):
    report = read_json(RESULTS / "report.json")
    assert [int(n) for n in attribute(page, "triangles").split()] == [r["triangles"] for r in report["levels"]]
    textures = {image["uri"] for image in read_json(RESULTS / report["levels"][0]["file"]).get("images", [])}
    assert int(attribute(page, "textures")) == len(textures)


def test_the_middle_of_the_view_has_the_colour_the_ray_caster_finds(page):
    view = json.loads(re.search(r'id="model">(.*?)</script>', page, re.DOTALL)[1])["camera"]
    view = Camera(tuple(view["eye"]), tuple(view["target"]), view["fov"])
    parts, textures = exported.load(RESULTS / "scene_LOD0.gltf")
    codes = picture.render(picture.join(parts), textures, view, 161, 101)[48:53, 78:83].reshape(-1, 3).astype(int)
    seen = np.array(attribute(page, "centre").split(), dtype=int)
    assert (seen >= codes.min(0) - CODES).all() and (seen <= codes.max(0) + CODES).all(), (seen, codes)
