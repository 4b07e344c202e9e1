"""The slice of a scene's settings that each stage reads, and no more: what is not in a slice can not re-run its stage."""

import json

from lib.radiosity.quality import quality

RAYS_A_JOB = 12e6  # about 4 s of one core
MOST_CHUNKS = 64
SHADOW_RAYS = 24  # a sample, of a few lights in view


def rule_settings(settings, warnings=()):
    """{stage: JSON text} from the resolved settings; sorted keys, so that equal slices are equal texts."""
    bake = settings["bake"]
    q = chosen_quality(bake)
    light = {"seed": bake["seed"], "bounces": bake["bounces"]}
    threshold = {
        "tolerance": bake["tolerance"],
        "relative_to": bake["relative_to"],
        "t_direct": q["t_direct"],
        "t_indirect": q["t_indirect"],
    }
    refine = {name: q[name] for name in ("top", "gather_rays", "shadow_rays", "base_indirect")}
    sample = {name: q[name] for name in ("n_elements", "rays_per_element", "base_direct", "first_shadow_rays")}
    slices = {
        "tessellate": {"sag": bake["sag"]},
        "sample": light | sample,
        "shoot": {"n_elements": q["n_elements"], "convergence": bake["convergence"], "bounces": bake["bounces"]},
        "refine": light | threshold | refine,
        "balance_resample": threshold,
        "apply_base_texture": {"texture_level": bake["texture_level"]},
        "budget_reduce": {"budget": settings["budget"], "profile": settings["export"]["profiles"][0]},
        "lod_export": settings["lods"],
        "package": {"exposure": settings["export"]["exposure"]},
        "report": {
            "settings": settings,
            "camera": settings["camera"],
            "units": "m",
            "up": settings["up"],
            "warnings": list(warnings),
        },
    }
    return {stage: json.dumps(content, sort_keys=True) for stage, content in slices.items()}


def chosen_quality(bake):
    """Quality of the tolerance as a dict, with what the user fixed by hand laid over it."""
    q = quality(bake["tolerance"], bake["max_level"]).as_dict()
    by_hand = {"n_elements": "elements", "rays_per_element": "rays_per_element", "gather_rays": "gather_rays"}
    q |= {name: bake[key] for name, key in by_hand.items() if bake[key] != "auto"}
    if bake["shadow_rays"] != "auto":
        q["shadow_rays"] = q["first_shadow_rays"] = bake["shadow_rays"]
    return q


def n_chunks(settings, n_maps):
    """Number of jobs the surfaces are shared among: asked for, or by the rays the scene will need."""
    asked = settings["bake"]["chunks"]
    if asked != "auto":
        return int(asked)
    q = chosen_quality(settings["bake"])
    samples = n_maps * (2**q["base_direct"] + 1) ** 2
    rays = 3 * samples * SHADOW_RAYS + 3 * n_maps * (2 ** q["base_indirect"] + 1) ** 2 * q["gather_rays"]
    return int(min(MOST_CHUNKS, max(1, -(-rays // RAYS_A_JOB))))
