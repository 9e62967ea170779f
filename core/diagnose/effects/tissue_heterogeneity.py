"""Heterogeneity of the surrounding tissue: stiffer or softer on one side of a plane."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant
from palpate.core.forward.material_changes import scaled
from palpate.core.forward.parameters import TISSUE

# Numerical: width of the plane's edge, mm, so that it moves smoothly through the mesh.
_EDGE_MM = 2.0
_SIDES = {
    "left": (1.0, 0.0, 0.0), "right": (-1.0, 0.0, 0.0), "posterior": (0.0, 1.0, 0.0), "anterior": (0.0, -1.0, 0.0),
    "superior": (0.0, 0.0, 1.0), "inferior": (0.0, 0.0, -1.0),
}  # fmt: skip


def _variants(around: Surroundings) -> list[Variant]:
    return [_variant(around, side, np.array(direction)) for side, direction in _SIDES.items()]


def _variant(around: Surroundings, side: str, direction: FloatArray) -> Variant:
    depth = (around.cell_centres - around.organ_centre) @ direction

    def change(composition: Composition, phi: FloatArray) -> Composition:
        share = 1.0 / (1.0 + np.exp(np.clip((phi[1] - depth) / _EDGE_MM, -50.0, 50.0)))
        return composition.with_law(scaled((TISSUE,), np.exp(phi[0] * share)))

    return Variant(change, side)


EFFECT = Effect(
    "tissue_heterogeneity",
    "the surrounding tissue is stiffer or softer on one side",
    (
        Parameter("log_contrast", "1", 1.5, -3.5, 3.5),
        Parameter("plane_shift", "mm", 6.0, -20.0, 20.0, secondary=True),
    ),
    _variants,
    "the motion of vessels or fat planes in the tissue on that side, or an elastography that reaches them",
)
