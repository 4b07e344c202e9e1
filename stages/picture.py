"""Draw an exported file as an unlit viewer shows it, by ray casting: a look at a bake without a viewer.

reads   --gltf scene_LOD<k>.gltf with its .bin and textures, or a .glb     (lib.formats.exported)
writes  --out PICTURE.png

The camera is JSON, {"eye": [x, y, z], "target": [x, y, z], "fov": 50}, in metres and y up as in the exported file
(fov is the vertical angle), or "auto".
"""

import json

from lib import door
from lib.formats import exported, pictures
from lib.refusal import Refusal
from lib.report import camera as cameras
from lib.report import picture


def arguments(parser):
    parser.add_argument("--gltf", required=True, help="exported .gltf or .glb")
    parser.add_argument("--out", required=True, help="PNG to write")
    parser.add_argument(
        "--camera", default="auto", help='JSON {"eye": [x, y, z], "target": [x, y, z], "fov": 50} or auto'
    )
    parser.add_argument("--size", default="960x600", help="width x height in pixels")
    parser.add_argument("--samples", type=int, default=2, help="rays a pixel, per direction")
    parser.add_argument("--edges", type=float, default=0.0, help="share by which triangle edges are darkened")


def body(args, cost):
    try:
        width, height = (int(n) for n in args.size.lower().split("x"))
        if not (0 < width <= 8192 and 0 < height <= 8192 and 1 <= args.samples <= 8):
            raise ValueError
    except ValueError:
        raise Refusal(
            f"--size {args.size}, --samples {args.samples}: expected like 960x600, up to 8192 a side, "
            "and 1 to 8 samples"
        ) from None
    parts, textures = exported.load(args.gltf)
    model = picture.join(parts)
    view = _camera(args.camera) or cameras.automatic(model)
    image = picture.render_with_edges(model, textures, view, width, height, args.samples, edges=args.edges)[1]
    cost.notes["picture_rays"] = width * height * args.samples**2  # not rays of the bake
    pictures.write_png8(args.out, image)


def _camera(text):
    """The camera named, None for auto."""
    if text == "auto":
        return None
    try:
        given = json.loads(text)
        view = cameras.Camera(tuple(given["eye"]), tuple(given["target"]), float(given.get("fov", 50)))
        view.rays(1, 1)
        return view
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise Refusal(f"--camera {text}: {error}, expected auto or JSON with eye, target and fov") from None


def main(argv=None):
    return door.run(__doc__, arguments, body, argv)


if __name__ == "__main__":
    raise SystemExit(main())
