"""Effects that are none: random smooth loads as strong as the effect under test."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from palpate.core.gap.forces import ForceFields
from palpate.core.gap.heldout import Gain, Linear, Split, gain

FloatArray = NDArray[np.float64]

PLACEBOS = 40


def placebo_gains(
    split: Split, plain: Linear, before: FloatArray, forces: ForceFields, size: float, seed: int = 1
) -> list[Gain]:
    """Gain on data left out of each placebo: a random smooth load whose amplitude is fitted, of the given prior size.

    size : rms of the residual's change, mm per entry of the data vector, that the effect under test makes.
    """
    rng = np.random.default_rng(seed)
    p = plain.J.shape[1]
    models = []
    for _ in range(PLACEBOS):
        S = forces.response @ rng.standard_normal(forces.response.shape[1])
        S *= size / max(float(np.sqrt((S**2).mean())), 1e-30)
        precision = np.concatenate([plain.precision, [1.0]])
        models.append(Linear(plain.r, np.column_stack([plain.J, S]), np.zeros(p + 1), precision))
    return [gain(split, before, after) for after in split.left_out(models)]
