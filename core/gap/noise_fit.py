"""The case's own noise: how wide and how long its contours wander, by restricted likelihood.

The covariance is the mean over all sizes that the likelihood allows, not that of the likeliest: a little more or less data then
changes it a little, and never makes it jump from one grid point to the next.

Whatever an effect or a missing force could have caused is let free as a random effect, so that a gap is not taken for noise; the
stiffness is projected out. The prior is what the case states, to a factor of about 1.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from palpate.core.gap.noise_model import LENGTHS_MM, NoiseParts, NoiseSizes

FloatArray = NDArray[np.float64]

_FACTORS = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2)
_OWN = (0.1, 0.2, 0.3)
# Standard deviation of ln (true contour noise / what the case states).
_PRIOR = 0.35
# Sizes less probable than this are left out of the mean.
_NEGLIGIBLE = 1e-4
# Precision of ln G's prior: none to speak of.
_FLAT = 1e-3


@dataclass(frozen=True, eq=False)
class FittedNoise:
    """sizes : posterior means (root mean squares of standard deviations). covariance : (n, n) mm2, its posterior mean."""

    sizes: NoiseSizes
    covariance: FloatArray


def fit_noise(
    parts: NoiseParts, start: NoiseSizes, left: FloatArray, r: FloatArray, J: FloatArray, free: Sequence[FloatArray]
) -> FittedNoise:
    """Over a grid of sizes, by the restricted likelihood; free : (n, k) responses to unit normal amplitudes."""
    loose = sum((S @ S.T for S in free), np.zeros((len(r), len(r))))
    grid = [
        replace(start, length=length, contour=factor, own=own)
        for length in LENGTHS_MM
        for factor in _FACTORS
        for own in _OWN
    ]
    logs = np.array([_restricted(parts.covariance(s, left) + loose, r, J) + _prior(s.contour) for s in grid])
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    likely = [(w, s) for w, s in zip(weight.tolist(), grid, strict=True) if w > _NEGLIGIBLE]
    covariance = sum((w * parts.covariance(s, left) for w, s in likely), np.zeros_like(loose))
    contour, own = (float(np.sqrt(weight @ np.square([getattr(s, k) for s in grid]))) for k in ("contour", "own"))
    length = float(weight @ np.array([s.length for s in grid]))
    return FittedNoise(replace(start, contour=contour, own=own, length=length), covariance / sum(w for w, _ in likely))


def _prior(factor: float) -> float:
    """ln of the density of the contours' factor, whose logarithm is normal."""
    return float(-0.5 * (np.log(factor) / _PRIOR) ** 2 - np.log(factor))


def _restricted(C: FloatArray, r: FloatArray, J: FloatArray) -> float:
    """ln of the restricted likelihood."""
    L = np.linalg.cholesky(C)
    both = np.linalg.solve(L, np.column_stack([r, J]))
    rw, Jw = both[:, 0], both[:, 1:]
    A = Jw.T @ Jw + _FLAT * np.eye(J.shape[1])  # a pair that tells nothing of the stiffness must not divide by zero
    b = Jw.T @ rw
    Q = float(rw @ rw - b @ np.linalg.solve(A, b))
    return -0.5 * Q - float(np.log(np.diag(L)).sum()) - 0.5 * float(np.linalg.slogdet(A)[1])
