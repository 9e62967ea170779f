"""The posterior over hypotheses on arrays: its prior, its calibration over thousands of draws, and the set that is the answer."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtr, ndtri

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.gap_test import NullDistribution, free_field, null_distribution
from palpate.core.diagnose.posterior import (
    NONE,
    UNKNOWN,
    given_a_gap,
    log_factor_of_a_gap,
    log_prior,
    names_of,
    posterior,
    smallest_set,
)
from palpate.core.inference.evidence import Directions, means_of_exponentials
from palpate.core.residual.covariance_family import CovarianceFamily
from palpate.core.residual.noise_covariance import NoiseSizes
from palpate.core.residual.noise_estimation import NoiseGrid
from palpate.core.residual.noise_model_options import NoiseModelOptions

RULES, NUMBERS = DecisionRules(), NoiseModelOptions()
SIZES = (0.25, 0.5, 1.0)


class Linear:
    """A linear case: rows of a surface, whose noise is correlated and of unknown size, and of images, whose noise is of unit variance."""

    def __init__(self, surface: int, images: int) -> None:
        rng = np.random.default_rng(8)
        n = surface + images
        at = np.arange(surface)
        drawn, known = np.zeros((n, n)), np.zeros((n, n))
        drawn[:surface, :surface] = np.exp(-0.5 * ((at[:, None] - at) / 2.0) ** 2)
        known[np.arange(n), np.arange(n)] = np.where(np.arange(n) < surface, 0.04, 1.0)
        self.noise = NoiseGrid(
            [replace(NoiseSizes.of(NUMBERS), contour=s) for s in SIZES],
            CovarianceFamily(np.stack([drawn, known]), np.array([[s**2, 1.0] for s in SIZES])),
            np.log([0.3, 0.4, 0.3]),
            NUMBERS,
        )
        scale = np.where(np.arange(n) < surface, 0.3, 0.6)[:, None]

        def random(k: int) -> np.ndarray:
            return scale * rng.standard_normal((n, k))

        self.J, self.precision = random(2), np.array([0.5, 0.8])
        one_way, anywhere = np.array([[0.0, np.inf]]), np.tile([-np.inf, np.inf], (3, 1))
        swollen = [Directions.at_zero(random(1), np.ones(1), one_way) for _ in range(3)]
        moved = [Directions.at_zero(random(3), np.array([0.5, 1.0, 0.7]), anywhere)]
        pushed = [Directions.at_zero(random(1), np.array([1.5]), np.array([[-1.0, 2.5]])) for _ in range(2)]
        self.causes = {
            "swollen": swollen,
            "moved": moved,
            "pushed": pushed,
            UNKNOWN: free_field(0.5 * random(12), (0.0, 0.5, 1.0)),
        }
        self.causes |= {f"{a}+{b}": [_both(x, y) for x in self.causes[a] for y in self.causes[b]] for a, b in PAIRS}
        self.names = [NONE, *self.causes]
        self.prior = np.exp([log_prior(name, 3, RULES) for name in self.names])

    def drawn(self, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Which hypothesis is true (count,), and the residuals (n, count) of the plain model, all drawn from the prior."""
        truth, size = (
            rng.choice(len(self.names), count, p=self.prior),
            rng.choice(3, count, p=np.exp(self.noise.log_prior)),
        )
        factors = [np.linalg.cholesky(C) for C in self.noise.covariances]
        r = np.stack([factors[s] @ rng.standard_normal(len(self.J)) for s in size], axis=1)
        r -= self.J @ (rng.standard_normal((2, count)) / np.sqrt(self.precision)[:, None])
        for k, which in enumerate(truth):
            if which:
                variants = self.causes[self.names[which]]
                one = variants[rng.integers(len(variants))]
                low, high = (one.bounds / one.scales[:, None]).T
                r[:, k] -= one.S @ (one.scales * ndtri(rng.uniform(ndtr(low), ndtr(high))))
        return truth, r

    def factors(self, r: np.ndarray, sign: float = 1.0) -> dict[str, np.ndarray]:
        """Log Bayes factors (count,) of every cause; sign : of the directions."""
        out, plain = {}, self.noise.log_evidence(r, self.J, self.precision, [Directions.none(len(r))])
        for name, variants in self.causes.items():
            turned = [replace(one, S=sign * one.S) for one in variants]
            out[name] = means_of_exponentials(self.noise.log_evidence(r, self.J, self.precision, turned)) - plain[0]
        return out


PAIRS = list(combinations(("swollen", "moved", "pushed"), 2))


