"""Test for a gap: the Bayes factor of any cause against nothing, and how often noise alone makes it as large."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import softmax

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.posterior import UNKNOWN, log_factor_of_a_gap
from palpate.core.inference.evidence import Directions, means_of_exponentials
from palpate.core.residual.noise_estimation import NoiseGrid


@dataclass(frozen=True)
class GapTest:
    """Outcome of the test for a gap.

    log_factor : of any cause against nothing, linear about the plain fit. p_value : see `NullDistribution.test`. p_smooth, p_named : the
    same of a field without a name alone and of the library alone; 1 without a library. detected : whether p_value is below
    `DecisionRules.level`; of a comparison (`comparison.compared`), whether a cause is more probable than none as well.
    """

    log_factor: float
    p_value: float
    p_smooth: float
    p_named: float
    detected: bool


@dataclass(frozen=True, eq=False)
class NullDistribution:
    """Log Bayes factors (v, 1 + draws) against nothing of the v variants of every cause by name: of the data, the first column, and of
    draws under the plain model. All are linear about the plain fit. UNKNOWN is a smooth field without a name, a variant for each of its
    sizes."""

    rules: DecisionRules
    factors: Mapping[str, FloatArray]

    @property
    def library(self) -> int:
        """Number of effects with a name."""
        return len(self.factors) - 1

    def of_data(self, name: str) -> FloatArray:
        """Log Bayes factors (v,) of a cause's variants."""
        return self.factors[name][:, 0]

    def test(self, refitted: Mapping[str, float] | None = None) -> GapTest:
        """Test by the rank of the data's Bayes factor among those of the draws.

        No other test has more power on the average over such causes (Neyman & Pearson). refitted : log Bayes factors by hypothesis
        at their own optimum, where they were looked for. Draws are not refitted: the factor E with the refits is an e-value, which noise
        makes as large as 1 / p in at most a share p of cases, so that 1 / E is a p-value too (Vovk & Wang 2021). The smaller of the
        two counts, each over its share of the level (`DecisionRules.refit_share`).
        """
        each = {name: means_of_exponentials(rows) for name, rows in self.factors.items()}
        factor = log_factor_of_a_gap(each, self.library, self.rules)
        named = {name: row for name, row in each.items() if name != UNKNOWN}
        p = _rank(factor)
        if refitted is not None:
            known = {name: row[:1] for name, row in each.items()}
            known |= {name: np.array([value]) for name, value in refitted.items()}
            after = float(log_factor_of_a_gap(known, self.library, self.rules)[0])
            p = min(1.0, p / (1.0 - self.rules.refit_share), float(np.exp(-after)) / self.rules.refit_share)
        p_named = _rank(log_factor_of_a_gap(named, self.library, self.rules)) if named else 1.0
        return GapTest(float(factor[0]), p, _rank(each[UNKNOWN]), p_named, p < self.rules.level)


def null_distribution(
    noise: NoiseGrid,
    r: FloatArray,
    J: FloatArray,
    precision: FloatArray,
    causes: Mapping[str, Sequence[Directions]],
    seed: int = 1,
    *,
    rules: DecisionRules,
) -> NullDistribution:
    """Bayes factors of the residual r (n,) mm and of draws of noise, whose size is from its posterior under the plain model.

    J (n, t), precision (t,) : derivative in ln G, and of its prior. causes : variants of every effect by id, and the free field's
    (`free_field`).
    """
    data = np.column_stack([r, _drawn(noise, r, J, np.random.default_rng(seed), rules.draws)])
    flat = [Directions.none(len(r)), *(one for variants in causes.values() for one in variants)]
    rows = noise.log_evidence(data, J, precision, flat)
    ends = np.cumsum([1, *(len(variants) for variants in causes.values())])
    each = [rows[a:b] - rows[0] for a, b in pairwise(ends)]
    return NullDistribution(rules, dict(zip(causes, each, strict=True)))


def free_field(fields: FloatArray, sizes: Sequence[float]) -> list[Directions]:
    """Variants of a cause without a name: a smooth field, fields (n, k) mm, of each size but 0 over the typical one."""
    return [Directions.at_zero(fields, np.full(fields.shape[1], size)) for size in sizes if size]


def _drawn(noise: NoiseGrid, r: FloatArray, J: FloatArray, rng: np.random.Generator, draws: int) -> FloatArray:
    """Draws (n, draws) of noise, with sizes from their posterior under the plain model."""
    weight = softmax(noise.log_likelihood(r, J, np.zeros((len(r), len(r)))) + noise.log_prior)
    size = rng.choice(len(weight), draws, p=weight)
    out = rng.standard_normal((len(r), draws))
    for g in np.unique(size):
        out[:, size == g] = np.linalg.cholesky(noise.covariances[g]) @ out[:, size == g]
    return out


def _rank(values: FloatArray) -> float:
    """Share of all values that are at least as large as the first, itself included."""
    return float(np.mean(values >= values[0]))
