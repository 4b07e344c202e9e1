"""Triangle meshes of a Wavefront OBJ: one surface for each material.

Read are v, vt, vn, f (absolute and relative indices, any number of corners), usemtl, mtllib, g and o; smoothing groups
and lines are passed over, colours at vertices, curves and surfaces are noted.  The format states no unit and no axes.
"""

from collections import Counter

import numpy as np

from lib.formats import mtl, names
from lib.formats.mesh_pictures import UNSEEN, Pictures
from lib.formats.mistakes import listed
from lib.formats.obj_lines import BadLine, Lines
from lib.formats.patches import MAX_PATCHES, GeometryFile, Patch, is_selected
from lib.surfaces.mesh_build import Dropped, mesh
from lib.surfaces.polygons import triangles

ARRAYS = ("v", "vt", "vn", "f")
SILENT = ("s", "l", "p", "lod", "bevel", "c_interp", "d_interp", "shadow_obj", "trace_obj", "usemap", "maplib", "mg")
FREE_FORM = tuple("curv curv2 surf vp cstype deg bmat step parm trim hole scrv sp end".split())
MOST_LABELS = 1000
PICTURED = {"texture", "emission_texture"}  # fields of a material that name pictures


def read(data, report, only=None, folder="."):
    """Read the bytes of an OBJ as a GeometryFile; mistakes go to `report` (see patches).

    only : pattern of materials, groups, objects or numbers: triangles of others are left out
    folder : where the file lies, for its materials and textures
    """
    if b"\0" in data:
        report.fatal("is not text (it holds zero bytes)")
    lines = Lines(data.removeprefix(b"\xef\xbb\xbf"))
    try:
        V, colour = np.split(lines.numbers("v", 3, 6)[0], [3], axis=1)
        texture, texture_lines = lines.numbers("vt", 1, 2)
        normal, normal_lines = lines.numbers("vn", 3, 3)
        corners, count, face_lines = lines.corners()
        if not len(count):
            report.fatal("holds no face (a line `f 1 2 3`)")
        line_of_corner = np.repeat(face_lines, count)
        at = [
            _absolute(corners[:, k], lines.of(word), line_of_corner, lines, word) for k, word in enumerate(ARRAYS[:3])
        ]
    except BadLine as error:
        report.fatal(str(error), line=error.number)
    words = _Words(lines, face_lines)
    pictures = Pictures(folder)
    materials, notes = mtl.libraries(words.libraries, folder, pictures)
    try:
        corner, face = triangles(V[at[0]], np.concatenate([[0], np.cumsum(count)]))
    except ValueError as error:
        number, _, what = str(error).removeprefix("polygon ").partition(": ")
        report.fatal(what, line=int(lines.number[face_lines[int(number)]]))
    source = _Source(V, colour, normal, texture, at, corner, face, words)
    patches, total, dropped = _patches(source, report, only)
    notes += report.notes() + dropped.sentences() + words.notes()
    used = {patch.material for patch in patches}
    absent = [name for name in used if name is not None and name not in materials]
    if absent and materials:
        notes.append(f"materials that no library defines, grey instead: {listed(sorted(absent))}")
    kept = {name: material for name, material in materials.items() if name in used}
    bare = [m for m in kept.values() if PICTURED & set(m) and not _has_texture(patches, kept, m)]
    for path in sorted({m[field] for m in bare for field in PICTURED & set(m)}):
        pictures.fault(path, "the mesh has no texture coordinates")
    for material in bare:
        if material.pop("texture", None):
            material.setdefault("reflectance", [UNSEEN] * 3)
        if material.pop("emission_texture", None):
            material.pop("emission")
        material.pop("repeat", None)
    return GeometryFile(patches, total, notes=notes + pictures.notes(), materials=kept)


def _has_texture(patches, materials, material):
    return any(p.surface.T is not None for p in patches if materials.get(p.material) is material)


class _Source:
    """Everything of a file that its surfaces are cut from: arrays, their corners and triangles, words per face."""

    def __init__(self, V, colour, normal, texture, at, corner, face, words):
        self.V, self.colour, self.normal, self.texture = V, colour, normal, texture
        self.at, self.corner, self.face, self.words = at, corner, face, words

    def is_coloured(self, keep):
        """Do the positions of the triangles `keep` (indices) have colours?"""
        return bool(self.colour[self.at[0][self.corner[keep]], 1:].any())  # a weight looks like red alone

    def mesh(self, keep):
        """(Mesh, Dropped) of the triangles `keep` (indices)."""
        at = [a[self.corner[keep]] for a in self.at]
        N = T = None
        if (at[2] >= 0).any():
            N = np.where((at[2] >= 0)[..., None], self.normal[at[2]], 0.0)
        if (at[1] >= 0).any():
            T = np.where((at[1] >= 0)[..., None], self.texture[at[1]], 0.0)
        return mesh(self.V, at[0], N, T)


