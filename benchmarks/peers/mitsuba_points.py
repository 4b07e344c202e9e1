"""Irradiance at the reference points alone, path traced by Mitsuba 3: no maps, no surfaces between the points.

Run by a Python that has mitsuba:  python peers/mitsuba_points.py FOLDER_OF_A_REFERENCE_SCENE OUT.npz --samples N

A ray is sent at every point from just above it; of the radiance L it finds there, irradiance is pi L / rho, with the
path integrator's own sampling of the lights at every bounce, the first included.  The vectorised LLVM variant is used
where it works (DRJIT_LIBLLVM_PATH names the library), else scalar_rgb.
"""

import argparse
import json
import os
from pathlib import Path


def cpu():
    """CPU seconds of this process so far."""
    t = os.times()
    return t.user + t.system


import mitsuba as mi  # noqa: E402
import numpy as np  # noqa: E402

IMPORTED = cpu()
AT_ONCE = 2**22  # paths


def surfaces(data, mesh):
    """{key: mesh} with smooth normals, diffuse reflectance and emission."""
    V, F, N = mesh["V"], mesh["F"], mesh["N"]
    out = {}
    for k, s in enumerate(data["surfaces"]):
        faces = F[s["face_begin"] : s["face_end"]]
        first, end = int(faces.min()), int(faces.max()) + 1
        props = mi.Properties()
        props["matter"] = mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": s["rho"]}})
        if max(s["emission"]) > 0:
            props["lamp"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": s["emission"]}})
        shape = mi.Mesh(f"s{k}", end - first, len(faces), props=props, has_vertex_normals=True)
        held = mi.traverse(shape)
        held["vertex_positions"], held["vertex_normals"] = V[first:end].ravel(), N[first:end].ravel()
        held["faces"] = (faces - first).astype(np.uint32).ravel()
        held.update()
        out[f"s{k}"] = shape
    return out


def scalar(world, origins, directions, samples, seed):
    """Radiance along rays (n, 3) by a batch of one-ray sensors."""
    n = len(origins)
    film = {
        "type": "hdrfilm",
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
        "component_format": "float32",
        "height": 1,
    }
    sensor = {"type": "batch", "film": film | {"width": n}, "sampler": {"type": "multijitter", "sample_count": samples}}
    for k in range(n):
        ray = {"origin": origins[k].tolist(), "direction": directions[k].tolist(), "film": film | {"width": 1}}
        sensor[f"p{k:06d}"] = {"type": "radiancemeter", **ray}
    scene = mi.load_dict(world | {"sensor": sensor})
    return np.array(mi.render(scene, spp=samples, seed=seed))[0]


def vectorised(world, origins, directions, samples, seed):
    """The same by waves of rays through the integrator."""
    scene, n = mi.load_dict(world), len(origins)
    wave = max(1, min(samples, AT_ONCE // n))
    total, done = np.zeros((n, 3)), 0
    while done < samples:
        sampler = mi.load_dict({"type": "multijitter", "sample_count": wave})
        wave = sampler.sample_count()
        sampler.set_samples_per_wavefront(wave)
        sampler.seed(seed * 1000 + done, n * wave)
        point = np.repeat(np.arange(n), wave)
        at, to = (np.ascontiguousarray(a[point].T, dtype=np.float32) for a in (origins, directions))
        light, _, _ = scene.integrator().sample(scene, sampler, mi.RayDifferential3f(mi.Point3f(at), mi.Vector3f(to)))
        total += np.array(light).T.reshape(n, wave, 3).sum(axis=1)
        done += wave
    return total / done


def main():
    """Trace; prints one line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--variant", choices=["llvm_ad_rgb", "scalar_rgb"], required=True)
    args = parser.parse_args()
    begin = cpu()
    mi.set_variant(args.variant)
    mi.Thread.set_thread_count(args.threads) if hasattr(mi.Thread, "set_thread_count") else None
    data, mesh = json.loads((args.scene / "scene.json").read_text()), np.load(args.scene / "mesh.npz")
    points = np.load(args.scene / "points.npz")
    N, offset = points["N"].astype(float), data["point_offset"]
    # A little aside: points on vertices of the mesh are met by no ray aimed straight at them.
    aside = np.cross(N, [0.36, 0.48, 0.8])
    aside /= np.linalg.norm(aside, axis=1)[:, None]
    origins = points["P"] + offset * (N + 0.4 * aside)
    world = {"type": "scene", "integrator": {"type": "path", "max_depth": -1}, **surfaces(data, mesh)}
    trace = scalar if args.variant.startswith("scalar") else vectorised
    L = trace(world, origins, -N, args.samples, args.seed)
    rho = np.array([s["rho"] for s in data["surfaces"]])[points["surface"]]
    np.savez(args.out, E=np.pi * L / rho)
    print(
        "\n"
        + json.dumps(
            {
                "version": mi.__version__,
                "variant": args.variant,
                "cpu_import": round(IMPORTED, 3),
                "cpu_rest": round(cpu() - begin, 3),
            }
        )
    )


if __name__ == "__main__":
    main()
