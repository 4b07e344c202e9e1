"""Materials of a Wavefront MTL: Kd, Ke and their textures.

Kd is taken as linear reflectance: the format (Wavefront, Advanced Visualizer, appendix B1) calls it reflectivity, and
files made from measured values (the Cornell box: 0.725 0.71 0.68) give them linear.  A program that writes what its
colour picker shows writes sRGB numbers; nothing in the file says so.  A texture is to be multiplied by Kd; a grey Kd
beside a texture counts as 1, because exporters leave their default there (0, 0.588, 0.64, 0.8).  Ke is a radiance;
times pi it is the exitance [W/m2], where map_Ke is white if there is one; a map_Ke without Ke has Ke 1.
"""

import math
import re
from pathlib import Path, PurePosixPath

from lib.formats.mesh_pictures import UNSEEN
from lib.formats.mistakes import listed

MAX_BYTES = 16 << 20
MAX_MATERIALS = 100_000
_TAKES = {  # options of a map and how many words follow
    "-blendu": 1, "-blendv": 1, "-cc": 1, "-clamp": 1, "-texres": 1, "-bm": 1, "-boost": 1, "-imfchan": 1, "-type": 1,
    "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-colorspace": 1,
}  # fmt: skip


def libraries(names, folder, pictures):
    """Read the libraries that `mtllib` lines name.

    names : texts after `mtllib`: one file name, blanks included, or several;  folder : of the OBJ
    pictures : mesh_pictures.Pictures, asked for the textures

    Returns ({name: material as under `materials` of scene.yaml}, list of notes).
    """
    materials, missing, notes = {}, [], []
    for text in dict.fromkeys(names):
        paths, absent = _files(text, Path(folder))
        missing += absent
        for path in paths:
            size = path.stat().st_size
            if size > MAX_BYTES:
                notes.append(f"{path.name} is not read: {size >> 20} MiB; allowed: at most {MAX_BYTES >> 20} MiB")
                continue
            found, faults = parse(path.read_bytes(), path.parent.relative_to(folder), pictures)
            materials = {**found, **materials}  # the first that names a material counts
            notes += [f"{path.name}: {fault}" for fault in faults]
    if missing:
        notes.append(f"no file {listed(dict.fromkeys(missing))}: its materials are grey")
    return materials, notes


