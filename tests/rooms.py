"""Small scenes whose light is known, as the stages read them, and a bake of them through the stages' doors."""

import json

import numpy as np

from lib.formats import artefact, light_maps
from lib.formats import scene as scene_file
from lib.formats.rule_settings import rule_settings
from lib.maps import emission
from lib.radiosity.world import World
from lib.surfaces.mesh import Mesh
from stages import balance_resample, refine, sample, shoot, tessellate
from tests.shapes import box

BAKE = {
    "tolerance": 0.02,
    "relative_to": "scene",
    "bounces": "converge",
    "max_level": 4,
    "convergence": 0.001,
    "seed": 1,
    "sag": 0.001,
    "elements": 200,
    "rays_per_element": 64,
    "gather_rays": 64,
    "shadow_rays": [8, 16],
    "texture_level": 6,
}

LEVEL = 5  # of the atlas: charts of 8 cells, 2 cells and more between them


def scene_of(surfaces):
    """A Scene of {name: (surface, facts)}; facts may hold E, role, flip, group, is_black, glow,
    front (name of the surface whose back it is)."""
    names = sorted(surfaces)
    facts = [surfaces[name][1] for name in names]
    n = len(names)
    return scene_file.Scene(
        names=names,
        files=[f"{k:03d}-surface" for k in range(n)],
        surfaces=[surfaces[name][0] for name in names],
        front=np.array([names.index(f["front"]) if "front" in f else -1 for f in facts], dtype=np.int32),
        flip=np.array([f.get("flip", False) for f in facts]),
        role=[f.get("role", "full") for f in facts],
        E=np.array([np.broadcast_to(f.get("E", 0.0), 3) for f in facts], dtype=np.float64),
        group=np.array([f.get("group", 0) for f in facts], dtype=np.int32),
        groups=[f"lamps {g}" for g in range(1 + max(f.get("group", 0) for f in facts))],
        is_black=np.array([f.get("is_black", False) for f in facts]),
        material=["white"] * n,
        up="z",
        warnings=[],
        glow={k: f["glow"] for k, f in enumerate(facts) if f.get("glow") is not None},
    )


def shining(surface, picture, E=1.0, repeat=(1, 1), **facts):
    """(surface, facts) of a surface that emits E (W/m2 where the picture is white) times a picture (H, W, 3)."""
    E = np.asarray(E, dtype=float) * emission.average(surface, picture, repeat)
    return surface, {"E": E, "glow": emission.glow(surface, picture, repeat), **facts}


def cube(side=1.0, **facts):
    """The six walls of a cube, facing inwards, as scene_of takes them; box() goes down, up, then the other walls."""
    return {f"wall {k}": (face, {"flip": True, **facts}) for k, face in enumerate(box(side))}


def cube_mesh(side=1.0):
    """The six walls of a cube, lit inside, as one mesh of six charts."""
    V, F, N, uv, chart = [], [], [], [], []
    for k, wall in enumerate(box(side)):
        P = wall.P  # lit side: against S_u x S_v
        corner = np.array([P[0, 0], P[0, 1], P[1, 1], P[1, 0]])
        n = np.cross(corner[1] - corner[0], corner[3] - corner[0])
        place = corner_of(k) + np.array([[0, 0], [0, 1], [1, 1], [1, 0]]) / 4
        for three in ([0, 1, 2], [0, 2, 3]):
            F.append([len(V) + t for t in range(3)])
            V += corner[three].tolist()
            N.append([n / np.linalg.norm(n)] * 3)
            uv.append(place[three])
            chart.append(k)
    F = np.array(F, dtype=np.int32)
    return Mesh(np.array(V), F, np.array(N), None, np.array(uv), np.array(chart, dtype=np.int32), LEVEL)


