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
# A plane may look between the sides: `tilt_1` and `tilt_2` turn it towards the other two axes of the patient, in their order, half-way to
# the next side at most. Directions spread evenly up to there have this standard deviation.
_TILT_DEG, _MOST_TILT_DEG = 26.0, 45.0
_SIDES = {
    "left": (1.0, 0.0, 0.0), "right": (-1.0, 0.0, 0.0), "posterior": (0.0, 1.0, 0.0), "anterior": (0.0, -1.0, 0.0),
    "superior": (0.0, 0.0, 1.0), "inferior": (0.0, 0.0, -1.0),
}  # fmt: skip


def _variants(around: Surroundings) -> list[Variant]:
    return [_variant(around, side, np.array(direction)) for side, direction in _SIDES.items()]


def _variant(around: Surroundings, side: str, direction: FloatArray) -> Variant:
    away = around.cell_centres - around.organ_centre
    across = np.eye(3)[direction == 0.0]

    def change(composition: Composition, phi: FloatArray) -> Composition:
        tilted = direction + np.tan(np.deg2rad(phi[2:4])) @ across
        depth = away @ (tilted / np.linalg.norm(tilted))
        share = 1.0 / (1.0 + np.exp(np.clip((phi[1] - depth) / _EDGE_MM, -50.0, 50.0)))
        return composition.with_law(scaled((TISSUE,), np.exp(phi[0] * share)))

    return Variant(change, side)


EFFECT = Effect(
    "tissue_heterogeneity",
    "the surrounding tissue is stiffer or softer on one side",
    (
        Parameter("log_contrast", "1", 1.5, -3.5, 3.5, over_reference=True),
        Parameter("plane_shift", "mm", 6.0, -20.0, 20.0, secondary=True),
        Parameter("tilt_1", "deg", _TILT_DEG, -_MOST_TILT_DEG, _MOST_TILT_DEG, secondary=True),
        Parameter("tilt_2", "deg", _TILT_DEG, -_MOST_TILT_DEG, _MOST_TILT_DEG, secondary=True),
    ),
    _variants,
    "the motion of vessels or fat planes in the tissue on that side, or an elastography that reaches them",
    on_bench=False,
)
