"""Placebo effects: random smooth loads as strong as the effect under test, and the same effect at another place."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.inference.heldout import Gain, Linear, Split, gain
from palpate.core.residual.unknown_field import UnknownDiscrepancy
from palpate.core.statistics import rms


def placebo_gains(
    split: Split, plain: Linear, before: FloatArray, forces: UnknownDiscrepancy, size: float, count: int, seed: int = 1
) -> list[Gain]:
    """Gains on data left out of `count` placebos: random smooth loads of a given prior size, their amplitudes fitted.

    size : rms change of the residual, mm per entry of the data vector, that the effect under test makes.
    """
    rng = np.random.default_rng(seed)
    p = plain.J.shape[1]
    models = []
    for _ in range(count):
        S = forces.response @ rng.standard_normal(forces.response.shape[1])
        S *= size / max(rms(S), 1e-30)
        precision = np.concatenate([plain.precision, [1.0]])
        models.append(Linear(plain.r, np.column_stack([plain.J, S]), np.zeros(p + 1), precision))
    return [gain(split, before, after) for after in split.left_out(models)]


def moved_gains(
    split: Split,
    plain: Linear,
    before: FloatArray,
    screened: Screened,
    where: tuple[float, float, float],
    apart_mm: float,
) -> list[Gain]:
    """Gain on data left out of the same effect at every other place (mirrored or moved by at least apart_mm), its size
    fitted."""
    models = []
    for variant, S in zip(screened.variants, screened.directions, strict=True):
        if variant.where is None or np.linalg.norm(np.subtract(variant.where, where)) < apart_mm:
            continue
        effective = np.abs(S).max(axis=0) > 0.0
        precision = np.concatenate([plain.precision, 1.0 / screened.effect.scales[effective] ** 2])
        models.append(Linear(plain.r, np.column_stack([plain.J, S[:, effective]]), np.zeros(len(precision)), precision))
    return [gain(split, before, after) for after in split.left_out(models)]
