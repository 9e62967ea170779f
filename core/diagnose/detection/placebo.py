"""Placebo effects: random smooth loads as strong and as free as the effect under test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.inference.heldout import Gain, Linear, Split, gain
from palpate.core.observe.contour_noise import Weighting


def placebo_gains(
    split: Split, plain: Linear, before: FloatArray, loads: FloatArray, like: PlaceboSize, count: int, seed: int = 1
) -> list[Gain]:
    """Gains on data left out of `count` placebos: random smooth loads as strong and as free as an effect, fitted.

    loads (n, j) mm : response of the data to smooth loads of unit amplitude.
    """
    rng = np.random.default_rng(seed)
    models = []
    for _ in range(count):
        S = placebo_directions(loads, like, rng)
        precision = np.concatenate([plain.precision, np.ones(like.parameters)])
        models.append(Linear(plain.r, np.hstack([plain.J, S]), np.zeros(len(precision)), precision))
    return [gain(split, before, after) for after in split.left_out(models)]


@dataclass(frozen=True, eq=False)
class PlaceboSize:
    """What a placebo has in common with the effect under test.

    size : weighted change of all data, surface and images alike, without unit. parameters : how many are fitted.
    weighting : of the data.
    """

    size: float
    parameters: int
    weighting: Weighting

    @classmethod
    def of(cls, change: FloatArray, parameters: int, weighting: Weighting) -> PlaceboSize:
        """Size of a change (n,) of the data, mm."""
        return cls(float(np.linalg.norm(weighting.whiten(change))), parameters, weighting)


def placebo_directions(loads: FloatArray, like: PlaceboSize, rng: np.random.Generator) -> FloatArray:
    """Random directions (n, k) whose unit amplitudes together change the data by `like.size`, root mean square."""
    S = loads @ rng.standard_normal((loads.shape[1], like.parameters))
    lengths = np.linalg.norm(like.weighting.whiten(S), axis=0)
    return np.asarray(S * (like.size / np.sqrt(like.parameters) / np.maximum(lengths, 1e-30)))
