"""Something unseen pushes on the organ."""

from __future__ import annotations

import numpy as np

from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.loads import traction
from palpate.core.gap.composition import Composition
from palpate.core.gap.effects.base import Effect, FloatArray, Parameter, Surroundings, Variant

_RADIUS_MM = 7.0
_SPACING_MM = 13.0


def _variants(around: Surroundings) -> list[Variant]:
    problem = around.problem
    faces, _ = problem.mesh.region_boundary(problem.regions)
    at = problem.mesh.points[faces].mean(axis=1)
    return [_variant(around, c) for c in around.spread_points(at, _SPACING_MM)]


def _variant(around: Surroundings, centre: FloatArray) -> Variant:
    def change(composition: Composition, phi: FloatArray) -> Composition:
        def load(space: Space) -> Term:
            faces, _ = space.mesh.region_boundary(composition.problem.regions)
            at = space.mesh.points[faces].mean(axis=1)
            share = np.exp(-0.5 * ((at - centre) ** 2).sum(axis=1) / _RADIUS_MM**2)
            near = share > 1e-3
            return traction(space, faces[near], share[near, None] * phi)

        return composition.with_load(load)

    x, y, z = centre.tolist()
    return Variant(change, f"at ({x:.0f}, {y:.0f}, {z:.0f})", (x, y, z))


EFFECT = Effect(
    "unmodelled_load",
    "something that the scans do not show pushes on the organ",
    tuple(Parameter(f"traction_{axis}", "kPa", 4.0, -40.0, 40.0) for axis in "xyz"),
    _variants,
    "the region next to the organ at the marked place, scanned again or with another modality",
)