def corner_of(k):
    """Where the chart of wall k begins in the atlas; it is a quarter of it wide."""
    return np.array([1 / 16 + (k % 3) * 5 / 16, 1 / 8 + (k // 3) * 7 / 16])


def casters_of(scene, sag=BAKE["sag"]):
    return tessellate.make(scene.surfaces, scene.flip, scene.role, sag, scene.front)


def world_of(surfaces):
    """The World of a dict of surfaces."""
    scene = scene_of(surfaces)
    return World(scene, casters_of(scene))


def slices(**changes):
    """{stage: settings dict}; changes are of BAKE, or of any key of the slices."""
    bake = BAKE | {key: value for key, value in changes.items() if key in BAKE}
    settings = {
        "bake": bake,
        "budget": 0,
        "lods": [],
        "export": {"profiles": [""], "exposure": 1},
        "camera": None,
        "up": "z",
    }
    made = {stage: json.loads(text) for stage, text in rule_settings(settings).items()}
    for stage in ("sample", "shoot", "refine", "balance_resample"):  # tolerances: {surface name: its own}
        made[stage] |= {key: value for key, value in changes.items() if key in made[stage] and key not in BAKE}
    return made


class Baked:
    """Files of a bake in `folder`, as the stages write them."""

    def __init__(self, folder, scene, rho, chunks=1, **changes):
        """rho : number, or {surface name: number or three}; changes as slices() takes them."""
        self.folder, self.scene, self.chunks, self.settings = folder, scene, chunks, slices(**changes)
        folder.mkdir(parents=True, exist_ok=True)
        scene_file.save(folder / "scene.npz", scene)
        rho = {name: rho for name in scene.names} if np.isscalar(rho) else rho
        rho = {name: np.broadcast_to(value, 3).tolist() for name, value in rho.items()}
        artefact.write_json(folder / "materials.json", {"rho_avg": rho})

    def path(self, name, c=None):
        return str(self.folder / (f"{name}_{c}.npz" if c is not None else f"{name}.npz"))

    def run(self, stage, name, *argv, scene=True, log=()):
        settings = json.dumps(self.settings[name])
        first = ["--scene", self.path("scene")] if scene else []
        return stage.main([*first, *argv, "--settings", settings, *log])

    def tessellate(self):
        return self.run(tessellate, "tessellate", "--out", self.path("casters"))

    def sample(self, c):
        which = ["--chunk", str(c), "--chunks", str(self.chunks)]
        return self.run(sample, "sample", "--casters", self.path("casters"), *which, "--out", self.path("samples", c))

    def shoot(self):
        files = ["--casters", self.path("casters"), "--materials", str(self.folder / "materials.json")]
        files += ["--samples", *(self.path("samples", c) for c in range(self.chunks))]
        return self.run(shoot, "shoot", *files, "--out", self.path("solution"))

    def refine(self, half, c, log=()):
        light = ["--samples", self.path("samples", c), "--radiosity-out", self.path("radiosity", c)]
        if half == "indirect":
            light = ["--direct", self.path("direct", c)]
            light += ["--radiosity", *(self.path("radiosity", k) for k in range(self.chunks))]
        files = ["--casters", self.path("casters"), "--solution", self.path("solution"), *light]
        which = ["--half", half, "--chunk", str(c), "--chunks", str(self.chunks)]
        return self.run(refine, "refine", *files, *which, "--out", self.path(half, c), log=log)

    def balance_resample(self, c):
        files = [
            "--solution",
            self.path("solution"),
            "--direct",
            self.path("direct", c),
            "--indirect",
            self.path("indirect", c),
        ]
        return self.run(balance_resample, "balance_resample", *files, "--out", self.path("maps", c))

    def all(self):
        """Run everything; returns self."""
        every = range(self.chunks)
        done = [self.tessellate(), *(self.sample(c) for c in every), self.shoot()]
        done += [self.refine(half, c) for half in ("direct", "indirect") for c in every]
        done += [self.balance_resample(c) for c in every]
        assert not any(done)
        return self

    def maps(self):
        """{name: (H (h, w, G, 3), hidden (h, w))}."""
        found = light_maps.merge([light_maps.load(self.path("maps", c)) for c in range(self.chunks)]).maps
        return {self.scene.names[s]: (found.map(k), found.hidden_map(k)) for k, s in enumerate(found.surface)}


def baked(folder, surfaces, rho, **changes):
    """Maps of a dict of surfaces, baked in `folder`."""
    return Baked(folder, scene_of(surfaces), rho, **changes).all().maps()
