"""Change of the direction of gravity between the scans."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.loads import body_force
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant

# 1 kg/m3 times 1 m/s2 in kPa/mm.
_WEIGHT = 1.0e-6


def _variants(around: Surroundings) -> list[Variant]:
    """Along the change that the case states; along every axis when it states none; no variant when gravity did not
    change."""
    rest, deformed = around.gravity
    if rest is None or deformed is None:
        return [_variant(around, np.eye(3)[i], f"along {'xyz'[i]}") for i in range(3)]
    change = np.subtract(deformed, rest)
    size = float(np.linalg.norm(change))
    return [] if size < 0.1 else [_variant(around, change / size, "as the case states")]


def _variant(around: Surroundings, direction: FloatArray, name: str) -> Variant:
    weight = _WEIGHT * around.density_kg_m3

    def change(composition: Composition, phi: FloatArray) -> Composition:
        def load(space: Space) -> Term:
            return body_force(space, weight * float(phi[0]) * direction)

        return composition.with_load(load)

    return Variant(change, name)


EFFECT = Effect(
    "gravity_change",
    "gravity acts in another direction than in the scan at rest",
    (Parameter("change", "m/s2", 10.0, -20.0, 20.0, own=True),),
    _variants,
    "a scan in the first one's posture, or the posture of both scans from their DICOM headers",
)
