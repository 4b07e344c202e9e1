"""Write conference.glb from conference.obj: the same triangles in a sixth of the bytes.

    python data/scenes/conference/make_glb.py CONFERENCE.OBJ      from the root of the repository

One node for each material, called by one of its groups.  Positions are welded and of 32 bits, 0.2 micrometres of the
room; indices have 16 bits where they fit; Kd is the base colour.  The OBJ has neither normals nor textures.
"""

import json
import struct
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))
from lib.formats import geometry_file

FLOAT, SHORT, INT = 5126, 5123, 5125
VERTICES, INDICES = 34962, 34963


def main(source):
    content = geometry_file.read(source, source, "conference")
    names = [patch.material for patch in content.patches]
    made = {"asset": {"version": "2.0", "copyright": "Anat Grynberg and Greg Ward; Kenzie Lamar. Public domain"}}
    made |= {"scene": 0, "scenes": [{"nodes": list(range(len(names)))}], "nodes": [], "meshes": []}
    made |= {"materials": [], "accessors": [], "bufferViews": []}
    pieces = []
    for k, patch in enumerate(content.patches):
        mesh = patch.surface
        kind, component = ("<u2", SHORT) if len(mesh.V) < 65535 else ("<u4", INT)
        position = _accessor(made, pieces, mesh.V.astype("<f4"), "VEC3", FLOAT, VERTICES)
        index = _accessor(made, pieces, mesh.F.astype(kind).ravel(), "SCALAR", component, INDICES)
        primitive = {"attributes": {"POSITION": position}, "indices": index, "material": k}
        label = next(label for label in (*patch.labels[2:], names[k]) if not label.isdigit())
        made["nodes"].append({"name": label, "mesh": k})
        made["meshes"].append({"name": label, "primitives": [primitive]})
        colour = [*content.materials[names[k]]["reflectance"], 1.0]
        surface = {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 1.0}
        made["materials"].append({"name": names[k], "pbrMetallicRoughness": surface})
    binary = b"".join(pieces)
    made["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(made, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    Path(__file__).with_name("conference.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def _accessor(made, pieces, values, kind, component, target):
    """Append an array to the buffer and its accessor to the JSON; the accessor's number."""
    data = values.tobytes()
    start = sum(len(piece) for piece in pieces)
    pieces.append(data + b"\0" * (-len(data) % 4))
    view = {"buffer": 0, "byteOffset": start, "byteLength": len(data), "target": target}
    found = {"bufferView": len(made["bufferViews"]), "componentType": component, "count": len(values), "type": kind}
    if kind == "VEC3":
        found |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
    made["bufferViews"].append(view)
    made["accessors"].append(found)
    return len(made["accessors"]) - 1


if __name__ == "__main__":
    main(sys.argv[1])