def _both(a: Directions, b: Directions) -> Directions:
    return Directions.at_zero(
        np.hstack([a.S, b.S]), np.concatenate([a.scales, b.scales]), np.vstack([a.bounds, b.bounds])
    )


CASES = {"contours": Linear(40, 0), "contours and images": Linear(40, 60), "images alone": Linear(0, 80)}


@pytest.mark.parametrize("seen", CASES)
def test_the_posterior_over_hypotheses_is_calibrated(seen: str) -> None:
    """2,000 draws of the prior: where the truth lies in its own posterior is uniform, and every probability is a frequency."""
    case, rng = CASES[seen], np.random.default_rng(12)
    truth, r = case.drawn(2000, rng)
    ranks, p = _ranks(case.factors(r), truth, case.names, rng)
    assert stats.kstest(ranks, "uniform").pvalue > 0.01
    assert np.abs(_off(p, truth)).max() < 3.5
    sets = [smallest_set(dict(zip(case.names, row, strict=True)), 0.9) for row in p.tolist()]
    assert np.mean([case.names[t] in found for t, found in zip(truth, sets, strict=True)]) >= 0.89


def test_a_sign_that_is_turned_is_noticed() -> None:
    """Bounds make the sign of an effect count: with the directions turned, an effect that goes one way is true far more often than it
    is probable."""
    case, rng = CASES["contours and images"], np.random.default_rng(12)
    truth, r = case.drawn(2000, rng)
    _, p = _ranks(case.factors(r, -1.0), truth, case.names, rng)
    assert _off(p, truth)[case.names.index("swollen")] > 10.0


