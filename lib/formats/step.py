"""Faces of a STEP or IGES file, with its assemblies, names and colours; converted in a process of its own.

The converter (step_faces, which needs the extra `step`) may crash or hang on a file: then the file is refused, and
this process goes on.
"""

import re
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lib.formats import names, step_result
from lib.formats.artefact import ArtefactError
from lib.formats.mistakes import listed
from lib.formats.patches import MAX_PATCHES, GeometryFile, Patch, is_selected
from lib.maps.colour import linear_to_srgb
from lib.nurbs.shape import transformed
from lib.surfaces.significance import significance
from lib.surfaces.trim_build import EdgeUse, trimmed

if TYPE_CHECKING:  # never loaded here, but an edit there changes what this returns
    from lib.formats import step_faces  # noqa: F401

ROOT = Path(__file__).resolve().parents[2]
COMMAND = (sys.executable, "-m", "lib.formats.step_faces")
SECONDS = 300  # for the conversion of one file
METRES = 0.001  # the converter brings every unit to millimetres
EXTRA = 'needs the extra: .venv/bin/pip install ".[step]"'
GAP_TOLD, GAP_REFUSED = 1e-4, 1e-2  # of a face's size: edges farther than this from their surface
TAIL = 4000  # bytes of the converter's messages that are looked at


def read(path, data, report, only=None, trims="keep"):
    """Read the STEP or IGES file at `path`, whose bytes are `data`, as a GeometryFile; mistakes go to `report`.

    trims : "keep", "skip" or "refuse" faces with trims

    Faces are numbered in the order of the file over all parts where they stand, whatever `only` and `trims` leave out.
    """
    faces = _converted(Path(path), report)
    where = [(place, face) for place in faces.instances for face in _faces_of(faces, place)]
    report.total = len(where)
    if not where:
        report.fatal(f"holds no face{_found(faces.notes)}")
    if len(where) > MAX_PATCHES:
        report.fatal(f"holds {len(where)} faces; allowed: at most {MAX_PATCHES}")
    return _Patches(faces, report, only, trims).read(where)