def _patches(source, report, only):
    """Patches of the selected triangles by material, how many materials there are, and what was dropped."""
    words = source.words
    material = words.material[source.face]
    order = np.argsort(material, kind="stable")
    start = np.searchsorted(material[order], np.arange(len(words.materials) + 1))
    in_use = np.flatnonzero(np.diff(start))
    report.total = total = len(in_use)
    if total > MAX_PATCHES:
        report.fatal(f"{total} materials; allowed: at most {MAX_PATCHES}")
    patches, dropped, labels_seen = [], Dropped(), {}
    for number, k in enumerate(in_use.tolist(), 1):
        keep, name = order[start[k] : start[k + 1]], words.materials[k]
        own = (*([name] if name else []), str(number), names.padded(number, total))
        groups = np.unique(words.group[source.face[keep]])
        if not is_selected(own, only):
            labels_seen.update(dict.fromkeys([*own[:1], *(g for i in groups[:50] for g in words.groups[i])]))
            matching = [i for i in groups if is_selected(words.groups[i], only)]
            keep = keep[np.isin(words.group[source.face[keep]], matching)]
            groups = matching
            if not len(keep):
                continue
        made = report.surface(lambda keep=keep: source.mesh(keep), number)
        if made is None:
            continue
        if source.is_coloured(keep):
            report.coloured.append(report.of(number))
        surface, left_out = made
        dropped += left_out
        labels = dict.fromkeys([*own, *(label for i in groups for label in words.groups[i])])
        patches.append(Patch(number, surface, labels=tuple(labels)[:MOST_LABELS], material=name))
    if not patches and not len(report.mistakes):
        if only is None or report.flat:
            report.add("no triangle has an area")
        else:
            report.add(f"nothing matches '{only}'; materials, groups and objects: {listed(labels_seen)}", field="only")
    return patches, total, dropped


def _absolute(index, lines, line_of_corner, all_lines, word):
    """Indices from 0 of what corners name, -1 where they name nothing.

    index : as written, from 1, or from -1 backwards from what stands above;  lines : those that define
    """
    if word == "v" or index.any():
        above = np.searchsorted(lines, line_of_corner)
        found = np.where(index < 0, above + index, index - 1)
        if word != "v":
            found[index == 0] = -1
        bad = (found >= len(lines)) | ((found < 0) & ((index != 0) | (word == "v")))
        if bad.any():
            k = int(np.argmax(bad))
            known = f"1 to {len(lines)}" if len(lines) else f"there is no `{word}`"
            line = int(all_lines.number[line_of_corner[k]])
            raise BadLine(line, f"`{word}` {index[k]} is not there; allowed: {known}")
        return found
    return np.full(len(index), -1, dtype=np.int64)


class _Words:
    """What the lines with words say: material and group of each face, libraries, and kinds that are passed over."""

    def __init__(self, lines, face_lines):
        self.libraries, self.found = [], Counter()
        self.materials, self.groups = [None], [()]
        materials, groups, group, owner = {}, {}, (), ()
        changes = [(-1, 0, 0)]
        material_now = group_now = 0
        for index, text in lines.others(ARRAYS):
            word, _, rest = text.replace("\t", " ").partition(" ")
            rest = rest.strip()
            if word == "usemtl":
                material_now = materials.setdefault(rest, len(self.materials)) if rest else 0
                if material_now == len(self.materials):
                    self.materials.append(rest)
            elif word in ("g", "o"):
                if word == "g":
                    group = tuple(dict.fromkeys([*([rest] if rest else []), *rest.split()]))
                else:
                    owner, group = ((rest,) if rest else ()), ()
                labels = tuple(dict.fromkeys(owner + group))
                group_now = groups.setdefault(labels, len(self.groups))
                if group_now == len(self.groups):
                    self.groups.append(labels)
            elif word == "mtllib":
                self.libraries.append(rest)
                continue
            else:
                if word not in SILENT:
                    self.found["curve or surface"] += word in ("curv", "curv2", "surf")
                    self.found["line with an unknown word"] += word not in FREE_FORM
                continue
            changes.append((index, material_now, group_now))
        line, material, group = np.array(changes, dtype=np.int64).T
        at = np.searchsorted(line, face_lines) - 1
        self.material, self.group = material[at], group[at]

    def notes(self):
        plural = {"curve or surface": "curves and surfaces", "line with an unknown word": "lines with unknown words"}
        parts = [f"{n} {kind if n == 1 else plural.get(kind, kind)}" for kind, n in sorted(self.found.items()) if n]
        return [f"passed over: {', '.join(parts)}"] if parts else []
