"""Irradiance at the reference points from a light map baked by Cycles on the CPU and denoised by Open Image Denoise.

Run by a Python that has bpy:  python peers/blender.py FOLDER_OF_A_REFERENCE_SCENE OUT.npz --texels N --samples S

Every surface has a block of an atlas, its sides in proportion to its mean lengths along u and v.  The block's texels
tile the surface's uv square, as light-map unwraps do.  Cycles bakes the diffuse light, direct and indirect, without
colour, which is irradiance / pi.  Every block is denoised on its own, mirrored at its borders: 10 to 20 % less error
than the atlas in one piece. The points read it bilinearly, clamped to their own block.
"""

import argparse
import ctypes
import json
import os
import sys
from pathlib import Path


def cpu():
    """CPU seconds of this process so far."""
    t = os.times()
    return t.user + t.system


import bpy  # noqa: E402
import numpy as np  # noqa: E402

IMPORTED = cpu()
GAP = 4  # texels between blocks
POWER = (
    1 / 8
)  # texels go with area^(3/4): the least error of 0, 1/8, 1/4 in the room, where even texels starve the teapot
AROUND = 16  # texels mirrored round a block for the denoiser


def lengths(V, F, UV):
    """Mean lengths of a triangulated surface along u and v: means of |dS/du| and |dS/dv| over its uv area."""
    p, q = V[F], UV[F]
    e1, e2, f1, f2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
    det = f1[:, 0] * f2[:, 1] - f1[:, 1] * f2[:, 0]
    keep = np.abs(det) > 1e-12
    det = np.where(keep, det, 1)[:, None]
    S_u, S_v = (e1 * f2[:, 1:] - e2 * f1[:, 1:]) / det, (e2 * f1[:, :1] - e1 * f2[:, :1]) / det
    weight = np.abs(det[:, 0]) * keep
    return [float((np.linalg.norm(d, axis=1) * weight).sum() / weight.sum()) for d in (S_u, S_v)]