def parse(data, folder, pictures):
    """Materials of an MTL's bytes: ({name: material}, list of faults); textures lie relative to `folder`."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    text = re.sub(r"\\[ \t]*\r?\n", " ", text)
    materials, faults, current, dark, glass = {}, [], None, [], []
    for number, line in enumerate(text.splitlines(), 1):
        word, _, rest = line.replace("\t", " ").strip().partition(" ")
        key, rest = word.lower(), rest.strip()
        if key == "newmtl":
            current = {} if rest not in materials and len(materials) < MAX_MATERIALS else None
            if current is not None:
                materials[rest] = current
        elif current is None:
            continue
        elif key in ("kd", "ke"):
            colour = _colour(rest)
            if colour is None:
                faults.append(f"line {number}: {word} '{rest[:40]}' is not three numbers from 0 on")
            else:
                current[key] = colour
        elif key in ("map_kd", "map_ke"):
            current[key] = _map(rest)
        elif key in ("d", "map_d"):
            current["see-through"] = current.get("see-through") or key == "map_d" or _is_see_through(rest)
    made = {}
    for name, found in materials.items():
        made[name] = _material(found, folder, pictures)
        if "map_ke" in found and max(found.get("ke", (1.0,))) > 0 and "emission" not in made[name]:
            dark.append(name)
        if found.get("see-through"):
            glass.append(name)
    if glass:
        faults.append(f"see-through materials are opaque: {listed(glass)}")
    if dark:
        faults.append(f"emission textures that can not be used; no light comes from {listed(dark)}")
    return made, faults


def _material(found, folder, pictures):
    """A material as under `materials` of scene.yaml from the lines of one `newmtl`."""
    colour = found.get("kd", (0.8, 0.8, 0.8) if "ke" not in found else (0.0, 0.0, 0.0))
    material = {"reflectance": [min(c, 1.0) for c in colour]}
    if "map_kd" in found:
        name, scale = found["map_kd"]
        path = _usable(name, folder, pictures)
        if path:
            material["texture"] = path
            if scale != (1.0, 1.0):
                material["repeat"] = list(scale)
            if len(set(colour)) == 1:
                del material["reflectance"]
        else:
            material["reflectance"] = [UNSEEN] * 3 if len(set(colour)) == 1 else [UNSEEN * c for c in colour]
    return material | _emission(found, material, folder, pictures)


def _emission(found, material, folder, pictures):
    """The part of a material that shines: Ke times pi, its picture where it has one.  A picture that repeats otherwise
    than the base texture has no place on the surface."""
    Ke = found.get("ke", (1.0,) * 3 if "map_ke" in found else (0.0,))
    if max(Ke) <= 0:
        return {}
    emission = {"emission": [math.pi * c for c in Ke]}
    if "map_ke" not in found:
        return emission
    name, scale = found["map_ke"]
    path = _usable(name, folder, pictures)
    if not path or ("texture" in material and list(scale) != material.get("repeat", [1.0, 1.0])):
        return {}
    repeat = {} if scale == (1.0, 1.0) else {"repeat": list(scale)}
    return {**emission, "emission_texture": path, **repeat}


def _usable(name, folder, pictures):
    return pictures.usable((PurePosixPath(folder) / name.replace("\\", "/")).as_posix() if name else "")


def _colour(rest):
    """Three numbers (one stands for all), or None."""
    words = rest.split("#")[0].split()
    try:
        values = [float(word) for word in words[:3]]
    except ValueError:
        return None
    values = values * 3 if len(values) == 1 else values
    return tuple(values) if len(values) == 3 and all(0 <= x <= 1e30 for x in values) else None


def _is_see_through(rest):
    """Is the dissolve of a `d` line below 1?

    >>> _is_see_through("0.5"), _is_see_through("-halo 1.0"), _is_see_through("1")
    (True, False, False)
    """
    words = rest.split("#")[0].split()
    try:
        return bool(words) and float(words[-1]) < 1.0
    except ValueError:
        return False


def _map(rest):
    """(file name, (repeat along s, t)) of a `map_Kd` line: options first, then a name that may hold blanks.

    >>> _map("-s 2 3 1 -clamp on my wall.png")
    ('my wall.png', (2.0, 3.0))
    """
    words, at, scale = rest.split(" "), 0, (1.0, 1.0)
    while at < len(words) and (words[at] == "" or words[at].lower() in _TAKES):
        option, at = words[at].lower(), at + 1
        taken = []
        for _ in range(_TAKES.get(option, 0)):
            # -s, -o and -t take one to three numbers.
            if at >= len(words) or (_TAKES[option] > 1 and not _is_number(words[at])):
                break
            taken.append(words[at])
            at += 1
        if option == "-s" and taken:
            first = [abs(float(word)) or 1.0 for word in taken] + [1.0]
            scale = (first[0], first[1])
    return " ".join(words[at:]).strip(), scale


def _is_number(word):
    return re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", word) is not None


def _files(text, folder):
    """Files that an `mtllib` text names: the whole of it if that is one, else its words; and names of missing ones."""
    whole = text.strip().strip('"').replace("\\", "/")
    inside = [name for name in (whole, PurePosixPath(whole).name) if _is_inside(name) and (folder / name).is_file()]
    if inside:
        return [folder / inside[0]], []
    found, missing, words = [], [], whole.split()
    for word in words:
        is_there = _is_inside(word) and (folder / word).is_file()
        found += [folder / word] if is_there else []
        missing += [] if is_there else [word]
    return (found, missing) if found else ([], [whole[:200]] if whole else [])


def _is_inside(name):
    path = PurePosixPath(name)
    return bool(name) and not path.is_absolute() and ".." not in path.parts and name.isprintable() and len(name) < 250
