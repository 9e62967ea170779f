"""The case's own noise: how wide and how long its contours wander, by restricted maximum likelihood.

Whatever an effect or a missing force could have caused is let free as a random effect, so that a gap is not taken for noise; the
stiffness is projected out. The prior is what the case states, to a factor of about 1.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from palpate.core.gap.noise_model import LENGTHS_MM, NoiseParts, NoiseSizes

FloatArray = NDArray[np.float64]

_FACTORS = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2)
_OWN = (0.1, 0.2, 0.3)
# Standard deviation of ln (true contour noise / what the case states).
_PRIOR = 0.35
# Precision of ln G's prior: none to speak of.
_FLAT = 1e-3


def fit_noise(
    parts: NoiseParts, start: NoiseSizes, mesh: FloatArray, r: FloatArray, J: FloatArray, free: Sequence[FloatArray]
) -> NoiseSizes:
    """Sizes at the restricted likelihood's maximum over a grid; free : (n, k) responses to unit normal amplitudes."""
    loose = sum((S @ S.T for S in free), np.zeros((len(r), len(r))))
    best = (-np.inf, start)
    for length in LENGTHS_MM:
        for factor in _FACTORS:
            for own in _OWN:
                sizes = replace(start, length=length, contour=factor, own=own)
                value = _restricted(parts.covariance(sizes, mesh) + loose, r, J) - 0.5 * (np.log(factor) / _PRIOR) ** 2
                if value > best[0]:
                    best = value, sizes
    return best[1]


def _restricted(C: FloatArray, r: FloatArray, J: FloatArray) -> float:
    """ln of the restricted likelihood."""
    L = np.linalg.cholesky(C)
    both = np.linalg.solve(L, np.column_stack([r, J]))
    rw, Jw = both[:, 0], both[:, 1:]
    A = Jw.T @ Jw + _FLAT * np.eye(J.shape[1])  # a pair that tells nothing of the stiffness must not divide by zero
    b = Jw.T @ rw
    Q = float(rw @ rw - b @ np.linalg.solve(A, b))
    return -0.5 * Q - float(np.log(np.diag(L)).sum()) - 0.5 * float(np.linalg.slogdet(A)[1])
