"""Score tests and evidence on small linear problems whose answers are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, stats
from scipy.special import log_ndtr
from scipy.stats import norm

from palpate.core.diagnose.effects import library
from palpate.core.inference.evidence import (
    Directions,
    allowed,
    explained,
    log_evidence,
    log_share,
    mean_of_exponentials,
    projected,
    score,
)
from palpate.core.residual.covariance_family import CovarianceFamily
from palpate.core.residual.noise_covariance import NoiseSizes
from palpate.core.residual.noise_estimation import NoiseGrid
from palpate.core.residual.noise_model_options import NoiseModelOptions

N, T = 40, 2
RNG = np.random.default_rng(5)
J = RNG.standard_normal((N, T))
S = RNG.standard_normal((N, 3))
FIELDS = RNG.standard_normal((N, 12))
SCALES = np.array([0.5, 1.0, 2.0])
NUMBERS = NoiseModelOptions()
SIZES = NoiseSizes.of(NUMBERS)
LOOSE = np.array([0.4, 0.9])  # precision of the stiffness


def factor(r: np.ndarray, added: Directions, free: np.ndarray | None = None) -> float:
    """Log Bayes factor of what is added against nothing."""
    plain = log_evidence(r[:, None], J, LOOSE, Directions.none(N))
    return float((log_evidence(r[:, None], J, LOOSE, added, free) - plain)[0])


def test_evidence_is_the_density_of_what_is_seen() -> None:
    """Both parameters of the stiffness and three of the effect integrated out; up to the constant of the noise."""
    r = RNG.standard_normal((N, 5)) + (S @ [0.4, -0.8, 1.5])[:, None]
    C = np.eye(N) + J @ np.diag(1.0 / LOOSE) @ J.T + (S * SCALES) @ (S * SCALES).T
    found = log_evidence(r, J, LOOSE, Directions.at_zero(S, SCALES)) - 0.5 * N * np.log(2.0 * np.pi)
    np.testing.assert_allclose(found, stats.multivariate_normal(cov=C).logpdf(r.T), atol=1e-8)


def test_evidence_does_not_hang_on_where_a_linear_model_is_looked_at() -> None:
    """At phi = 0, at its optimum and anywhere else; a sign of phi or of the residual that is turned changes it."""
    r, phi = RNG.standard_normal((N, 1)), np.array([0.3, -0.7, 1.1])
    there = Directions(S, SCALES, np.tile([-np.inf, np.inf], (3, 1)), phi)

    def seen(shift: np.ndarray, at: np.ndarray) -> float:
        return float(log_evidence(r + (S @ shift)[:, None], J, LOOSE, replace(there, phi=at))[0])

    here = seen(0.0 * phi, 0.0 * phi)
    assert seen(phi, phi) == pytest.approx(here, abs=1e-9)
    assert abs(seen(-phi, phi) - here) > 0.1
    assert abs(seen(phi, -phi) - here) > 0.1


def test_the_same_evidence_as_the_score_test_s_where_the_prior_of_the_stiffness_is_flat() -> None:
    r = RNG.standard_normal(N) - S @ [0.4, -0.8, 1.5]
    flat, bounds = np.full(T, 1e-8), np.array([[0.0, np.inf], [-np.inf, np.inf], [-np.inf, np.inf]])
    one = Directions.at_zero(S, SCALES, bounds)
    found = log_evidence(r[:, None], J, flat, one) - log_evidence(r[:, None], J, flat, Directions.none(N))
    assert found[0] == pytest.approx(score(r, J, S, SCALES, bounds).log_evidence, abs=1e-5)


@pytest.mark.parametrize("phi", [-2.0, 0.1, 0.6, 4.0])
def test_evidence_of_an_effect_with_bounds_is_an_integral_between_them(phi: float) -> None:
    """One parameter, scale 0.5, from 0 to 0.8; against quadrature, also where the data ask for what is not allowed."""
    r, one = np.random.default_rng(3).standard_normal(N) - phi * S[:, 0], S[:, :1]
    a, b = projected(J, one)[:, 0], projected(J, r)
    prior = stats.truncnorm(0.0, 0.8 / 0.5, scale=0.5)
    value = integrate.quad(lambda x: np.exp(-0.5 * (2.0 * x * a @ b + x**2 * a @ a)) * prior.pdf(x), 0.0, 0.8)[0]
    bounds, flat = np.array([[0.0, 0.8]]), np.full(T, 1e-8)
    assert score(r, J, one, SCALES[:1], bounds).log_evidence == pytest.approx(np.log(value), abs=1e-6)
    added = Directions.at_zero(one, SCALES[:1], bounds)
    found = log_evidence(r[:, None], J, flat, added) - log_evidence(r[:, None], J, flat, Directions.none(N))
    assert found[0] == pytest.approx(np.log(value), abs=1e-5)


def test_what_is_held_at_a_bound_gains_nothing_beyond_it() -> None:
    """The first parameter stays where it is: the residual keeps what it could take beyond."""
    r, added = RNG.standard_normal(N) - 2.0 * S[:, 0], Directions.at_zero(S, SCALES)
    free = np.array([True, True, False, True, True])
    others = Directions.at_zero(S[:, 1:], SCALES[1:])
    assert factor(r, added, free) < factor(r, added) - 1.0
    # Its volume counts: it is a parameter of the model, though the data push it against its bound.
    X = np.hstack([J, S[:, 1:] * SCALES[1:]])
    H = X.T @ X + np.diag([*LOOSE, 1.0, 1.0])
    column = S[:, 0] * SCALES[0]
    left = column @ column + 1.0 - (X.T @ column) @ np.linalg.solve(H, X.T @ column)
    assert factor(r, added, free) == pytest.approx(factor(r, others) - 0.5 * np.log(left), abs=1e-9)


def test_evidence_over_sizes_of_the_noise_is_their_mean() -> None:
    """With the noise's own volume: at twice the size, the density of forty data falls by 2 ** 40."""
    sizes, log_prior = np.array([0.7, 1.4]), np.log([0.3, 0.7])
    grid = NoiseGrid([SIZES] * 2, CovarianceFamily(np.eye(N)[None], sizes[:, None] ** 2), log_prior, NUMBERS)
    r = 0.9 * RNG.standard_normal((N, 2))
    found = grid.log_evidence(r, J, LOOSE, [Directions.none(N), Directions.at_zero(S, SCALES)])
    for k, columns in enumerate((np.zeros((N, 3)), S * SCALES)):
        rows = [
            stats.multivariate_normal(
                cov=s**2 * np.eye(N) + J @ np.diag(1.0 / LOOSE) @ J.T + columns @ columns.T
            ).logpdf(r.T)
            for s in sizes
        ]
        written = np.log(np.exp(log_prior) @ np.exp(rows))
        np.testing.assert_allclose(found[k] - 0.5 * N * np.log(2.0 * np.pi), written, atol=1e-8)


