"""Sliding of the organ along its surroundings, to which the plain model ties it."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant

# Compliance grows exponentially with phi, because its effect saturates beyond radius / shear modulus.
_UNIT_COMPLIANCE = 0.1


def compliance(phi: float) -> float:
    """Tangential compliance, mm/kPa."""
    return float(_UNIT_COMPLIANCE * np.expm1(max(phi, 0.0)))


def _variants(around: Surroundings) -> list[Variant]:
    return [Variant(_slide, "all round")]


def _slide(composition: Composition, phi: FloatArray) -> Composition:
    return composition.with_interface(compliance(float(phi[0])))


EFFECT = Effect(
    "interface_sliding",
    "the organ slides along its surroundings",
    (Parameter("tangential_compliance", "mm/kPa", 2.0, 0.0, 6.0, compliance),),
    _variants,
    "points inside the organ and in the tissue beside it (seeds, calcifications): they show slip, surfaces do not",
    on_bench=False,
)
