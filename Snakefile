# From a scene folder to its bake: snakemake --cores 2 --config scene=FOLDER [SETTING=VALUE ...]
# Rules read their slice of the settings as params, so that a changed setting re-runs the stages that read it and no others.
import gc
import json
import os
import shlex
import subprocess
import sys
import threading
import uuid
from pathlib import Path

sys.path.insert(0, workflow.basedir)
gc.freeze()  # Snakemake is loaded and stays: to look for garbage in it, last when it ends, takes 0.2 s

from lib import warm_start
from lib.door import stopped
from lib.formats import preflight
from lib.formats.artefact import ArtefactError
from lib.formats.rule_settings import lod_levels, n_chunks, rule_settings, short
from lib.refusal import Refusal
from lib.stage_code import listing, stage_digests

from snakemake.utils import min_version

min_version("9.0")

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # jobs are the parallelism; idle threads cost start-up
os.environ["PYTHONPATH"] = os.pathsep.join([workflow.basedir, *filter(None, [os.environ.get("PYTHONPATH")])])
MOST_CORES = 8  # of jobs that nothing can run beside, with --cores as many; more share too little of the work
os.environ.setdefault("BAKE_RUN", uuid.uuid4().hex)  # tells this run's costs from those of earlier ones
TOLD = " --log {log.text:q} --cost {log.cost:q} --threads {threads}"  # every job
RUN = shlex.join([sys.executable, "-I", "-S", os.path.join(workflow.basedir, "stages")])  # stages/__main__.py


def read_scene(folder, overrides, results_root):
    """Read the scene in the process that runs the jobs: it needs the same libraries later, this one needs none."""
    warm_start.start()
    told = ["--scene", folder, "--overrides", json.dumps(overrides, default=str), "--results", results_root]
    told += ["--threads", str(min(MOST_CORES, workflow.resource_settings.cores or 1))]
    if subprocess.run([*shlex.split(RUN), "preflight", *told]).returncode:
        sys.exit(1)


try:
    scene = preflight.load(
        config.get("scene", os.path.join(workflow.basedir, "data/scenes/fruit_room")),
        dict(config),
        "results",
        read_scene,
    )
except (Refusal, ArtefactError) as error:
    print(error, file=sys.stderr)
    sys.exit(1)
for warning in scene.warnings:
    print(f"warning: {warning}", file=sys.stderr)

os.environ["BAKE_SCENE"] = scene.file  # whose settings a job that refuses them names


envvars:  # goes with jobs to other machines
    "BAKE_RUN",
    "BAKE_SCENE",


OUT = f"results/{scene.name}"
STAGE = f"{OUT}/stages"
SLICES = rule_settings(scene.settings, scene.warnings, scene.tolerances, scene.reconstruction, scene.mesh_cells)
SETTINGS = short(SLICES, f"{OUT}/settings")
HAS_MAP = [role != "cast_only" and not black for role, black in zip(scene.roles, scene.is_black)]
MAPPED = [file for file, has_map in zip(scene.files, HAS_MAP) if has_map]
SIDES = [area**0.5 / scene.largest for area, has_map in zip(scene.area, HAS_MAP) if has_map]
N_CHUNKS = n_chunks(scene.settings, SIDES, scene.mesh_cells)
CHUNKS = range(N_CHUNKS)
LODS = lod_levels(scene.settings["lods"])
LEVELS = range(len(LODS))
MAPS = [f"{OUT}/maps/{file}.exr" for file in MAPPED]
FILES = listing(workflow.basedir)
LOST_MAPS = [path for path in MAPS if not os.path.exists(path)]
# One job makes all maps. Snakemake is told of one, lost ones first: for each it would read all inputs of that job.
MAP = (LOST_MAPS or MAPS)[:1]


def code(stage):
    """A param for each file of the stage's code, so that an edit re-runs it and the reason names the file.

    Params and not inputs: an edit during the run is noticed by the next, old time stamps and a moved checkout do not
    matter, and the terminal is spared a hundred paths a job.
    """
    return stage_digests(stage, workflow.basedir, FILES)


