"""The bones moved between the scans: pose or alignment."""

from __future__ import annotations

from palpate.core.gap.composition import Composition, rigid_motion
from palpate.core.gap.effects.base import Effect, FloatArray, Parameter, Surroundings, Variant


def _variants(around: Surroundings) -> list[Variant]:
    if "bone" not in around.problem.boundary:
        return []
    pivot = around.organ_centre

    def change(composition: Composition, phi: FloatArray) -> Composition:
        return composition.with_support(lambda X: rigid_motion(X, pivot, phi))

    return [Variant(change)]


EFFECT = Effect(
    "bone_motion",
    "the bones moved between the scans, or the scans are not aligned on them",
    (
        *(Parameter(f"translation_{axis}", "mm", 2.0, -15.0, 15.0) for axis in "xyz"),
        *(Parameter(f"rotation_{axis}", "deg", 2.5, -20.0, 20.0) for axis in "xyz"),
    ),
    _variants,
    "an alignment of the two scans on bone that is checked by eye, or a scan in the first one's posture",
)
