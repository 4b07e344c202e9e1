"""Sum the light groups, B = rho_avg H, multiply the light of textured surfaces by their base texture over rho_avg, and
add the emission of surfaces that shine by a picture.

reads   scene.npz, light maps of every chunk, materials and textures JSON    (lib.formats.scene, .light_maps,
        .texture_rows; pictures)
        materials: {"rho_avg": {surface: [r, g, b]}}
        settings:  {"texture_level": 10, "intensity": {group: factor or [r, g, b]}}
writes  textured maps of all surfaces                                         (lib.formats.textured_maps)
        MAPS_FOLDER/<surface>.exr for each surface with a light map: B without base texture and emission, full size
"""

import hashlib
from pathlib import Path

import numpy as np

from lib import door
from lib.elements.lattice import roots_of
from lib.formats import light_maps, pictures, scene, texture_rows, textured_maps
from lib.formats.artefact import read_json
from lib.maps import base_texture
from lib.maps import emission as shine
from lib.maps.fill import one_deep
from lib.maps.mapset import pack, side_lengths
from lib.refusal import Refusal
from lib.surfaces.measure import collapsed_sides, extent, is_closed, map_domain


def arguments(parser):
    parser.add_argument("--scene", required=True, metavar="FILE", help="scene.npz")
    parser.add_argument("--maps", required=True, nargs="+", metavar="FILE", help="light maps of every chunk")
    parser.add_argument("--materials", required=True, metavar="FILE", help="JSON: rho_avg of every surface")
    parser.add_argument("--textures", required=True, metavar="FILE", help="JSON: base textures")
    parser.add_argument("--settings", type=door.json_text, default={}, metavar="JSON", help="texture_level, intensity")
    parser.add_argument("--maps-folder", required=True, metavar="FOLDER", help="where the EXR maps go")
    parser.add_argument("--out", required=True, metavar="FILE", help="textured maps of all surfaces")


def body(args, cost):
    x = scene.load(args.scene)
    chunk = light_maps.merge([light_maps.load(path) for path in args.maps])
    rho_avg = read_json(args.materials)["rho_avg"]
    textures, emission = texture_rows.read(args.textures)
    texture_level = checked_level(args.settings.get("texture_level", 10))
    weights = group_weights(x.groups, args.settings.get("intensity", {}), chunk.maps.value.shape[1])

    loaded, used = {}, {}
    shown = sorted({*chunk.maps.surface.tolist(), *(s for s, name in enumerate(x.names) if name in emission)})
    roots, light, final = [], [], []  # level, value, hidden of each
    for s in shown:
        name, surface, k = x.names[s], x.surfaces[s], chunk.maps.position(s)
        if k >= 0:
            own, level, hidden = chunk.maps.roots[k], int(chunk.maps.level[k]), chunk.maps.hidden_map(k)
            H = np.einsum("jigc,gc->jic", chunk.maps.map(k).astype(np.float64), weights)
            B = np.where(hidden[..., None], np.float32(0), base_texture.reflected(H, rho_avg[name]))
            write_map(Path(args.maps_folder) / f"{x.files[s]}.exr", B, hidden, name, surface, rho_avg[name])
        else:  # reflects nothing, or only casts shadows
            own, level = roots_of(extent(surface)), 0
            w, h = side_lengths(own, level)
            B, hidden = np.zeros((h, w, 3), np.float32), np.zeros((h, w), bool)
        roots.append(own)
        light.append((level, B, hidden))
        painted = [
            (row, load_picture(row, name, *kind, loaded, used)) for row, *kind in layers(name, textures, emission)
        ]
        for row, picture in painted:
            common = base_texture.level_on_map(surface, own, level, picture.shape[1::-1], row["repeat"], texture_level)
            B, hidden = base_texture.upsample(B, hidden, common - level)
            level = common
        if name in textures:
            row, picture = painted[0]
            B, hidden = textured(
                B, hidden, surface, picture, row["repeat"], picture_average(rho_avg[name], row.get("factor"))
            )
        if name in emission:
            row, picture = painted[-1]
            B, hidden = lit(B, hidden, surface, picture, row["repeat"], weights[x.group[s]] * row["factor"])
        final.append((level, B, hidden))

    sweep(Path(args.maps_folder), {x.files[s] for s in chunk.maps.surface})

    names = [x.names[s] for s in shown]
    is_shining = np.array([name in emission for name in names], bool)
    cost.notes["textured_surfaces"] = sum(name in textures for name in names)
    textured_maps.save(
        args.out,
        textured_maps.TexturedMaps(
            names=names,
            light=pack(shown, roots, *([one[k] for one in light] for k in range(3))),
            final=pack(shown, roots, *([one[k] for one in final] for k in range(3))),
            E=np.where(is_shining[:, None], 0.0, (x.E * weights[x.group])[shown]),
            rho_avg=np.array([rho_avg[name] for name in names], np.float64).reshape(-1, 3),
            textured=is_shining | np.array([name in textures for name in names], bool),
            pictures=used,
            stats=chunk.stats,
            shining=[name for name in names if name in emission],
        ),
    )