def records(stage, of=""):
    """Where a job writes what it says and what it costs; of : what tells it from others of its stage."""
    return {"text": f"{STAGE}/{stage}/log{of}.txt", "cost": f"{STAGE}/{stage}/cost{of}.json"}


def watched(files):
    """The user's files as inputs: relative below the working folder, so that it can be moved.

    Snakemake would take a {name} in a path for a wildcard. The slices hold the digests of all files, these too.
    """
    here = os.getcwd() + os.sep
    return [path.removeprefix(here) for path in files if "{" not in path]


onstart:
    warm_start.start()
    if not scene.settings["bake"]["first_look"]:  # one of a bake before would show what is no longer there
        Path(OUT, "first_look.png").unlink(missing_ok=True)


def end_timers():
    """End those of Snakemake's limit of jobs a second: they hold a finished run for a second more, for nothing."""
    for thread in threading.enumerate():
        if isinstance(thread, threading.Timer):
            thread.cancel()


onsuccess:
    end_timers()


onerror:
    end_timers()
    print(*stopped(STAGE, os.environ["BAKE_RUN"]), sep="\n", file=sys.stderr)  # again, below what Snakemake had to say


rule all:
    input:
        f"{OUT}/report.html",
        f"{OUT}/report.json",
        f"{OUT}/scene.glb",
        f"{OUT}/lods.json",
        [f"{OUT}/scene_LOD{k}.gltf" for k in LEVELS],
        [f"{OUT}/first_look.png"] if scene.settings["bake"]["first_look"] else [],
        MAP,


if scene.settings["bake"]["first_look"]:

    rule first_look:
        input:
            files=watched(scene.geometry_files + scene.texture_files + scene.emission_files),
        output:
            f"{OUT}/first_look.png",
        log:
            **records("first_look"),
        threads: MOST_CORES
        params:
            *code("first_look"),
            slice=scene.slices["geometry"],
            settings=SETTINGS["first_look"],
            materials=scene.slices["materials"],
            textures=scene.slices["textures"],
        shell:
            "{RUN} first_look --scene-slice {params.slice:q} --materials {params.materials:q}"
            " --textures {params.textures:q} --settings {params.settings:q} --out {output:q}" + TOLD


rule import_scene:
    input:
        geometry=watched(scene.geometry_files + scene.emission_files),
    output:
        f"{STAGE}/import_scene/scene.npz",
    log:
        **records("import_scene"),
    threads: MOST_CORES
    params:
        *code("import_scene"),
        slice=scene.slices["geometry"],
    shell:
        "{RUN} import_scene --scene-slice {params.slice:q} --out {output:q}" + TOLD


rule tessellate:
    input:
        scene=rules.import_scene.output,
    output:
        f"{STAGE}/tessellate/casters.npz",
    log:
        **records("tessellate"),
    threads: MOST_CORES
    params:
        *code("tessellate"),
        settings=SETTINGS["tessellate"],
    shell:
        "{RUN} tessellate --scene {input.scene:q} --settings {params.settings:q} --out {output:q}" + TOLD


rule sample:
    input:
        scene=rules.import_scene.output,
        casters=rules.tessellate.output,
    output:
        f"{STAGE}/sample/chunk_{{c}}.npz",
    log:
        **records("sample", "_{c}"),
    params:
        *code("sample"),
        settings=SETTINGS["sample"],
        chunks=N_CHUNKS,
    shell:
        "{RUN} sample --scene {input.scene:q} --casters {input.casters:q} --chunk {wildcards.c} --chunks {params.chunks}"
        " --settings {params.settings:q} --out {output:q}" + TOLD


rule shoot:
    input:
        scene=rules.import_scene.output,
        casters=rules.tessellate.output,
        samples=expand(rules.sample.output, c=CHUNKS),
    output:
        solution=f"{STAGE}/shoot/solution.npz",
        plot=f"{STAGE}/shoot/convergence.svg",
    log:
        **records("shoot"),
    params:
        *code("shoot"),
        settings=SETTINGS["shoot"],
        materials=scene.slices["materials"],
    shell:
        "{RUN} shoot --scene {input.scene:q} --casters {input.casters:q} --samples {input.samples:q}"
        " --materials {params.materials:q} --settings {params.settings:q}"
        " --out {output.solution:q} --plot {output.plot:q}" + TOLD