def _off(p: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """How much more often each hypothesis is true than it is probable (count, hypotheses), in standard deviations."""
    hits = np.arange(p.shape[1]) == truth[:, None]
    return np.asarray((hits - p).sum(axis=0) / np.sqrt((p * (1.0 - p)).sum(axis=0)))


def _ranks(
    factors: dict[str, np.ndarray], truth: np.ndarray, names: list[str], rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Randomised rank (count,) of the truth in its posterior, and that posterior (count, hypotheses)."""
    p = np.array(
        [
            list(posterior(dict(zip(factors, row, strict=True)), 3, RULES).values())
            for row in np.transpose(list(factors.values()))
        ]
    )
    below = np.cumsum(p, axis=1) - p
    at = np.arange(len(truth))
    assert names[0] == NONE
    return below[at, truth] + rng.uniform(size=len(truth)) * p[at, truth], p


@pytest.mark.parametrize("seen", CASES)
def test_p_values_without_an_effect_are_uniform(seen: str) -> None:
    """400 draws of the plain model, of a stiffness and a size of the noise that nobody knows."""
    case, rng, p = CASES[seen], np.random.default_rng(5), []
    few = replace(RULES, draws=99)
    for k in range(400):
        noise = np.linalg.cholesky(case.noise.covariances[int(rng.choice(3, p=np.exp(case.noise.log_prior)))])
        r = noise @ rng.standard_normal(len(case.J)) - case.J @ rng.standard_normal(2)
        null = null_distribution(case.noise, r, case.J, case.precision, _singles(case), k, rules=few)
        p.append(null.test().p_value)
    assert stats.kstest(p, "uniform").pvalue > 0.05
    assert np.mean(np.array(p) < 0.05) < 0.08


def _singles(case: Linear) -> dict[str, list[Directions]]:
    return {name: variants for name, variants in case.causes.items() if "+" not in name}


def test_the_prior_is_shared_out_once_over_the_whole_library() -> None:
    for library in (1, 2, 12):
        names = [f"effect{k}" for k in range(library)]
        every = [NONE, UNKNOWN, *names, *(f"{a}+{b}" for a, b in combinations(names, 2))]
        assert np.exp([log_prior(name, library, RULES) for name in every]).sum() == pytest.approx(1.0)


def test_what_is_not_refitted_keeps_its_share_of_the_prior() -> None:
    """One effect of twelve with a factor of e: its odds to something unnamed do not hang on how many of the others were refitted."""
    hopeless = {f"effect{k}": -8.0 for k in range(11)}
    found = posterior({"prestress": 1.0, **hopeless, UNKNOWN: 0.0}, 12, RULES)
    share = 0.8 * (1.0 - RULES.prior_pair) / 12.0
    assert found["prestress"] / found[UNKNOWN] == pytest.approx(np.e * share / RULES.prior_unknown)
    assert found[UNKNOWN] / found[NONE] == pytest.approx(RULES.prior_unknown)
    assert sum(found.values()) == pytest.approx(1.0)
    causes = {name: p for name, p in found.items() if name != NONE}
    assert given_a_gap(found) == pytest.approx({name: p / sum(causes.values()) for name, p in causes.items()})
    assert sum(given_a_gap(found).values()) == pytest.approx(1.0)


def test_a_bayes_factor_of_a_gap_is_the_odds_of_all_causes_to_none() -> None:
    factors = {"a": np.array([1.0, -2.0]), UNKNOWN: np.array([0.5, 3.0])}
    found = log_factor_of_a_gap(factors, 1, RULES)
    for k in range(2):
        p = posterior({name: float(row[k]) for name, row in factors.items()}, 1, RULES)
        odds = (1.0 - p[NONE]) / p[NONE] * RULES.prior_nothing / (1.0 - RULES.prior_nothing)
        assert found[k] == pytest.approx(np.log(odds))


def test_the_smallest_set_holds_its_share() -> None:
    p = {"a": 0.55, UNKNOWN: 0.1, "b": 0.3, NONE: 0.05}
    assert smallest_set(p, 0.5) == ("a",)
    assert smallest_set(p, 0.85) == ("a", "b")
    assert smallest_set(p, 0.9) == ("a", "b", UNKNOWN)
    assert smallest_set(p, 1.0) == ("a", "b", UNKNOWN, NONE)
    assert names_of(("a+b", UNKNOWN, "b", "c", "d", NONE), 3) == ("a", "b", "c")


def null(*data: float, draws: int = 199) -> NullDistribution:
    """Variants of an effect with these log factors; draws from -4 upward."""
    rows = np.linspace(-4.0, 2.0, draws)
    found = np.array([[value, *rows] for value in data])
    return NullDistribution(RULES, {"a": found, UNKNOWN: np.full((2, draws + 1), -3.0)})


def test_a_p_value_is_the_share_of_draws_with_as_large_a_factor() -> None:
    assert null(9.0).test().p_value == 1 / 200
    assert null(-9.0).test().p_value == 1.0
    middle = null(-1.0).test()
    assert middle.p_value == pytest.approx(101 / 200) == middle.p_named
    assert middle.p_smooth == 1.0
    assert (null(9.0).test().detected, middle.detected) == (True, False)


def test_the_smaller_of_two_p_values_is_paid_for() -> None:
    """A refit that says the same costs its look; one that gains much is an e-value, over its own share of the level."""
    quiet = null(1.4)
    alone = quiet.test().p_value
    assert quiet.test({"a": 1.4}).p_value == pytest.approx(alone / (1.0 - RULES.refit_share))
    share = 0.8 / (1.0 - RULES.prior_nothing) * (1.0 - RULES.prior_nothing)
    assert null(-1.0).test({"a": 12.0}).p_value == pytest.approx(np.exp(-12.0) / share / RULES.refit_share, rel=1e-3)
    assert null(-9.0).test({"a": -9.0}).p_value == 1.0
    # What was not refitted keeps its factor: a field without a name is as good a cause.
    unnamed = NullDistribution(RULES, {**null(-9.0).factors, UNKNOWN: np.array([[14.0, *np.full(199, -3.0)]])})
    paid = RULES.prior_unknown * RULES.refit_share
    assert unnamed.test({"a": -9.0}).p_value == pytest.approx(np.exp(-14.0) / paid, rel=1e-3)


def test_another_level_and_fewer_draws_make_another_test() -> None:
    case = CASES["contours"]
    r = np.linalg.cholesky(case.noise.covariances[1]) @ np.random.default_rng(1).standard_normal(len(case.J))
    seen = r - 6.0 * case.causes["moved"][0].S[:, 0]
    few = replace(RULES, draws=50)
    found = null_distribution(case.noise, seen, case.J, case.precision, _singles(case), rules=few).test()
    assert found.p_value == 1 / 51 and found.detected
    strict = null_distribution(
        case.noise, seen, case.J, case.precision, _singles(case), rules=replace(few, level=1 / 51)
    )
    assert not strict.test().detected
    assert found.log_factor > 5.0


def test_weights_of_the_sizes_are_those_of_the_data() -> None:
    """A free field of each size but none is a variant."""
    field = np.ones((4, 2))
    assert [one.scales.tolist() for one in free_field(field, (0.0, 0.5, 2.0))] == [[0.5, 0.5], [2.0, 2.0]]
