"""Start points of a search, spread over a box."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray

# Share of the way from the lower to the upper bound of the first start: stiffnesses act most on the soft side.
_FIRST = 0.4


def middle(bounds: FloatArray) -> FloatArray:
    """Start (t,) at 40 % of the way from the lower to the upper bound of theta (t, 2), where sensitivities are largest."""
    return bounds[:, 0] + _FIRST * (bounds[:, 1] - bounds[:, 0])


def spread_starts(bounds: FloatArray, count: int) -> FloatArray:
    """Start points (count, t) within bounds (t, 2): `middle`, then a low-discrepancy sequence.

    The sequence is the R-sequence (Roberts 2018): the same for every search.
    """
    n = len(bounds)
    golden = np.array([1.0 / _plastic(n) ** (k + 1) for k in range(n)])
    share = (0.5 + np.outer(np.arange(1, count), golden)) % 1.0
    low, width = bounds[:, 0], np.ptp(bounds, axis=1)
    return np.vstack([middle(bounds)[None], low + (0.15 + 0.7 * share) * width])


def _plastic(n: int) -> float:
    """Root of x^(n+1) = x + 1, the generalised golden ratio of the R-sequences (Roberts 2018)."""
    x = 1.5
    for _ in range(60):
        x = (1.0 + x) ** (1.0 / (n + 1))
    return x