rule refine_direct:
    input:
        scene=rules.import_scene.output,
        casters=rules.tessellate.output,
        solution=rules.shoot.output.solution,
        samples=rules.sample.output,
    output:
        trees=f"{STAGE}/refine/direct_{{c}}.npz",
        radiosity=temp(f"{STAGE}/refine/radiosity_{{c}}.npz"),  # large, and read once
    log:
        **records("refine", "_direct_{c}"),
    params:
        *code("refine"),
        settings=SETTINGS["refine"],
        chunks=N_CHUNKS,
    shell:
        "{RUN} refine --half direct --scene {input.scene:q} --casters {input.casters:q} --solution {input.solution:q}"
        " --samples {input.samples:q} --chunk {wildcards.c} --chunks {params.chunks} --settings {params.settings:q}"
        " --out {output.trees:q} --radiosity-out {output.radiosity:q}" + TOLD


rule refine_indirect:
    input:
        scene=rules.import_scene.output,
        casters=rules.tessellate.output,
        solution=rules.shoot.output.solution,
        direct=rules.refine_direct.output.trees,
        radiosity=expand(rules.refine_direct.output.radiosity, c=CHUNKS),
    output:
        f"{STAGE}/refine/indirect_{{c}}.npz",
    log:
        **records("refine", "_indirect_{c}"),
    params:
        *code("refine"),
        settings=SETTINGS["refine"],
        chunks=N_CHUNKS,
    shell:
        "{RUN} refine --half indirect --scene {input.scene:q} --casters {input.casters:q} --solution {input.solution:q}"
        " --direct {input.direct:q} --radiosity {input.radiosity:q} --chunk {wildcards.c} --chunks {params.chunks}"
        " --settings {params.settings:q} --out {output:q}" + TOLD


rule balance_resample:
    input:
        scene=rules.import_scene.output,
        solution=rules.shoot.output.solution,
        direct=rules.refine_direct.output.trees,
        indirect=rules.refine_indirect.output,
    output:
        f"{STAGE}/balance_resample/chunk_{{c}}.npz",
    log:
        **records("balance_resample", "_{c}"),
    params:
        *code("balance_resample"),
        settings=SETTINGS["balance_resample"],
    shell:
        "{RUN} balance_resample --scene {input.scene:q} --solution {input.solution:q} --direct {input.direct:q}"
        " --indirect {input.indirect:q} --settings {params.settings:q} --out {output:q}" + TOLD


rule apply_base_texture:
    input:
        scene=rules.import_scene.output,
        maps=expand(rules.balance_resample.output, c=CHUNKS),
        textures=watched(scene.texture_files),
    output:
        textured=f"{STAGE}/apply_base_texture/textured.npz",
        map=MAP,
    log:
        **records("apply_base_texture"),
    params:
        *code("apply_base_texture"),
        settings=SETTINGS["apply_base_texture"],
        materials=scene.slices["materials"],
        slice=scene.slices["textures"],
        folder=f"{OUT}/maps",
    shell:
        "{RUN} apply_base_texture --scene {input.scene:q} --maps {input.maps:q} --materials {params.materials:q}"
        " --textures {params.slice:q} --settings {params.settings:q} --maps-folder {params.folder:q}"
        " --out {output.textured:q}" + TOLD


rule budget_reduce:
    input:
        textured=rules.apply_base_texture.output.textured,
        casters=rules.tessellate.output,
    output:
        textures=f"{STAGE}/budget_reduce/textures.npz",
        table=f"{STAGE}/budget_reduce/budget.json",
    log:
        **records("budget_reduce"),
    params:
        *code("budget_reduce"),
        settings=SETTINGS["budget_reduce"],
    shell:
        "{RUN} budget_reduce --maps {input.textured:q} --casters {input.casters:q} --settings {params.settings:q}"
        " --out {output.textures:q} --table {output.table:q}" + TOLD


