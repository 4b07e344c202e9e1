"""Everything a bake left in its results folder, found and loaded: what the report tells of."""

import re
from dataclasses import dataclass
from pathlib import Path

from lib.formats import casters, light_maps, scene, solution, textured_maps, trees
from lib.formats.artefact import ArtefactError, read_json
from lib.maps import mapset
from lib.surfaces.mesh import Mesh

GIVEN = {  # name: pattern below the results folder, whether it is a list, whether a report needs it
    "scene": ("stages/import_scene/scene.npz", False, True),
    "casters": ("stages/tessellate/casters.npz", False, True),
    "solution": ("stages/shoot/solution.npz", False, False),
    "direct": ("stages/refine/direct_*.npz", True, False),
    "indirect": ("stages/refine/indirect_*.npz", True, False),
    "maps": ("stages/balance_resample/chunk_*.npz", True, False),
    "textures": ("stages/budget_reduce/textures.npz", False, False),
    "budget": ("stages/budget_reduce/budget.json", False, False),
    "lods": ("lods.json", False, True),
    "costs": ("stages/**/*cost*.json", True, False),
}


@dataclass(frozen=True)
class Bake:
    """scene, casters, solution, textures as their modules load them; trees: [{surface: Tree} direct, then indirect];
    tree_facts: what refine noted; maps: MapSet of H of all chunks; budget, lods: the JSON; costs: records of all jobs.
    None, {} or [] where there is no file. folder: where the exported files are."""

    folder: Path
    scene: object
    casters: object
    solution: object
    trees: list
    tree_facts: list
    maps: object
    textures: object
    budget: dict | None
    lods: dict
    costs: list


def find(given, results=None):
    """{name of GIVEN: path, or list of paths}: what is given, else what lies in the results folder, else None or [].

    Raises ArtefactError naming a file that every report needs.
    """
    files = {}
    for name, (pattern, is_list, is_needed) in GIVEN.items():
        files[name] = given.get(name)
        if files[name] is None and results is not None:
            found = sorted(str(p) for p in Path(results).glob(pattern))
            files[name] = found if is_list else next(iter(found), None)
        if is_needed and not files[name]:
            raise ArtefactError(f"{Path(results or '.') / pattern}: missing")
    return files


def load(files):
    """The Bake of the files `find` gives. Raises ArtefactError."""
    read = lambda module, name: module.load(files[name]) if files[name] else None  # noqa: E731
    halves = [[trees.load(path, half) for path in files[half] or []] for half in ("direct", "indirect")]
    chunks = [light_maps.load(path) for path in files["maps"] or []]
    lods, folder = read_json(files["lods"]), Path(files["lods"]).parent
    x = read(scene, "scene")
    has_meshes = any(isinstance(surface, Mesh) for surface in x.surfaces)
    return Bake(
        folder=folder,
        scene=x,
        casters=read(casters, "casters"),
        solution=read(solution, "solution"),
        trees=[{s: tree for chunk, _ in half for s, tree in chunk.items()} for half in halves],
        tree_facts=[facts for half in halves for _, facts in half],
        maps=mapset.merge([c.maps for c in chunks]) if chunks else None,
        textures=read(textured_maps, "textures"),
        budget=read_json(files["budget"]) if files["budget"] else None,
        lods=lods,
        costs=[
            _named(read_json(path), path)
            for path in files["costs"] or []
            if _is_current(path, len(files["direct"] or []), len(lods["levels"]), has_meshes)
        ],
    )


def _is_current(path, n_chunks, n_levels, has_meshes):
    """Is a cost file of a job that this bake has? Fewer chunks or levels, or no meshes, leave those of an earlier one
    behind, a report's own is that of the report before, and a first look is no part of the bake."""
    stage = Path(path).parent.name
    if stage in ("report", "first_look") or (stage == "thin_meshes" and not has_meshes):
        return False
    numbered = re.fullmatch(r"cost_(?:direct_|indirect_)?(\d+)", Path(path).stem)
    if numbered is None:
        return True
    jobs = n_levels if Path(path).parent.name == "lod_export" else n_chunks
    return not jobs or int(numbered[1]) < jobs


def _named(cost, path):
    """A cost record whose stage tells the halves of refine apart, by the name of its file."""
    half = next((h for h in ("indirect", "direct") if cost["stage"] == "refine" and h in Path(path).name), None)
    return {**cost, "stage": f"refine {half}"} if half else cost
