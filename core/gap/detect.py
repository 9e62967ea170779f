"""Is there a gap at all? The plain model's residual against what noise alone would leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from palpate.core.gap.evidence import explained, projected

FloatArray = NDArray[np.float64]

LEVEL = 0.05
_DRAWS = 2000


@dataclass(frozen=True)
class GapTest:
    """statistic Q and its degrees of freedom; p_value of all three looks together, of each: whole, smooth, named."""

    statistic: float
    freedom: int
    p_whole: float
    p_smooth: float
    p_named: float

    @property
    def p_value(self) -> float:
        """Bonferroni's, for three looks."""
        return min(1.0, 3.0 * min(self.p_whole, self.p_smooth, self.p_named))

    @property
    def detected(self) -> bool:
        """Whether noise alone would leave this much in fewer than one case of twenty."""
        return self.p_value < LEVEL


def gap_test(
    r: FloatArray,
    J: FloatArray,
    fields: FloatArray,
    named: Sequence[tuple[FloatArray, FloatArray]] = (),
    seed: int = 1,
) -> GapTest:
    """Three looks at the whitened residual r (n,), the stiffness J (n, t) projected out.

    Q = r'Mr sees any excess. The gain of a free smooth field of missing forces (n, k) sees what is smooth. The best log evidence of
    the named effects' directions, each S (n, k) with prior standard deviations (k,), sees what they look like. The last two have
    no tabled distribution: they are drawn under the plain model.
    """
    freedom = len(r) - J.shape[1]
    Q = explained(r, J)
    draws = np.random.default_rng(seed).standard_normal((len(r), _DRAWS))
    draws = np.column_stack([r, draws])
    draws = projected(J, draws)
    smooth = _gain(projected(J, fields), np.ones(fields.shape[1]), draws)
    best = np.full(draws.shape[1], -np.inf)
    for S, scales in named:
        best = np.maximum(best, _gain(projected(J, S), scales, draws))
    return GapTest(Q, freedom, float(stats.chi2.sf(Q, freedom)), _share(smooth), _share(best) if len(named) else 1.0)


def _gain(S: FloatArray, scales: FloatArray, draws: FloatArray) -> FloatArray:
    """(draws,) log evidence of S (n, k) with normal priors, for every column of draws (n, draws)."""
    U, s, _ = np.linalg.svd(S * scales, full_matrices=False)
    shrink = s**2 / (1.0 + s**2)
    return np.asarray(0.5 * shrink @ (U.T @ draws) ** 2 - 0.5 * np.log1p(s**2).sum())


def _share(values: FloatArray) -> float:
    """p-value of the first value among the others."""
    return float((1 + (values[1:] >= values[0]).sum()) / len(values))