if scene.has_meshes:

    rule thin_meshes:
        input:
            scene=rules.import_scene.output,
            casters=rules.tessellate.output,
        output:
            f"{STAGE}/thin_meshes/ladder.npz",
        log:
            **records("thin_meshes"),
        params:
            *code("thin_meshes"),
        shell:
            "{RUN} thin_meshes --scene {input.scene:q} --casters {input.casters:q} --out {output:q}" + TOLD


def finest_level(wildcards):
    """The level that this one is a share of, and is cut after."""
    return f"{STAGE}/lod_export/lod_0.npz" if LODS[int(wildcards.k)][1] else []


rule lod_export:
    input:
        finest=finest_level,
        scene=rules.import_scene.output,
        casters=rules.tessellate.output,
        ladder=rules.thin_meshes.output if scene.has_meshes else [],
        # Light in vertices needs vertices on the lattice of the final map.
        textures=rules.budget_reduce.output.textures if "gouraud" in scene.reconstruction.values() else [],
    output:
        f"{STAGE}/lod_export/lod_{{k}}.npz",
    log:
        **records("lod_export", "_{k}"),
    params:
        *code("lod_export"),
        level=lambda wildcards: LODS[int(wildcards.k)][0],
        finest=lambda wildcards: ["--finest", finest_level(wildcards)] if finest_level(wildcards) else [],
        more=["--textures", f"{STAGE}/budget_reduce/textures.npz"] if "gouraud" in scene.reconstruction.values() else [],
        ladder=["--ladder", f"{STAGE}/thin_meshes/ladder.npz"] if scene.has_meshes else [],
        reconstruction=SETTINGS["reconstruction"],
    shell:
        "{RUN} lod_export --scene {input.scene:q} --casters {input.casters:q} --level {params.level:q}"
        " {params.finest:q} --units m --level-index {wildcards.k} {params.ladder:q} {params.more:q}"
        " --reconstruction {params.reconstruction:q} --out {output:q}" + TOLD


rule package:
    input:
        scene=rules.import_scene.output,
        casters=rules.tessellate.output,
        textures=rules.budget_reduce.output.textures,
        budget=rules.budget_reduce.output.table,
        lods=expand(rules.lod_export.output, k=LEVELS),
    output:
        combined=f"{OUT}/scene.glb",
        levels=[f"{OUT}/scene_LOD{k}.{end}" for k in LEVELS for end in ("gltf", "bin")],
        manifest=f"{OUT}/lods.json",
    log:
        **records("package"),
    threads: MOST_CORES
    params:
        *code("package"),
        settings=SETTINGS["package"],
        materials=scene.slices["materials"],
        results=OUT,
    shell:
        "{RUN} package --scene {input.scene:q} --casters {input.casters:q} --textures {input.textures:q}"
        " --budget {input.budget:q} --lods {input.lods:q} --materials {params.materials:q}"
        " --settings {params.settings:q} --results {params.results:q}" + TOLD


rule report:
    input:
        scene=rules.import_scene.output,
        casters=rules.tessellate.output,
        solution=rules.shoot.output.solution,
        direct=expand(rules.refine_direct.output.trees, c=CHUNKS),
        indirect=expand(rules.refine_indirect.output, c=CHUNKS),
        maps=expand(rules.balance_resample.output, c=CHUNKS),
        textures=rules.budget_reduce.output.textures,
        budget=rules.budget_reduce.output.table,
        lods=rules.package.output.manifest,
    output:
        html=f"{OUT}/report.html",
        json=f"{OUT}/report.json",
    log:
        **records("report"),
    threads: 2
    params:
        *code("report"),
        settings=SETTINGS["report"],
        results=OUT,
    shell:
        "{RUN} report --results {params.results:q} --scene {input.scene:q} --casters {input.casters:q}"
        " --solution {input.solution:q} --direct {input.direct:q} --indirect {input.indirect:q} --maps {input.maps:q}"
        " --textures {input.textures:q} --budget {input.budget:q} --lods {input.lods:q} --settings {params.settings:q}"
        " --out-html {output.html:q} --out-json {output.json:q}" + TOLD


for each in workflow.rules:  # levels of detail wait for nothing but the geometry: what others wait for goes before
    each.priority = {"first_look": 2, "lod_export": 0}.get(each.name, 1)
