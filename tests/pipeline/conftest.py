"""One checkout and one finished bake for all tests of whole runs; who changes the bake takes a copy."""

import shutil

import numpy as np
import pytest

from lib.formats import pictures
from tests.pipeline.runs import ROOT, TINY, Project


@pytest.fixture(scope="session")
def project(tmp_path_factory):
    """A Project nobody has baked yet: a copy of the code, the tiny room, an empty working folder."""
    home = tmp_path_factory.mktemp("pipe line")
    checkout, scene, work = home / "check out", home / "my scenes" / "tiny room", home / "work"
    for name in ("lib", "stages", "config"):
        shutil.copytree(ROOT / name, checkout / name)
    shutil.copy2(ROOT / "Snakefile", checkout)
    scene.mkdir(parents=True)
    work.mkdir()
    (scene / "scene.yaml").write_text(TINY)
    pictures.write_png_srgb(scene / "wood.png", np.random.default_rng(1).uniform(0.05, 0.6, (8, 8, 3)))
    return Project(checkout, scene, work)


@pytest.fixture(scope="session")
def baked(project):
    """The Project with the tiny room baked: three chunks, two cores.  For reading and dry runs."""
    done = project.bake()
    project.first = done
    return project


@pytest.fixture
def fresh(project, tmp_path):
    """The same code and scene in an empty working folder."""
    work = tmp_path / "other work"
    work.mkdir()
    return Project(project.checkout, project.scene, work)


@pytest.fixture
def copied(baked, tmp_path):
    """The bake in a working folder of its own, to be changed."""
    shutil.copytree(baked.work, tmp_path / "copied work", symlinks=True)
    return Project(baked.checkout, baked.scene, tmp_path / "copied work")