def atlas(extents, texels, least):
    """Blocks [(x, y, w, h)] of about `texels` in all, no side shorter than `least`, and the side of the square atlas
    that holds them: rows of falling height."""
    density = 1.2 * np.sqrt(texels / sum((a * b) ** (1 - 2 * POWER) for a, b in extents))
    sizes = [(texels, 2)]
    while sum(w * h for w, h in sizes) > texels and density > 0:
        density *= 0.99
        each = [density * (a * b) ** -POWER for a, b in extents]
        sizes = [(max(least, round(a * d)), max(least, round(b * d))) for d, (a, b) in zip(each, extents, strict=True)]
        if all(max(size) == least for size in sizes):
            break
    side = int(np.ceil(np.sqrt(1.05 * sum((w + GAP) * (h + GAP) for w, h in sizes))))
    while True:
        blocks, x, y, row = {}, 0, 0, 0
        for k in sorted(range(len(sizes)), key=lambda k: -sizes[k][1]):
            w, h = sizes[k][0] + GAP, sizes[k][1] + GAP
            if x + w > side:
                x, y, row = 0, y + row, 0
            row = max(row, h)
            blocks[k] = (x + GAP // 2, y + GAP // 2, w - GAP, h - GAP)
            x += w
        if y + row <= side and max(w for w, _ in sizes) + GAP <= side:
            return [blocks[k] for k in range(len(sizes))], side
        side = int(side * 1.03) + 1


def build(data, mesh, blocks, side):
    """The scene in Blender: one object, a material a surface, uv in the atlas; returns the image that is baked."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    V, F, UV, N = (mesh[key] for key in ("V", "F", "UV", "N"))
    me = bpy.data.meshes.new("scene")
    me.vertices.add(len(V))
    me.vertices.foreach_set("co", V.ravel())
    me.loops.add(F.size)
    me.loops.foreach_set("vertex_index", F.ravel())
    me.polygons.add(len(F))
    me.polygons.foreach_set("loop_start", np.arange(0, F.size, 3, dtype=np.int32))
    uv, material = np.zeros((len(V), 2), dtype=np.float32), np.zeros(len(F), dtype=np.int32)
    image = bpy.data.images.new("light", side, side, float_buffer=True, is_data=True)
    for k, surface in enumerate(data["surfaces"]):
        x, y, w, h = blocks[k]
        mine = slice(surface["face_begin"], surface["face_end"])
        used = np.unique(F[mine])
        uv[used] = (np.array([x, y]) + UV[used] * [w, h]) / side
        material[mine] = k
        me.materials.append(matter(surface, image))
    me.polygons.foreach_set("material_index", material)
    layer = me.uv_layers.new(name="atlas")
    layer.data.foreach_set("uv", uv[F].ravel())
    me.update(calc_edges=True)
    me.validate(clean_customdata=False)
    me.shade_smooth()
    me.normals_split_custom_set_from_vertices(N)
    thing = bpy.data.objects.new("scene", me)
    bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    bpy.context.scene.world = bpy.data.worlds.new("dark")
    bpy.context.scene.world.use_nodes = True
    for node in bpy.context.scene.world.node_tree.nodes:
        if node.type == "BACKGROUND":
            node.inputs["Strength"].default_value = 0.0
    return image


def matter(surface, image):
    """A diffuse material, or a lamp, with the baked image as its active node."""
    material = bpy.data.materials.new(surface["name"])
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    out = nodes.new("ShaderNodeOutputMaterial")
    if max(surface["emission"]) > 0:
        shader = nodes.new("ShaderNodeEmission")
        top = max(surface["emission"])
        shader.inputs["Color"].default_value = (*(e / top for e in surface["emission"]), 1)
        shader.inputs["Strength"].default_value = top
    else:
        shader = nodes.new("ShaderNodeBsdfDiffuse")
        shader.inputs["Color"].default_value = (*surface["rho"], 1)
    links.new(shader.outputs[0], out.inputs["Surface"])
    picture = nodes.new("ShaderNodeTexImage")
    picture.image = image
    nodes.active = picture
    return material


def bake(image, samples, bounces, seed, threads):
    """Diffuse light without colour, (side, side, 3): irradiance / pi, rows from the bottom."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", threads
    c = scene.cycles
    c.device, c.samples, c.seed = "CPU", samples, seed
    c.use_adaptive_sampling = False
    c.max_bounces, c.diffuse_bounces = bounces, bounces
    c.sample_clamp_indirect = c.sample_clamp_direct = 0.0
    bpy.ops.object.bake(
        type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT"}, margin=GAP // 2, margin_type="EXTEND", use_clear=True
    )
    pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)[..., :3].copy()


class Denoiser:
    """Open Image Denoise over HDR pictures, from the library that comes with bpy: its light-map filter, or the usual
    one where that is left out."""

    def __init__(self):
        found = [
            path
            for above in Path(bpy.__file__).parents[:5]
            for path in sorted(above.glob("lib/libOpenImageDenoise.so*"))
        ]
        if not found:
            raise SystemExit("no Open Image Denoise beside bpy")
        self._oidn = ctypes.CDLL(str(found[0]))
        pointer, size, text = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
        for name, result, arguments in (
            ("oidnNewDevice", pointer, [ctypes.c_int]),
            ("oidnCommitDevice", None, [pointer]),
            ("oidnNewFilter", pointer, [pointer, text]),
            ("oidnReleaseFilter", None, [pointer]),
            ("oidnSetSharedFilterImage", None, [pointer, text, pointer, ctypes.c_int, *[size] * 5]),
            ("oidnSetFilterBool", None, [pointer, text, ctypes.c_bool]),
            ("oidnCommitFilter", None, [pointer]),
            ("oidnExecuteFilter", None, [pointer]),
            ("oidnGetDeviceError", ctypes.c_int, [pointer, ctypes.POINTER(text)]),
        ):
            function = getattr(self._oidn, name)
            function.restype, function.argtypes = result, arguments
        self._device = self._oidn.oidnNewDevice(1)  # the CPU
        self._oidn.oidnCommitDevice(self._device)
        empty = np.zeros((16, 16, 3), dtype=np.float32)
        self.kind = next((k for k in ("RTLightmap", "RT") if self._run(k, empty) is not None), None)
        if not self.kind:
            raise SystemExit("Open Image Denoise beside bpy has no filter that works")

    def _run(self, kind, colour):
        oidn, (h, w) = self._oidn, colour.shape[:2]
        chosen = oidn.oidnNewFilter(self._device, kind.encode())
        source, out = np.ascontiguousarray(colour, dtype=np.float32), np.zeros((h, w, 3), dtype=np.float32)
        if chosen:
            for name, array in ((b"color", source), (b"output", out)):
                oidn.oidnSetSharedFilterImage(chosen, name, array.ctypes.data, 3, w, h, 0, 0, 0)
            if kind == "RT":
                oidn.oidnSetFilterBool(chosen, b"hdr", True)
            oidn.oidnCommitFilter(chosen)
            oidn.oidnExecuteFilter(chosen)
            oidn.oidnReleaseFilter(chosen)
        failed = oidn.oidnGetDeviceError(self._device, ctypes.byref(ctypes.c_char_p()))
        return None if failed else out

    def __call__(self, picture, blocks):
        """The picture (h, w, 3) with every block denoised."""
        out = picture.copy()
        for x, y, w, h in blocks:
            mode = "reflect" if min(w, h) > AROUND else "symmetric"
            padded = np.pad(picture[y : y + h, x : x + w], ((AROUND, AROUND), (AROUND, AROUND), (0, 0)), mode=mode)
            out[y : y + h, x : x + w] = self._run(self.kind, padded)[AROUND:-AROUND, AROUND:-AROUND]
        return out


