"""Test for a gap: the plain model's residual against what noise alone leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import stats
from scipy.linalg import solve_triangular
from scipy.special import logsumexp, softmax

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.inference.evidence import log_share, means_of_exponentials, projected
from palpate.core.residual.noise_estimation import NoiseGrid
from palpate.core.residual.restricted_likelihood import FLAT

# Bounds farther from 0 than so many of the prior's standard deviations are none.
_FAR = 3.0


@dataclass(frozen=True, eq=False)
class EffectDirections:
    """Linearised effect of the library, as the test needs it.

    directions : derivative (n, k) of the data in the parameters, one array for each variant. scales (k,) : standard
    deviations of the parameters' prior. bounds (k, 2) : of the parameters.
    """

    directions: Sequence[FloatArray]
    scales: FloatArray
    bounds: FloatArray


@dataclass(frozen=True)
class GapTest:
    """Result of the test for a gap; see `gap_test` for its two statistics.

    statistic : Q = r'Mr, whitened and without unit, the mean over the noise's sizes. freedom : its degrees of freedom.
    p_value : how often noise alone makes the smaller of the two p-values as small (Westfall & Young 1993).
    p_whole : p-value of Q alone. p_smooth : of the Bayes factor of a smooth field without a name alone. p_named : of
    the Bayes factor of the library's effects alone; 1 without a library. detected : whether p_value is below
    `DecisionRules.level`.
    """

    statistic: float
    freedom: int
    p_value: float
    p_whole: float
    p_smooth: float
    p_named: float
    detected: bool


def gap_test(
    noise: NoiseGrid,
    r: FloatArray,
    J: FloatArray,
    fields: FloatArray,
    named: Mapping[str, EffectDirections] | None = None,
    seed: int = 1,
    refitted: Mapping[str, float] | None = None,
    *,
    rules: DecisionRules,
) -> GapTest:
    """Test for a gap with two statistics of the residual r (n,) mm, calibrated on draws under the plain model.

    Both statistics project out the stiffness, whose derivative is J (n, t).

    Bayes factor : of a gap against none. It is the mean, by prior probabilities, of the evidence of every named effect
    (itself the mean over the effect's variants) and of a smooth field without a name, `fields` (n, k), of any size. No
    other test has more power on the average over such gaps (Neyman & Pearson). The mean over variants keeps an
    effect with many of them from outweighing one with a single variant.
    Q = r'Mr : any excess over the noise, also one of no known form. Its share of the false alarms is
    `DecisionRules.whole_share`.

    The size of the noise is unknown. Evidence is therefore the mean over all sizes in `noise`, with a gap and without.
    Every draw has a size from the posterior under the plain model. A single size, fitted with a gap allowed for, gave
    false alarms where the noise happened to be small.

    refitted : log evidence by effect after nonlinear refits, for cases whose linearised test gives p of at most
    `DecisionRules.clear`; None before. Linearisation at the plain fit underrates an effect that the stiffness absorbed,
    or a push between the places tried. Draws are not refitted: the Bayes factor E with the refits is an e-value, which
    noise makes as large as 1 / p in at most a share p of cases (Vovk & Wang 2021), so that 1 / E is a p-value too. The
    smaller of the two is taken, each over its share of the level (`DecisionRules.refit_share`).
    """
    return looked_at(noise, r, J, fields, named, seed, rules=rules).test(refitted)


@dataclass(frozen=True, eq=False)
class Looks:
    """What the data, the first column, and all draws show; refits change no draw. rules : of the test.

    Q : of the data. freedom : its degrees of freedom. whole (draws,) : p-values of Q. smooth (draws,), library : log
    Bayes factors of the free field and of each effect by id.
    """

    rules: DecisionRules
    Q: float
    freedom: int
    whole: FloatArray
    smooth: FloatArray
    library: Mapping[str, FloatArray]

    def test(self, refitted: Mapping[str, float] | None = None) -> GapTest:
        """The test's outcome, see `gap_test`."""
        draws, rules = len(self.smooth), self.rules
        some = _any_named(list(self.library.values()), draws)
        factor = _of_a_gap(self.smooth, some, rules.prior_unknown)
        p = float(_p_values(factor, self.whole, rules.whole_share)[0])
        if refitted is not None:
            known = [np.maximum(one[:1], refitted.get(name, -np.inf)) for name, one in self.library.items()]
            after = _of_a_gap(self.smooth[:1], _any_named(known, 1), rules.prior_unknown)[0]
            p = min(1.0, p / (1.0 - rules.refit_share), float(np.exp(-after)) / rules.refit_share)
        return GapTest(
            self.Q,
            self.freedom,
            p,
            float(_shares(-self.whole)[0]),
            float(_shares(self.smooth)[0]),
            float(_shares(some)[0]) if self.library else 1.0,
            p < rules.level,
        )


def looked_at(
    noise: NoiseGrid,
    r: FloatArray,
    J: FloatArray,
    fields: FloatArray,
    named: Mapping[str, EffectDirections] | None = None,
    seed: int = 1,
    *,
    rules: DecisionRules,
) -> Looks:
    """Statistics of the data and of draws under the plain model; arguments as those of `gap_test`."""
    freedom = len(r) - J.shape[1]
    noise = noise.probable(r, J, fields, rules.noise_sizes)
    draws = np.column_stack([r, _drawn(noise, r, J, np.random.default_rng(seed), rules.gap_draws)])
    looks = _Statistics(noise.options.gap_sizes)
    for C, log_prior in zip(noise.covariances, noise.log_prior, strict=True):
        looks.add(C, float(log_prior), J, fields, named or {}, draws)
    smooth, library = looks.together()
    weight = softmax(looks.plain, axis=0)
    whole = (weight * stats.chi2.sf(looks.Q, freedom)).sum(axis=0)
    return Looks(rules, float((weight * looks.Q).sum(axis=0)[0]), freedom, whole, smooth, library)


def _p_values(factor: FloatArray, whole: FloatArray, whole_share: float) -> FloatArray:
    """p-values (draws,) of both statistics together, the data's first: the share of draws whose smaller p-value is as
    small."""
    return _shares(-np.minimum(_shares(factor) / (1.0 - whole_share), _shares(-whole) / whole_share))


def _drawn(noise: NoiseGrid, r: FloatArray, J: FloatArray, rng: np.random.Generator, draws: int) -> FloatArray:
    """Draws (n, draws) of noise, with sizes from their posterior under the plain model."""
    weight = softmax(noise.log_likelihood(r, J, np.zeros((len(r), len(r)))) + noise.log_prior)
    size = rng.choice(len(weight), draws, p=weight)
    out = rng.standard_normal((len(r), draws))
    for g in np.unique(size):
        out[:, size == g] = np.linalg.cholesky(noise.covariances[g]) @ out[:, size == g]
    return out


@dataclass(eq=False)
class _Statistics:
    """Statistics of every draw: lists of arrays (draws,), one array for each size of the noise.

    Q : r'Mr. plain, smooth, named : log likelihoods of the plain model, with a free field, with each effect by id.
    gap_sizes : sizes of the free field, over that of a typical gap.
    """

    gap_sizes: Sequence[float]
    Q: list[FloatArray] = field(default_factory=list)
    plain: list[FloatArray] = field(default_factory=list)
    smooth: list[FloatArray] = field(default_factory=list)
    named: dict[str, list[FloatArray]] = field(default_factory=dict)

    def add(
        self,
        C: FloatArray,
        log_prior: float,
        J: FloatArray,
        fields: FloatArray,
        named: Mapping[str, EffectDirections],
        draws: FloatArray,
    ) -> None:
        """Add the statistics under noise of covariance C (n, n)."""
        L = np.asarray(np.linalg.cholesky(C), dtype=np.float64)
        Jw = _whitened(L, J)
        x = projected(Jw, _whitened(L, draws))
        self.Q.append((x**2).sum(axis=0))
        volume = np.linalg.slogdet(Jw.T @ Jw + FLAT * np.eye(J.shape[1]))[1]
        plain = log_prior - 0.5 * self.Q[-1] - np.log(np.diag(L)).sum() - 0.5 * volume
        self.plain.append(plain)
        self.smooth.append(plain + _unnamed(projected(Jw, _whitened(L, fields)), x, self.gap_sizes))
        for name, effect in named.items():
            S = projected(Jw, _whitened(L, np.hstack(list(effect.directions))))
            self.named.setdefault(name, []).append(plain + _of_effect(S, effect, x))

    def together(self) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Log Bayes factors (draws,) against the plain model, averaged over the noise: free field, each effect."""
        plain = np.asarray(logsumexp(self.plain, axis=0))
        named = {name: np.asarray(logsumexp(rows, axis=0)) - plain for name, rows in self.named.items()}
        return np.asarray(logsumexp(self.smooth, axis=0)) - plain, named


def _whitened(L: FloatArray, x: FloatArray) -> FloatArray:
    return np.asarray(solve_triangular(L, x, lower=True, check_finite=False))


def _any_named(library: Sequence[FloatArray], n: int) -> FloatArray:
    """Log evidence (n,) of any effect of a library, with equal prior probabilities."""
    return means_of_exponentials(library) if library else np.full(n, -np.inf)


def _of_a_gap(smooth: FloatArray, named: FloatArray, prior_unknown: float) -> FloatArray:
    """Log Bayes factor of a gap, with a name or without."""
    return np.asarray(logsumexp([smooth + np.log(prior_unknown), named + np.log1p(-prior_unknown)], axis=0))


def _unnamed(fields: FloatArray, draws: FloatArray, gap_sizes: Sequence[float]) -> FloatArray:
    """Log evidence (draws,) of a free field (n, k), the mean over sizes `gap_sizes`."""
    values, vectors = np.linalg.eigh(fields.T @ fields)
    values = np.maximum(values, 0.0)
    squared_projections = (vectors.T @ (fields.T @ draws)) ** 2
    return means_of_exponentials(
        [
            0.5 * (size**2 / (1.0 + size**2 * values)) @ squared_projections - 0.5 * np.log1p(size**2 * values).sum()
            for size in gap_sizes
            if size
        ]
    )


def _of_effect(S: FloatArray, effect: EffectDirections, draws: FloatArray) -> FloatArray:
    """Log evidence (draws,) of an effect, the mean over its variants; S (n, variants * k) holds their directions side
    by side."""
    k = len(effect.scales)
    projections, gram = S.T @ draws, S.T @ S
    at = [slice(v * k, (v + 1) * k) for v in range(len(effect.directions))]
    return means_of_exponentials([_gain(gram[a, a], projections[a], effect.scales, effect.bounds) for a in at])


def _gain(A: FloatArray, projections: FloatArray, scales: FloatArray, bounds: FloatArray) -> FloatArray:
    """Log evidence (draws,) of directions S (n, k) with normal priors truncated at bounds (k, 2).

    A (k, k) : S'S. projections (k, draws) : S'r. scales (k,) : standard deviations of the priors.
    """
    values, vectors = np.linalg.eigh(A * np.outer(scales, scales))
    values = np.maximum(values, 0.0)
    b = vectors.T @ (scales[:, None] * projections)
    out = 0.5 * (1.0 / (1.0 + values)) @ b**2 - 0.5 * np.log1p(values).sum()
    limits = bounds / scales[:, None]
    for low, high, v in zip(limits[:, 0], limits[:, 1], vectors, strict=True):
        if low < -_FAR and high > _FAR:
            continue  # a bound that far cuts off nothing
        estimate = -(v / (1.0 + values)) @ b
        sd = np.sqrt(1.0 - v**2 @ (values / (1.0 + values)))
        out = out + log_share((low - estimate) / sd, (high - estimate) / sd) - log_share(low, high)
    return np.asarray(out)


def _shares(values: FloatArray) -> FloatArray:
    """For each value, the share of all values that are at least as large, itself included."""
    ascending = np.sort(values)
    return np.asarray((len(values) - np.searchsorted(ascending, values, side="left")) / len(values))
