"""Is there a gap at all? The plain model's residual against what noise alone would leave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.special import logsumexp

from palpate.core.gap.evidence import log_share, means_of_exponentials, projected
from palpate.core.gap.noise_fit import GAPS
from palpate.core.gap.verdict import PRIOR_UNKNOWN

FloatArray = NDArray[np.float64]

LEVEL = 0.05
_DRAWS = 2000
# Share of the false alarms that the look without any cause in mind may make.
_WHOLE = 0.1
# What refits add to the log Bayes factor of a gap where there is none: the median of 30 such cases. The draws are not refitted.
_REFITS_ADD = 0.12
# Bounds farther from 0 than so many of the prior's standard deviations are none.
_FAR = 3.0


@dataclass(frozen=True, eq=False)
class Named:
    """A named effect's directions S (n, k), whitened, one for each of its variants; the standard deviations (k,) of its parameters'
    prior, and their bounds (k, 2).
    """

    directions: Sequence[FloatArray]
    scales: FloatArray
    bounds: FloatArray


@dataclass(frozen=True)
class GapTest:
    """statistic Q and its degrees of freedom; p_value of the test; of single looks: whole, smooth (no name), named.

    p_value : how often noise alone makes the smallest of the two looks as small (Westfall & Young 1993), see `gap_test`.
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
    named: Mapping[str, Named] | None = None,
    seed: int = 1,
    refitted: Mapping[str, float] | None = None,
) -> GapTest:
    """Two looks at the whitened residual r (n,), the stiffness J (n, t) projected out, both against draws under the plain model.

    The first is the Bayes factor of a gap: the evidence of every named effect, the mean over its variants, and of a free smooth field
    (n, k) of any size, the mean of all by their prior probabilities. No other test finds more of such gaps on the average (Neyman &
    Pearson), and an effect with many variants does not drown one with a single one. The second, Q = r'Mr, sees any excess,
    also one that nobody has thought of; it takes a tenth of the false alarms.
    refitted : log evidences by effect after refits in full, for effects that a first look from the plain fit underrates because the
    stiffness has run far to absorb them.
    """
    freedom = len(r) - J.shape[1]
    draws = np.random.default_rng(seed).standard_normal((len(r), _DRAWS))
    draws = projected(J, np.column_stack([r, draws]))
    Q = (draws**2).sum(axis=0)
    whole = stats.chi2.sf(Q, freedom)
    smooth = _unnamed(projected(J, fields), draws)
    library = {name: _of_effect(J, effect, draws) for name, effect in (named or {}).items()}
    some = _any_named(list(library.values()), len(Q))
    factor = _of_a_gap(smooth, some)
    if refitted is not None:
        known = [np.maximum(look[:1], refitted.get(name, -np.inf)) for name, look in library.items()]
        factor[0] = max(factor[0], _of_a_gap(smooth[:1], _any_named(known, 1))[0] - _REFITS_ADD)
    smallest = np.minimum(_shares(factor) / (1.0 - _WHOLE), whole / _WHOLE)
    p = float(_shares(-smallest)[0])
    return GapTest(
        float(Q[0]), freedom, p, float(whole[0]), float(_shares(smooth)[0]), float(_shares(some)[0]) if library else 1.0
    )


def _any_named(library: Sequence[FloatArray], n: int) -> FloatArray:
    """(n,) log evidence of any effect of a library, all as likely before."""
    return means_of_exponentials(library) if library else np.full(n, -np.inf)


def _of_a_gap(smooth: FloatArray, named: FloatArray) -> FloatArray:
    """Log Bayes factor of a gap, with a name or without."""
    return np.asarray(logsumexp([smooth + np.log(PRIOR_UNKNOWN), named + np.log1p(-PRIOR_UNKNOWN)], axis=0))


def _unnamed(fields: FloatArray, draws: FloatArray) -> FloatArray:
    """(draws,) log evidence of a free field (n, k) that may have any size."""
    return means_of_exponentials([_gain(fields, np.full(fields.shape[1], size), draws) for size in GAPS if size])


def _of_effect(J: FloatArray, effect: Named, draws: FloatArray) -> FloatArray:
    """(draws,) log evidence of an effect, the mean over its variants."""
    return means_of_exponentials(
        [_gain(projected(J, S), effect.scales, draws, effect.bounds) for S in effect.directions]
    )


def _gain(S: FloatArray, scales: FloatArray, draws: FloatArray, bounds: FloatArray | None = None) -> FloatArray:
    """(draws,) log evidence of S (n, k) with normal priors, cut off at bounds (k, 2), for every column of draws (n, draws)."""
    U, s, Vt = np.linalg.svd(S * scales, full_matrices=False)
    seen = U.T @ draws
    out = 0.5 * (s**2 / (1.0 + s**2)) @ seen**2 - 0.5 * np.log1p(s**2).sum()
    if bounds is None:
        return np.asarray(out)
    limits = bounds / scales[:, None]
    for low, high, v in zip(limits[:, 0], limits[:, 1], Vt.T, strict=True):
        if low < -_FAR and high > _FAR:
            continue  # a bound that far cuts off nothing
        estimate = -(v * s / (1.0 + s**2)) @ seen
        sd = np.sqrt(1.0 - v**2 @ (s**2 / (1.0 + s**2)))
        out = out + log_share((low - estimate) / sd, (high - estimate) / sd) - log_share(low, high)
    return np.asarray(out)


def _shares(values: FloatArray) -> FloatArray:
    """For each value the share of all values that are at least as large, itself among them."""
    ascending = np.sort(values)
    return np.asarray((len(values) - np.searchsorted(ascending, values, side="left")) / len(values))