def layers(name, textures, emission):
    """(row, field, largest value) of the pictures of a surface, its base texture first."""
    if name in textures:
        yield textures[name], "texture", 1.0
    if name in emission:
        yield emission[name], "emission_texture", pictures.ANY


def checked_level(level):
    """The setting texture_level, a whole number from 0 to 14; Refusal otherwise."""
    if isinstance(level, bool) or not isinstance(level, int) or not 0 <= level <= 14:
        raise Refusal(f"texture_level: {level!r}, allowed are whole numbers from 0 to 14")
    return level


def group_weights(groups, intensity, n_groups):
    """Return (G, 3) factors of the light groups: 1 unless `intensity` names the group."""
    if len(groups) != n_groups:
        raise ValueError(f"light maps hold {n_groups} groups, the scene {len(groups)}: {groups}")
    weights = np.ones((n_groups, 3))
    for name, factor in intensity.items():
        if name not in groups:
            raise Refusal(f"intensity: {name}: no such light group, the scene has {', '.join(groups)}")
        try:
            weights[list(groups).index(name)] = factor
        except (TypeError, ValueError):
            raise Refusal(f"intensity: {name}: {factor!r}, expected a number or three >= 0") from None
    if not (np.isfinite(weights) & (weights >= 0)).all():
        raise Refusal(f"intensity: {intensity}, expected finite numbers >= 0")
    return weights


def picture_average(rho_avg, factor):
    """Average of a picture alone, of a surface whose reflectance is the picture times `factor` (3,), or None."""
    if factor is None:
        return rho_avg
    return np.divide(rho_avg, factor, out=np.zeros(3), where=np.asarray(factor) > 0)


def load_picture(row, name, field, most, loaded, used):
    """Return the picture of a row, read once; notes the size of a base texture under the hash of its bytes."""
    key = row["file"], row["colour_space"], most
    if key not in loaded:
        try:
            loaded[key] = pictures.read_linear(row["file"], row["colour_space"], most=most)
            digest = hashlib.sha256(Path(row["file"]).read_bytes()).hexdigest()
        except Refusal as error:
            raise Refusal(f"surface {name}: {field}: {error}") from None
        used[digest] = [loaded[key].shape[1], loaded[key].shape[0]]
    return loaded[key]


def textured(B, hidden, surface, picture, repeat, rho_avg):
    """Return (B_final, hidden) of a map that is fine enough for the picture.

    The light of a finer crossing is what the light map shows there, so it mixes charts of a mesh no more than that.
    """
    rho, outside = base_texture.on_map(surface, picture, repeat, *hidden.shape[::-1])
    return base_texture.apply(B, rho, rho_avg), hidden | outside


def lit(B, hidden, surface, picture, repeat, factor):
    """Return (B + E, hidden) of a map; E (h, w, 3) is a picture times `factor` (3,) [W/m^2]."""
    value, outside = shine.on_map(surface, picture, repeat, *hidden.shape[::-1])
    return (B + value * factor).astype(np.float32), hidden | outside


def sweep(folder, stems):
    """Remove the maps of surfaces that the scene no longer has."""
    for path in folder.glob("*.exr"):
        if path.stem not in stems:
            path.unlink()


def write_map(path, B, hidden, name, surface, rho_avg):
    """Write the illumination map of one surface; B is 0 where hidden."""
    if hidden.any():  # only then it matters how the surface closes, which is long to find out
        B = one_deep(B, hidden, is_closed(surface), collapsed_sides(surface))
    pictures.write_exr(
        path,
        B,
        {
            "surface": name,
            "unit": "W/m^2",
            "quantity": "reflected radiosity B without base texture",
            "convention": "texel (i, j) is the sample at u = i/(W-1), v = j/(H-1); first row is v = 0",
            "uv_domain": map_domain(surface),
            "rho_avg": tuple(rho_avg),
        },
    )


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
