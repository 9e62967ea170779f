"""Bias of the deformed scan's contour of the organ: too wide or too tight everywhere."""

from __future__ import annotations

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant


def _variants(around: Surroundings) -> list[Variant]:
    return [Variant(_offset)] if around.problem.organ_drawn else []


def _offset(composition: Composition, phi: FloatArray) -> Composition:
    return composition.with_observation(float(phi[0]))


EFFECT = Effect(
    "contour_bias",
    "one scan's contour of the organ is too wide or too tight everywhere",
    (Parameter("offset", "mm", 0.8, -5.0, 5.0, own=True),),
    _variants,
    "the organ drawn again in both scans by one person with one window setting",
    on_bench=False,
)
