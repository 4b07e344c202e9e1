"""The hard cases notice when the code is broken on purpose: each breakage, and the case that must fail."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import accuracy
from benchmarks.hard_cases.bench import Bench
from lib.elements import quadtree
from lib.elements.lattice import Lattice
from lib.maps import emission
from lib.radiosity import direct, gather, rows, sampling, shooting
from lib.visibility import hemisphere, hidden
from stages import shoot, tessellate
from tests.radiosity import plain_form_factors


def no_receiver_cosine(patch):
    """Gather rays and element rays uniform over the hemisphere."""

    def uniform(x, N, points, shift):
        stretched = np.stack([1 - (1 - points[..., 0]) ** 2, points[..., 1]], axis=-1)
        return hemisphere.rays_about(x, N, stretched, np.stack([0 * shift[:, 0], shift[:, 1]], axis=1))

    for module in (gather, rows):
        patch.setattr(module, "rays_about", uniform)


def no_emitter_cosine(patch):
    """Far facets shine the same in all directions."""

    def discs(x, n, facets):
        D = facets.centre[None] - x[:, None]
        r2 = (D * D).sum(axis=2)
        cos = np.maximum(np.einsum("mkc,mc->mk", D, n), 0) / np.sqrt(r2)
        return facets.area * cos / (np.pi * r2 + facets.area)

    patch.setattr(direct, "form_factor_facets", discs)


def no_lift(patch):
    """Rays leave from the exact surface, whatever its mesh does."""
    make = tessellate.make

    def flat(*args):
        made = make(*args)
        return replace(made, sag=np.zeros_like(made.sag))

    patch.setattr(tessellate, "make", flat)


def no_clipping(patch):
    """What is below the horizon counts as well."""

    def whole(x, n, facets):
        corners = facets.corners()[None] - x[:, None, None]
        edges = plain_form_factors._edge(corners, np.roll(corners, -1, axis=2), n[:, None, None])
        is_ahead = np.einsum("mkc,kc->mk", corners[:, :, 0], facets.normal) < 0
        return np.abs(edges.sum(axis=2)) / (2 * np.pi) * is_ahead

    patch.setattr(direct, "form_factor_facets", whole)


def nothing_hidden(patch):
    """No sample counts as buried."""
    for module in (hidden, gather, rows):
        patch.setattr(module, "is_hidden", lambda hits, in_shell, K: np.zeros(len(hits.face) // K, dtype=bool))
    none = lambda x, *_: np.zeros(len(x), dtype=bool)  # noqa: E731
    for module in (sampling, rows):
        patch.setattr(module, "are_buried", none)


def rows_that_sum_to_one(patch):
    """What escapes comes back."""

    class Normalised(shooting.FormFactors):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **kwargs)
            total = np.bincount(self._row, self._F, minlength=self.n)
            self._F = self._F / np.maximum(total, 1e-300)[self._row]

    patch.setattr(shoot, "FormFactors", Normalised)


def light_from_behind(patch):
    """Rays see the radiosity of a surface from its back too."""
    see = gather.LookupTable.see

    def both(self, hits, follows):
        return see(self, replace(hits, is_back=np.zeros_like(hits.is_back)), follows)

    patch.setattr(gather.LookupTable, "see", both)


def through_walls(patch):
    """No shadow rays."""
    patch.setattr(
        "lib.visibility.tracer.Tracer.is_blocked", lambda self, origins, D: np.zeros(len(origins), dtype=bool)
    )


def even_pictures(patch):
    """A picture's mean shines everywhere."""
    patch.setattr("lib.maps.emission.merged", lambda mean, area, tolerance: (np.array([[0, 1, 0, 1.0]]), mean[:1, 0]))


def mirrored_pictures(patch):
    """Parts of a picture lie on the other side."""
    merged = emission.merged
    patch.setattr("lib.maps.emission.merged", lambda mean, area, tolerance: merged(mean[:, ::-1], area, tolerance))


def no_cells_along_contacts(patch):
    """Where hidden and visible samples meet nothing is divided."""
    patch.setattr(quadtree.Quadtree, "_is_contact", lambda self, level: False)


def open_seams(patch):
    """Both ends of a closed surface's map are measured on their own, as if it were open."""
    patch.setattr("lib.radiosity.world.Lattice", lambda roots, closed, collapsed: Lattice(roots))


BROKEN = {
    no_cells_along_contacts: "contact_edges",
    open_seams: "seams",
    even_pictures: "textured_emitter",
    mirrored_pictures: "textured_emitter",
    no_receiver_cosine: "spheres",
    no_emitter_cosine: "lamps",
    no_lift: "own_tessellation",
    no_clipping: "horizon",
    nothing_hidden: "contact",
    rows_that_sum_to_one: "spheres",
    light_from_behind: "thin_wall",
    through_walls: "penumbra",
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("breakage, case", BROKEN.items(), ids=[f.__name__ for f in BROKEN])
def test_a_breakage_is_noticed(tmp_path, monkeypatch, breakage, case):
    breakage(monkeypatch)
    figures = accuracy.CASES[case](Bench(tmp_path, is_cheap=True))
    assert not all(figure.holds for figure in figures)
