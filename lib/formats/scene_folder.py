"""Reads a scene folder: scene.yaml over config/bake.yaml, under what was typed on the command line.

All three share config/scene.schema.json and each is checked against it on its own, so that a message names the source
that holds the mistake.  Mappings merge key by key; a list or a value replaces the one below it.  bake.quality stands
for a bake.tolerance of the same source, which wins where both are given, and decides a bake.first_look that is auto.
"""

import math
from dataclasses import dataclass
from pathlib import Path

from lib.formats import strict_yaml
from lib.formats.mistakes import Mistakes
from lib.refusal import refusal

DEFAULTS_FILE = Path(__file__).resolve().parents[2] / "config" / "bake.yaml"
COMMAND_LINE = "command line"
QUALITIES = {"preview": 0.014, "standard": 0.01, "final": 0.0035}  # bake.quality: names for tolerances


@dataclass(frozen=True)
class SceneFolder:
    """Settings of a scene, merged and checked against the schema, but with units and patterns as written.

    folder : absolute Path;  file : scene.yaml as messages name it
    settings : nested dict in the shape of config/scene.schema.json
    sources : (name, tree) pairs, the strongest first
    """

    folder: Path
    file: str
    settings: dict
    sources: tuple

    def where(self, path):
        """(file, line) of the strongest source that sets `path`, a tuple of keys and indices."""
        for name, tree in self.sources:
            node = tree
            try:
                for step in path:
                    node = node[step]
            except (KeyError, IndexError, TypeError):
                continue
            return (name, strict_yaml.line_at(tree, path))
        return self.file, None


def read(folder, overrides=None):
    """Read the scene in `folder` (or its scene.yaml); `overrides` is what was typed, nested or with dotted keys.

    The key `scene` of the overrides names the folder and is left out.  Texts in overrides are read as YAML reads plain
    values, since a command line has no types.  Raises Refusal, which lists every mistake of all sources.
    """
    from lib.formats import scene_schema  # here: jsonschema costs 0.1 s, and a cached preflight never comes this far

    given = Path(folder)
    given = given.parent if given.name == "scene.yaml" else given
    if not given.is_dir():
        what = "is not a folder; expected a folder with a scene.yaml" if given.exists() else "no such folder"
        raise refusal(what, file=given)
    file = str(given / "scene.yaml")
    scene = strict_yaml.read(given / "scene.yaml", file)
    defaults = strict_yaml.read(DEFAULTS_FILE, "config/bake.yaml")
    mistakes = Mistakes()
    typed = from_command_line(overrides or {}, mistakes)
    mistakes.stop()
    scene_schema.check(typed, mistakes, COMMAND_LINE, required=False)
    scene_schema.check(scene, mistakes, file, required="geometry" not in typed)
    scene_schema.check(defaults, mistakes, "config/bake.yaml", required=False)
    mistakes.stop()
    settings = merge(merge(defaults, without_quality(scene)), without_quality(typed))
    is_preview = settings["bake"].pop("is_preview", False)
    if settings["bake"]["first_look"] == "auto":
        settings["bake"]["first_look"] = is_preview
    sources = ((COMMAND_LINE, typed), (file, scene), ("config/bake.yaml", defaults))
    return SceneFolder(given.resolve(), file, settings, sources)


def without_quality(tree):
    """Plain dict of one source's checked settings with bake.quality replaced by the tolerance it stands for, and by
    whether it is a preview.

    >>> without_quality({"bake": {"quality": "final"}})
    {'bake': {'tolerance': 0.0035, 'is_preview': False}}
    """
    tree = _plain(tree)
    quality = (tree.get("bake") or {}).pop("quality", None)
    if quality is not None:
        tree["bake"].setdefault("tolerance", QUALITIES[quality])
        tree["bake"]["is_preview"] = quality == "preview"
    return tree


def merge(below, above):
    """Plain dict of `below` with `above` laid over it: mappings key by key, everything else replaced.

    >>> merge({"bake": {"seed": 1, "sag": 2}, "lods": [1, 2]}, {"bake": {"seed": 3}, "lods": [4]})
    {'bake': {'seed': 3, 'sag': 2}, 'lods': [4]}
    """
    if not (isinstance(below, dict) and isinstance(above, dict)):
        return _plain(above)
    merged = {key: _plain(value) for key, value in below.items()}
    for key, value in above.items():
        merged[key] = merge(below[key], value) if key in below else _plain(value)
    return merged


def _plain(tree):
    if isinstance(tree, dict):
        return {key: _plain(value) for key, value in tree.items()}
    return [_plain(value) for value in tree] if isinstance(tree, list) else tree


def from_command_line(overrides, mistakes):
    """Overrides as one nested dict: dotted keys split, texts read as plain YAML values; the key `scene` is dropped.

    >>> from_command_line({"scene": "x", "bake.tolerance": "1e-2", "lods": ["0.5"]}, Mistakes())
    {'bake': {'tolerance': 0.01}, 'lods': [0.5]}
    """
    tree = {}
    for key, value in overrides.items():
        if key == "scene":
            continue
        *above, last = str(key).split(".") if "." in str(key) else [str(key)]
        node = tree
        for step in above:
            node = node.setdefault(step, {})
            if not isinstance(node, dict):
                break
        if not isinstance(node, dict) or (last in node and not isinstance(node[last], dict)):
            mistakes.add("set twice", file=COMMAND_LINE, field=key)
            continue
        value = _typed(value, key, mistakes, 0)
        node[last] = merge(node[last], value) if last in node else value
    return tree


def _typed(value, field, mistakes, depth):
    if depth > strict_yaml.MAX_DEPTH:
        raise refusal(f"nested more than {strict_yaml.MAX_DEPTH} deep", file=COMMAND_LINE, field=str(field)[:60])
    if isinstance(value, dict):
        return {str(key): _typed(inner, f"{field}.{key}", mistakes, depth + 1) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_typed(inner, f"{field}[{index}]", mistakes, depth + 1) for index, inner in enumerate(value)]
    if isinstance(value, str):
        try:
            number = float(value)
        except ValueError:
            return strict_yaml.scalar(value)[0]
        if math.isfinite(number) and "_" not in value:
            plain = strict_yaml.scalar(value)[0]
            return number if isinstance(plain, str) else plain
        value = number
    if isinstance(value, float) and not math.isfinite(value):
        mistakes.add(f"{value} is not a finite number", file=COMMAND_LINE, field=field)
        return None
    return value
