"""Which pictures lie on which surfaces: textures-<hash>.json among the settings of a scene's results.

{"textures": {surface: row}, "emission": {surface: row}}; a row has file, colour_space, repeat [n, m] and digest; of an
emission picture also factor [r, g, b], W/m^2 where it is white.  Paths are relative to the scene's folder, which
folder.json beside it names, so that results can be moved with it.
"""

from pathlib import Path

from lib.formats.artefact import read_json


def read(path):
    """(base textures, emission pictures): {surface: row} each, with absolute paths."""
    rows, folder_file = read_json(path), Path(path).parent / "folder.json"
    return tuple(_located(rows.get(kind, {}), folder_file) for kind in ("textures", "emission"))


def _located(textures, folder_file):
    if all(Path(row["file"]).is_absolute() for row in textures.values()):
        return textures
    folder = Path(read_json(folder_file)["folder"])
    return {
        name: row if row.get("embedded") else {**row, "file": str(folder / row["file"])}
        for name, row in textures.items()
    }