def _converted(path, report):
    """StepFaces of the file, converted in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="step_") as folder:
        out = Path(folder) / "faces.npz"
        complaint = _run(path.resolve(), out, Path(folder) / "messages")
        if complaint:
            report.fatal(complaint, field="file")
        try:
            faces = step_result.load(out)
        except ArtefactError as error:
            report.fatal(f"its conversion gave no result ({str(error).removeprefix(f'{out}: ')})", field="file")
    return faces


def _run(path, out, messages):
    """Run the converter; why it failed, or None."""
    with open(messages, "wb") as log:
        child = subprocess.Popen(
            [*COMMAND, str(path), str(out)],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=log,
        )
        try:
            status = child.wait(SECONDS)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            child.kill()  # nothing happens if it has ended
            child.wait()
    if status == 0:
        return None
    said = messages.read_bytes()[-TAIL:].decode("utf-8", "replace").splitlines()
    last = next((line.strip() for line in reversed(said) if line.strip()), "")
    at = next((f", {line}" for line in reversed(said) if re.fullmatch(r"at face \d+ of \d+: \w+", line)), "")
    if status is None:
        return f"its conversion was stopped after {SECONDS} s{at}"
    if status < 0:
        name = signal.Signals(-status).name if -status in set(signal.Signals) else f"signal {-status}"
        return f"its conversion crashed ({name}{at})"
    if last.startswith("refused: "):
        return last.removeprefix("refused: ")
    if "No module named 'OCP'" in last:
        return EXTRA
    return f"its conversion failed{at}: {last or f'status {status}'}"


def _faces_of(faces, place):
    return range(*faces.face_first[place["shape"] : place["shape"] + 2].tolist())


def _found(notes):
    return f"; it holds {', '.join(notes)}" if notes else ""


class _Patches:
    """From faces of parts to patches where the parts stand."""

    def __init__(self, faces, report, only, trims):
        self.faces, self.report, self.only, self.trims = faces, report, only, trims
        self.colours = [_colour_name(rgb) for rgb in faces.colours]
        self.has_trims = np.zeros(faces.body.max(initial=-1) + 1, dtype=bool)
        self.has_trims[faces.body[faces.is_trimmed]] = True
        self.lines = {}  # of the edges of the part at hand where it stands

    def read(self, where):
        """GeometryFile of the faces `where`, pairs of an instance and a face."""
        patches, left_out, far, labels_seen, place_before = [], [], [], {}, None
        for number, (place, face) in enumerate(where, 1):
            if place is not place_before:
                self.lines, place_before = {}, place
            colour = self._colour(place, face)
            labels = (*place["labels"], *([colour] if colour else []))
            labels_seen |= dict.fromkeys(labels)
            labels = (*labels, str(number), names.padded(number, len(where)))
            if not is_selected(labels, self.only):
                continue
            if self.faces.is_trimmed[face] and self.trims != "keep":
                if self.trims == "skip":
                    left_out.append(number)
                else:
                    self.report.add(
                        "is a trimmed face, and `trimmed: refuse` allows none; `only` selects names and colours", number
                    )
                continue
            surface = self._surface(place, face, number)
            if surface is None:
                continue
            if self.faces.gap[face] > GAP_TOLD:
                far.append((self.faces.gap[face], number))
            flip = bool(self.faces.is_reversed[face]) != (np.linalg.det(_matrix(place)) < 0)
            patches.append(Patch(number, surface, flip, labels, colour, bool(self.faces.is_solid[face]) or None))
        if not patches and not len(self.report.mistakes):
            what = f"no face matches '{self.only}'" if not left_out else "every face is trimmed and left out"
            known = f"; names and colours: {listed(labels_seen) or 'there are none'}"
            self.report.add(what + known, field="trimmed" if left_out else "only")
        notes = [f"skipped: {', '.join(self.faces.notes)}"] if self.faces.notes else []
        if far:
            worst, number = max(far)
            notes.append(f"edges lie off their surface in faces: {len(far)}, most in {number}: {worst:.1e} of its size")
        used = dict.fromkeys(patch.material for patch in patches if patch.material)
        glass = [name for name in used if name in {self.colours[k] for k in self.faces.see_through}]
        notes += [f"see-through colours are opaque: {listed(glass)}"] if glass else []
        colours = dict(zip(reversed(self.colours), reversed(self.faces.colours.tolist()), strict=True))
        materials = {name: {"reflectance": colours[name]} for name in used}
        return GeometryFile(patches, len(where), METRES, notes, left_out, materials)

    def _colour(self, place, face):
        """Name of the colour of a face that stands in a place: its own, or that of the place."""
        index = int(self.faces.colour[face])
        index = index if index >= 0 else place["colour"]
        return self.colours[index] if index >= 0 else None

    def _surface(self, place, face, number):
        """The surface of a face where it stands, or None with the reason noted."""
        kind = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", self.faces.kinds[face]).lower()
        if str(face) in self.faces.failed:
            why = self.faces.failed[str(face)]
            self.report.add(f"a {kind} that can not be converted ({why}); `only` selects names and colours", number)
            return None
        if self.faces.gap[face] > GAP_REFUSED:
            gap = f"{self.faces.gap[face]:.2g}"
            self.report.add(f"a {kind} whose edges lie {gap} of its size off it", number)
            return None
        surface = self.report.surface(lambda: transformed(self.faces.surface(face), _matrix(place)), number)
        loops = range(*self.faces.loop_first[face : face + 2].tolist())
        if surface is None or self.trims != "keep" or not len(loops) or not self.has_trims[self.faces.body[face]]:
            return surface
        return self.report.surface(lambda: trimmed(surface, [self._loop(k, place) for k in loops]), number)

    def _loop(self, loop, place):
        """The EdgeUse of a loop in its order."""
        uses = []
        for use in range(*self.faces.use_first[loop : loop + 2].tolist()):
            S, sharp = self._line(int(self.faces.edge[use]), place)
            found = EdgeUse(self.faces.uv[slice(*self.faces.uv_first[use : use + 2])], S, sharp)
            uses.append(found.reversed() if self.faces.is_backward[use] else found)
        return uses

    def _line(self, edge, place):
        """Points and significances of an edge where its part stands, once for all faces beside it."""
        if edge not in self.lines:
            S, M = self.faces.S[slice(*self.faces.edge_first[edge : edge + 2])], _matrix(place)
            # Product by product: a point has the same bits in every edge that ends there
            S = S[:, :1] * M[:3, 0] + S[:, 1:2] * M[:3, 1] + S[:, 2:] * M[:3, 2] + M[:3, 3]
            self.lines[edge] = S, significance(S)
        return self.lines[edge]


def _matrix(place):
    return np.vstack([np.reshape(place["matrix"], (3, 4)), [0.0, 0.0, 0.0, 1.0]])


def _colour_name(rgb):
    """`colour #dd5228` of a linear colour, as sRGB.

    >>> _colour_name([1.0, 0.0, 0.2158605])
    'colour #ff0080'
    """
    return "colour #" + bytes(np.round(linear_to_srgb(rgb) * 255).astype(int).tolist()).hex()
