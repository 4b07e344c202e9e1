"""The slice of a scene's settings that each stage reads, and no more: what is not in it can not re-run the stage."""

import hashlib
import json
import re
from pathlib import Path

import numpy as np

from lib.formats.artefact import atomic
from lib.radiosity.quality import first_level, quality

RAYS_A_JOB = 24e6  # about 4 s of one core
MOST_CHUNKS = 64
SURFACE_RAYS = 8e4  # as many take as long as what a surface costs, however small
MESH_RAYS = 24  # a finest cell of a mesh's map: some are sampled whatever the light
MORE = 3  # samples in the end for one on the first lattices
SHADOW_RAYS = 24  # a sample, of a few lights in view
GATHER_RAYS = 0.1  # of a sample, an element of the coarse solution: roughly what a tolerance asks for with as many
MOST_WARNINGS = 100  # told the report
LONGEST = 8000  # characters of a slice in a command line, which holds 128 kB in all


def rule_settings(settings, warnings=(), tolerances=None, reconstruction=None, mesh_cells=0):
    """{stage or shared slice: JSON text} from the resolved settings; sorted keys, so that equal slices are equal texts.

    tolerances, reconstruction : {surface: value} of the surfaces that ask for their own
    mesh_cells : finest cells on all meshes
    """
    bake = settings["bake"]
    q = chosen_quality(bake, mesh_cells)
    light = {"seed": bake["seed"], "bounces": bake["bounces"]}
    threshold = {
        "tolerance": bake["tolerance"],
        "relative_to": bake["relative_to"],
        "tolerances": tolerances or {},
        "t_direct": q["t_direct"],
        "t_indirect": q["t_indirect"],
    }
    finer = "top", "gather_rays", "shadow_rays", "base_indirect", "smallest_cell", "chart_effort", "chart_coarser"
    refine = {name: q[name] for name in finer}
    sample = {name: q[name] for name in ("n_elements", "rays_per_element", "base_direct", "first_shadow_rays")}
    slices = {
        "first_look": {
            "camera": settings["camera"],
            "units": "m",
            "up": settings["up"],
            "exposure": settings["export"]["exposure"],
            "bounces": bake["bounces"],
            "seed": bake["seed"],
        },
        "tessellate": {"sag": bake["sag"]},
        "sample": light | sample,
        "shoot": {"n_elements": q["n_elements"], "convergence": bake["convergence"], "bounces": bake["bounces"]},
        "refine": light | threshold | refine,
        "balance_resample": threshold,
        "apply_base_texture": {"texture_level": bake["texture_level"]},
        "budget_reduce": {
            "budget": settings["budget"],
            "profile": settings["export"]["profiles"][0],
            "order": settings["export"].get("budget_order", "loss"),
        },
        "reconstruction": reconstruction or {},
        "package": {"exposure": settings["export"]["exposure"], "reconstruction": reconstruction or {}},
        "report": {
            "settings": settings,
            "reconstruction": reconstruction or {},
            "camera": settings["camera"],
            "units": "m",
            "up": settings["up"],
            "warnings": _first(list(warnings)),
        },
    }
    return {stage: _text(content) for stage, content in slices.items()}


def lod_levels(lods):
    """[(JSON text of a level, whether it is a share of the first's triangles)]: a job reads its own level alone.

    >>> lod_levels([{"deviation": "1 mm"}, 0.3])
    [('{"deviation": "1 mm"}', False), ('0.3', True)]
    """
    is_share = [not isinstance(level, dict) or "share" in level for level in lods]
    return [(_text(level), share and not is_share[0]) for level, share in zip(lods, is_share, strict=True)]


def short(slices, folder):
    """The slices for command lines: long ones, of thousands of surfaces, as @FILE in `folder`, named by its content."""
    return {stage: text if len(text) <= LONGEST else _file(stage, text, Path(folder)) for stage, text in slices.items()}


def _file(stage, text, folder):
    path = folder / f"{stage}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.json"
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        with atomic(path) as file:
            file.write(text.encode())
    return f"@{path.as_posix()}"


def _first(warnings):
    rest = len(warnings) - MOST_WARNINGS
    return warnings[:MOST_WARNINGS] + ([f"and {rest} more, see the terminal"] if rest > 0 else [])


def _text(content):
    """JSON in which no text holds {name}, which Snakemake would take for a wildcard: the brace as its escape."""
    return re.sub(r"\{(?=\s*[.\w])", r"\\u007b", json.dumps(content, sort_keys=True))


def chosen_quality(bake, mesh_cells=0):
    """Quality of the tolerance as a dict, with what the user fixed by hand laid over it."""
    q = quality(bake["tolerance"], bake["max_level"], mesh_cells).as_dict()
    by_hand = {"n_elements": "elements", "rays_per_element": "rays_per_element", "gather_rays": "gather_rays"}
    q |= {name: bake[key] for name, key in by_hand.items() if bake[key] != "auto"}
    if bake["shadow_rays"] != "auto":
        q |= {"shadow_rays": bake["shadow_rays"], "first_shadow_rays": bake["shadow_rays"]}
    if bake["shadow_rays"] != "auto" or bake["gather_rays"] != "auto":
        q["chart_effort"] = 1.0  # rays asked for are those of meshes too
    return q


def n_chunks(settings, sides, mesh_cells=0):
    """Number of jobs the surfaces are shared among: asked for, or by the rays the scene will need.

    sides : of the surfaces with maps, as if they were squares, in the scene's largest side
    mesh_cells : finest cells on all meshes, many of which are sampled whatever the light, along the borders of charts
    The tolerance does not count: a changed one must not sample again.
    """
    asked = settings["bake"]["chunks"]
    if asked != "auto":
        return int(asked)
    q = chosen_quality(settings["bake"])
    crossings = [((2.0 ** first_level(sides, q[name]) + 1) ** 2).sum() for name in ("base_direct", "base_indirect")]
    of_each = SHADOW_RAYS, GATHER_RAYS * q["n_elements"]
    rays = len(sides) * SURFACE_RAYS + MORE * np.dot(crossings, of_each) + MESH_RAYS * mesh_cells
    return int(np.clip(np.ceil(rays / RAYS_A_JOB), 1, MOST_CHUNKS))
