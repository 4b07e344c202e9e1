"""bake.quality: a name for a tolerance, replaced before sources are merged."""

import pytest

from lib.formats import scene_folder
from lib.refusal import Refusal

SCENE = "geometry: [{name: floor, rectangle: {origin: [0, 0, 0], u: [1, 0, 0], v: [0, 1, 0]}}]\n"


def bake_settings(folder, bake="", overrides=None):
    (folder / "scene.yaml").write_text(SCENE + bake)
    return scene_folder.read(folder, overrides).settings["bake"]


@pytest.mark.parametrize("quality, tolerance", [("preview", 0.014), ("standard", 0.01), ("final", 0.0035)])
def test_a_name_for_a_tolerance(tmp_path, quality, tolerance):
    found = bake_settings(tmp_path, f"bake: {{quality: {quality}}}")
    assert found["tolerance"] == tolerance and "quality" not in found
    same = bake_settings(tmp_path, f"bake: {{tolerance: {tolerance}, first_look: {str(quality == 'preview').lower()}}}")
    assert found == same


def test_a_preview_has_a_first_look(tmp_path):
    """Unless it is said otherwise, and no longer where another quality is typed over it."""
    assert bake_settings(tmp_path, "bake: {quality: preview}")["first_look"] is True
    assert bake_settings(tmp_path, "bake: {quality: preview}", {"bake.quality": "final"})["first_look"] is False
    assert bake_settings(tmp_path, "bake: {quality: preview, first_look: false}")["first_look"] is False
    assert bake_settings(tmp_path, "bake: {tolerance: 0.02}")["first_look"] is False
    assert bake_settings(tmp_path, "bake: {first_look: true}", {"bake.quality": "final"})["first_look"] is True
    assert bake_settings(tmp_path, "bake: {first_look: true}", {"bake.first_look": "auto"})["first_look"] is False


def test_a_tolerance_beside_it_wins(tmp_path):
    assert bake_settings(tmp_path, "bake: {quality: final, tolerance: 0.02}")["tolerance"] == 0.02


def test_the_stronger_source_wins(tmp_path):
    """What is typed lies over the scene's, whichever of the two names either uses."""
    assert bake_settings(tmp_path, "bake: {tolerance: 0.02}", {"bake.quality": "preview"})["tolerance"] == 0.014
    assert bake_settings(tmp_path, "bake: {quality: preview}", {"bake": {"tolerance": "0.05"}})["tolerance"] == 0.05
    assert bake_settings(tmp_path, "bake: {seed: 2}")["tolerance"] == 0.01


def test_other_names_are_refused(tmp_path):
    with pytest.raises(Refusal, match=r"bake.quality.*preview, standard|preview.*standard.*final"):
        bake_settings(tmp_path, "bake: {quality: best}")
