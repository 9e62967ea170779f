"""The bones moved between the scans: pose or alignment."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.core.gap.composition import Composition
from palpate.core.gap.effects.base import Effect, FloatArray, Parameter, Surroundings, Variant


def _variants(around: Surroundings) -> list[Variant]:
    if "bone" not in around.problem.boundary:
        return []
    pivot = around.organ_centre

    def change(composition: Composition, phi: FloatArray) -> Composition:
        return composition.with_support(lambda X: rigid_motion(X, pivot, phi))

    return [Variant(change)]


def rigid_motion(X: FloatArray, pivot: FloatArray, phi: FloatArray) -> FloatArray:
    """(n, 3) mm: translation phi[:3] mm and rotation vector phi[3:] degrees about the pivot, at X (n, 3)."""
    turned = Rotation.from_rotvec(phi[3:], degrees=True).apply(X - pivot)
    return np.asarray(turned + pivot - X + phi[:3])


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
