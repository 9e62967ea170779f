"""Effects that are none: random smooth fields of forces, as strong as the one under test, with as many free amplitudes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from palpate.core.gap.forces import ForceFields
from palpate.core.gap.heldout import Gain, Linear, Split, gain

FloatArray = NDArray[np.float64]

PLACEBOS = 40


def placebo_gains(
    split: Split, plain: Linear, before: FloatArray, forces: ForceFields, n_parameters: int, seed: int = 1
) -> list[Gain]:
    """Gain on data left out of each placebo; their amplitudes are as free as the data leave them."""
    rng = np.random.default_rng(seed)
    k = forces.response.shape[1]
    models = []
    for _ in range(PLACEBOS):
        mix = rng.standard_normal((k, n_parameters)) / np.sqrt(n_parameters)
        S = forces.response @ mix
        p = plain.J.shape[1]
        models.append(
            Linear(
                plain.r,
                np.hstack([plain.J, S]),
                np.zeros(p + n_parameters),
                np.concatenate([plain.precision, np.full(n_parameters, 0.25)]),
            )
        )
    return [gain(split, before, after) for after in split.left_out(models)]
