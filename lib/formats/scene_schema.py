"""Checks a settings tree against config/scene.schema.json and says every mistake in plain words.

The one importer of jsonschema.
"""

import functools
import json
import re
from pathlib import Path

import jsonschema

from lib.formats.mistakes import listed, nearest, shown
from lib.formats.strict_yaml import line_at

SCHEMA_FILE = Path(__file__).resolve().parents[2] / "config" / "scene.schema.json"
_TYPES = {
    "object": "keys with values",
    "array": "a list",
    "string": "a text",
    "integer": "a whole number",
    "number": "a number",
    "boolean": "true or false",
    "null": "nothing",
}
_CHOICES = ("if", "anyOf", "oneOf", "allOf")


def _integer(_, value):
    return isinstance(value, int) and not isinstance(value, bool)  # 6.0 is not a count


@functools.cache
def _validator():
    schema = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
    base = jsonschema.Draft202012Validator
    checker = base.TYPE_CHECKER.redefine("integer", _integer)
    return jsonschema.validators.extend(base, type_checker=checker)(schema)


def check(tree, mistakes, file, required=True):
    """Note in `mistakes` everything in `tree` that the schema does not allow.

    file : how messages call the source; `required=False` allows a missing `geometry` (defaults, command line).
    Lines come from the tree where it has them (strict_yaml.Map).
    """
    for error in _validator().iter_errors(tree):
        if not required and error.validator == "required" and not error.absolute_path:
            continue
        for path, what in _sentences(error):
            surface, field = place(tree, path)
            mistakes.add(what, file, surface, field, line_at(tree, path))


def place(tree, path):
    """How a message names the node at `path`: (surface name or None, field or None).

    >>> place({"geometry": [{"name": "floor"}]}, ("geometry", 0, "rectangle", "u", 2))
    ('floor', 'rectangle.u[2]')
    >>> place({}, ("bake", "tolerance"))
    (None, 'bake.tolerance')
    """
    path, surface = list(path), None
    if len(path) >= 2 and path[0] == "geometry" and isinstance(path[1], int):
        item = tree["geometry"][path[1]]
        name = item.get("name", item.get("file")) if isinstance(item, dict) else None
        if isinstance(name, str) and name and name.isprintable():
            surface, path = name[:120], path[2:]
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).lstrip(".")
    return surface, text[:200] or None


def _sentences(error):
    """(path, sentence) pairs of one schema error, which may hold several."""
    path, value, rule, schema = tuple(error.absolute_path), error.instance, error.validator_value, error.schema
    kind = error.validator
    if kind == "oneOf" and not isinstance(value, dict):
        return []  # its wrong type is said already
    if kind in _CHOICES and kind != "oneOf":
        deeper = _of_the_meant_branch(error)
        if deeper:
            return [sentence for inner in deeper for sentence in _sentences(inner)]
    if kind == "additionalProperties":
        known = list(schema.get("properties", {}))
        return [
            ((*path, key), f"unknown key{nearest(key, known) or '; allowed: ' + listed(known, 20)}")
            for key in value
            if key not in known
        ]
    if kind == "required":
        missing = re.match(r"'(.*)' is a required", error.message)
        return [(path, f"{missing.group(1)} is missing")] if missing else [(path, error.message)]
    return [(path, _sentence(kind, value, rule, schema))]


def _of_the_meant_branch(error):
    """The errors inside the branch whose type fits the value, if just one does."""
    branches = {}
    for inner in error.context:
        branches.setdefault(inner.schema_path[0], []).append(inner)
    if error.validator in ("if", "allOf"):
        return [inner for inners in branches.values() for inner in inners]
    of_other_type = ("type", "const", "enum", "pattern")
    fitting = [
        inners for inners in branches.values() if not any(i.validator in of_other_type and not i.path for i in inners)
    ]
    return fitting[0] if len(fitting) == 1 and any(inner.path for inner in fitting[0]) else []


def _sentence(kind, value, rule, schema):
    """One mistake in words: what stands there and what is allowed."""
    if kind in ("anyOf", "oneOf", "not") and "errorMessage" in schema:
        if kind == "oneOf":
            return schema["errorMessage"]
        found = "" if isinstance(value, (dict, list)) else f"{shown(value)} is not allowed; "
        return f"{found}expected {schema['errorMessage']}"
    if kind == "type":
        return f"expected {_TYPES.get(rule, rule)}, found {_described(value)}"
    if kind == "enum":
        return f"{shown(value)} is not allowed; expected {' or '.join(map(str, rule))}{nearest(value, rule)}"
    if kind in ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"):
        return f"{shown(value)} is out of range; allowed: {_range(schema)}"
    if kind in ("minItems", "maxItems"):
        least, most = schema.get("minItems", 0), schema.get("maxItems")
        if not value:
            return "the list is empty"
        allowed = least if least == most else f"{least} to {most}" if most else f"at least {least}"
        return f"expected a list of {allowed}, found {len(value)}"
    if kind in ("minLength", "maxLength"):
        length = f"a text of {len(value)} characters; allowed: at most {schema['maxLength']}"
        return length if value else "the text is empty"
    if kind in ("minProperties", "maxProperties"):
        return f"expected one of {listed(schema.get('properties', {}))}, and only one"
    if kind == "uniqueItems":
        return "the list names something twice"
    if kind == "propertyNames":
        return "a name here is empty or too long"
    return f"{shown(value)} is not allowed here"


def _described(value):
    if isinstance(value, dict):
        return "keys with values"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return f"the text {shown(value)}" if isinstance(value, str) else shown(value)


def _range(schema):
    """Words for the bounds of a schema.

    >>> _range({"minimum": 0.002, "maximum": 0.1}), _range({"exclusiveMinimum": 0, "maximum": 1e100})
    ('0.002 to 0.1', '> 0')
    """
    low, above, high = schema.get("minimum"), schema.get("exclusiveMinimum"), schema.get("maximum")
    if high is not None and high >= 1e29:
        high = None
    if low is not None and low <= -1e29:
        return "a number between -1e100 and 1e100"
    if high is None:
        return f">= {low}" if above is None else f"> {above}"
    return f"{low} to {high}" if above is None else f"> {above} and <= {high}"