def log_density(r: np.ndarray, columns: np.ndarray) -> float:
    """Of r ~ N(0, I + columns columns' + 1e8 J J'): the stiffness has a flat prior."""
    C = np.eye(N) + columns @ columns.T + 1e8 * J @ J.T
    return float(stats.multivariate_normal(cov=C, allow_singular=False).logpdf(r))


def test_evidence_is_the_ratio_of_marginal_likelihoods() -> None:
    r = RNG.standard_normal(N) + S @ [0.4, -0.8, 1.5]
    expected = log_density(r, S * SCALES) - log_density(r, np.zeros((N, 1)))
    assert score(r, J, S, SCALES).log_evidence == pytest.approx(expected, abs=1e-4)


def test_an_effect_that_can_only_go_one_way_gains_ln_2_where_the_data_agree() -> None:
    bounds, scale = np.array([[0.0, np.inf]]), np.ones(1)
    assert allowed(np.array([5.0]), np.array([0.5]), scale, bounds) == pytest.approx(np.log(2.0))
    assert allowed(np.array([0.0]), np.array([0.5]), scale, bounds) == pytest.approx(0.0)
    assert allowed(np.array([-20.0]), np.array([0.5]), scale, bounds) < -700.0
    assert allowed(np.array([5.0]), np.array([0.5]), scale, np.array([[-np.inf, np.inf]])) == 0.0


def test_an_effect_that_the_stiffness_can_imitate_has_no_evidence() -> None:
    found = score(RNG.standard_normal(N), J, J @ np.array([[1.0], [2.0]]), np.ones(1))
    assert found.log_evidence == pytest.approx(0.0, abs=1e-9)
    assert np.abs(projected(J, J)).max() < 1e-12


def test_the_score_finds_the_amplitude_that_was_put_in() -> None:
    phi = np.array([0.3, -0.5, 1.0])
    found = score(-50.0 * S @ phi + 30.0 * J[:, 0], J, 50.0 * S, SCALES)
    np.testing.assert_allclose(found.estimate, phi, atol=5e-3)


def test_the_score_statistic_is_chi_squared_without_an_effect() -> None:
    values = [score(RNG.standard_normal(N), J, S, SCALES).p_value for _ in range(300)]
    assert stats.kstest(values, "uniform").pvalue > 0.01


def test_a_mean_of_exponentials_survives_large_exponents() -> None:
    assert mean_of_exponentials(np.array([1000.0, 1000.0 + np.log(3.0)])) == pytest.approx(1000.0 + np.log(2.0))


def test_a_load_that_pulls_is_no_push() -> None:
    unlike = library(None)["unmodelled_load"].unlike
    assert unlike({"pressure": 20.0, "shear_1": -30.0, "pressure_2": -5.0}) == ""
    assert "pulls" in unlike({"pressure": 5.0, "shear_1": 30.0, "pressure_2": -20.0})


def test_a_change_of_stiffness_is_no_gap() -> None:
    assert explained(100.0 * J[:, 1], J) < 1e-18


def test_bounds_count_by_the_mass_that_data_and_prior_have_within_them() -> None:
    """A posterior of 1.0 +- 0.5 under a prior of sd 2.5, allowed between -0.5 and 1.5."""
    bounds = np.array([[-0.5, 1.5], [-np.inf, np.inf]])
    found = allowed(np.array([1.0, 7.0]), np.array([0.5, 0.1]), np.array([2.5, 3.0]), bounds)
    within = norm.cdf(1.0) - norm.cdf(-3.0)
    assert found == pytest.approx(np.log(within / (norm.cdf(0.6) - norm.cdf(-0.2))))
    # Far in a tail the share is not lost to rounding, on either side.
    low, high = np.array([30.0, -31.0]), np.array([31.0, -30.0])
    assert log_share(low, high) == pytest.approx([log_ndtr(-30.0)] * 2, rel=1e-6)
