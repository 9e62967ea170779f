"""Is there a gap at all? The plain model's residual against what noise alone would leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from palpate.core.gap.evidence import projected

FloatArray = NDArray[np.float64]

LEVEL = 0.05
_DRAWS = 2000


@dataclass(frozen=True)
class GapTest:
    """statistic Q and its degrees of freedom; p_value of all three looks together, and of each: whole, smooth, named.

    p_value : how often noise alone makes the smallest of the three as small (Westfall & Young 1993): the looks are alike, so
    three times the smallest would be too much.
    """

    statistic: float
    freedom: int
    p_value: float
    p_whole: float
    p_smooth: float
    p_named: float

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
    refitted: float = -np.inf,
) -> GapTest:
    """Three looks at the whitened residual r (n,), the stiffness J (n, t) projected out.

    Q = r'Mr sees any excess. The gain of a free smooth field of missing forces (n, k) sees what is smooth. The best log evidence of
    the named effects' directions, each S (n, k) with prior standard deviations (k,), sees what they look like. The last two have
    no tabled distribution: they are drawn under the plain model. refitted : the best log evidence after refits in full, for effects
    that a first look from the plain fit underrates because the stiffness has run far to absorb them.
    """
    freedom = len(r) - J.shape[1]
    draws = np.random.default_rng(seed).standard_normal((len(r), _DRAWS))
    draws = projected(J, np.column_stack([r, draws]))
    Q = (draws**2).sum(axis=0)
    looks = [stats.chi2.sf(Q, freedom), _shares(_gain(projected(J, fields), np.ones(fields.shape[1]), draws))]
    if len(named):
        best = np.max([_gain(projected(J, S), scales, draws) for S, scales in named], axis=0)
        best[0] = max(best[0], refitted)
        looks.append(_shares(best))
    smallest = np.min(looks, axis=0)
    together = min(float(_shares(-smallest)[0]), 3.0 * float(smallest[0]))
    return GapTest(float(Q[0]), freedom, together, *(float(look[0]) for look in looks), *(1.0,) * (3 - len(looks)))


def _gain(S: FloatArray, scales: FloatArray, draws: FloatArray) -> FloatArray:
    """(draws,) log evidence of S (n, k) with normal priors, for every column of draws (n, draws)."""
    U, s, _ = np.linalg.svd(S * scales, full_matrices=False)
    shrink = s**2 / (1.0 + s**2)
    return np.asarray(0.5 * shrink @ (U.T @ draws) ** 2 - 0.5 * np.log1p(s**2).sum())


def _shares(values: FloatArray) -> FloatArray:
    """For each value the share of all values that are at least as large, itself among them."""
    ascending = np.sort(values)
    return np.asarray((len(values) - np.searchsorted(ascending, values, side="left")) / len(values))