def look_up(picture, blocks, surface, uv):
    """Bilinear lookup (k, 3), texel centres at (i + 0.5) / w of the block, clamped to it."""
    out = np.empty((len(uv), 3))
    for k, (x, y, w, h) in enumerate(blocks):
        mine = np.flatnonzero(surface == k)
        s, t = np.clip(uv[mine, 0] * w - 0.5, 0, w - 1), np.clip(uv[mine, 1] * h - 0.5, 0, h - 1)
        i, j = np.minimum(s.astype(int), w - 2), np.minimum(t.astype(int), h - 2)
        a, b = (s - i)[:, None], (t - j)[:, None]
        T = picture[y : y + h, x : x + w]
        out[mine] = (T[j, i] * (1 - a) + T[j, i + 1] * a) * (1 - b) + (T[j + 1, i] * (1 - a) + T[j + 1, i + 1] * a) * b
    return out


def main():
    """Bake, denoise, read; prints one line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--texels", type=int, default=100_000)
    parser.add_argument("--least", type=int, default=40, help="texels of a side: small curved surfaces need some")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--bounces", type=int, default=64)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    args = parser.parse_args(sys.argv[1:])
    begin = cpu()
    data, mesh, points = (
        json.loads((args.scene / "scene.json").read_text()),
        np.load(args.scene / "mesh.npz"),
        np.load(args.scene / "points.npz"),
    )
    V, F, UV = mesh["V"], mesh["F"], mesh["UV"]
    extents = [lengths(V, F[s["face_begin"] : s["face_end"]], UV) for s in data["surfaces"]]
    blocks, side = atlas(extents, args.texels, args.least)
    image = build(data, mesh, blocks, side)
    built = cpu()
    noisy = bake(image, args.samples, args.bounces, args.seed, args.threads)
    baked = cpu()
    denoiser = Denoiser()
    clean = denoiser(noisy, blocks)
    denoised = cpu()
    E = {
        name: np.pi * look_up(p, blocks, points["surface"], points["uv"])
        for name, p in (("E", clean), ("noisy", noisy))
    }
    np.savez(args.out, **E)
    done = {
        "version": bpy.app.version_string,
        "filter": denoiser.kind,
        "texels": sum(w * h for *_, w, h in blocks),
        "side": side,
    }
    spent = {"import": IMPORTED, "build": built - begin, "bake": baked - built, "denoise": denoised - baked}
    print("\n" + json.dumps(done | {f"cpu_{k}": round(v, 3) for k, v in spent.items()}))


if __name__ == "__main__":
    main()
