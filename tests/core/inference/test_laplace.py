"""Laplace's posterior against closed forms: its covariance, its ends at a bound, its half width in kPa, its marginals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import truncnorm

from palpate.core.inference.posterior import (
    NoiseFacts,
    Posterior,
    as_before,
    flat,
    laplace,
    prior_precision,
    unknown,
)

BOUNDS = np.tile(np.log([5.0, 500.0]), (2, 1))
FLAT = 12.0 / np.log(100.0) ** 2
J = np.array([[4.0, 1.0], [0.5, 6.0], [1.0, -2.0], [0.2, 0.1]])
THETA = np.log([20.0, 60.0])


def test_the_covariance_is_that_of_data_and_flat_prior() -> None:
    found = laplace(THETA, np.full(4, 0.1), J, BOUNDS)
    assert found.scale == 1.0
    assert found.covariance == pytest.approx(np.linalg.inv(J.T @ J + FLAT * np.eye(2)), rel=1e-6)
    assert found.singular_values == pytest.approx(np.linalg.svd(J)[1], rel=1e-6)
    assert found.sd == pytest.approx(np.sqrt(np.diag(found.covariance)))


def test_a_misfit_above_what_noise_leaves_widens_it() -> None:
    """Four data, two parameters: noise leaves 2 on average; a misfit of 18 means noise three times as large."""
    found = laplace(THETA, np.array([3.0, -3.0, 0.0, 0.0]), J, BOUNDS)
    assert found.scale == pytest.approx(3.0)
    assert found.covariance == pytest.approx(np.linalg.inv(J.T @ J / 9.0 + FLAT * np.eye(2)), rel=1e-6)


def test_weights_that_are_not_the_noise_s_own_give_the_sandwich() -> None:
    rng = np.random.default_rng(1)
    half = rng.standard_normal((4, 4))
    C = half @ half.T + np.eye(4)
    found = laplace(THETA, np.zeros(4), J, BOUNDS, NoiseFacts(J.T @ C @ J, 4.0))
    H = J.T @ J
    sandwich = np.linalg.inv(H) @ (J.T @ C @ J) @ np.linalg.inv(H)
    assert found.covariance == pytest.approx(np.linalg.inv(np.linalg.inv(sandwich) + FLAT * np.eye(2)), rel=1e-6)


def test_data_without_information_leave_the_flat_prior_about_its_middle() -> None:
    found = flat(BOUNDS)
    assert found.mean == pytest.approx(BOUNDS.mean(axis=1))
    assert found.sd == pytest.approx(np.ptp(BOUNDS, axis=1) / np.sqrt(12.0))
    assert prior_precision(BOUNDS) == pytest.approx([FLAT, FLAT])
    assert unknown(found).all()
    np.testing.assert_allclose(found.ends()[:, 0], BOUNDS[:, 0] + 0.025 * np.ptp(BOUNDS[0]), atol=0.01)


def test_a_stiffness_is_unknown_where_its_interval_is_seven_tenths_of_the_prior_s_or_more() -> None:
    sd = np.log(100.0) / np.sqrt(12.0)
    assert as_before(np.array([0.69, 0.71]) * sd, BOUNDS).tolist() == [False, True]


def narrow(mean: tuple[float, float], sd: float) -> Posterior:
    """Data of that standard deviation, joined with the flat prior."""
    return laplace(np.log(mean), np.zeros(2), np.eye(2) / sd, BOUNDS)


def test_between_its_bounds_the_interval_is_central_and_the_half_width_half_of_it() -> None:
    found = narrow((20.0, 60.0), 0.2)
    assert found.ends() == pytest.approx(THETA[:, None] + 0.2 * 1.959964 * np.array([-1.0, 1.0]), abs=1e-3)
    assert found.interval() == pytest.approx(np.exp(found.ends()))
    assert found.sd_kpa() == pytest.approx(np.array([20.0, 60.0]) * np.sinh(0.2), rel=2e-3)
    assert found.quantile(0.5) == pytest.approx(THETA, abs=1e-3)


@pytest.mark.parametrize("k", [0, 1])
def test_at_a_bound_the_interval_begins_there_and_the_width_is_how_far_it_reaches(k: int) -> None:
    """Half a normal distribution: its 95 % lie within 1.96 standard deviations, its 68 % within one."""
    G = (5.0, 500.0)[k]
    found = narrow((G, 60.0), 0.3)
    inwards = 1.0 if k == 0 else -1.0
    low, high = found.ends()[0]
    assert (low if k == 0 else high) == pytest.approx(np.log(G))
    assert (high if k == 0 else low) == pytest.approx(np.log(G) + inwards * 0.3 * 1.959964, abs=0.01)
    assert found.sd_kpa()[0] == pytest.approx(abs(G * np.expm1(inwards * 0.3)), rel=0.02)
    exact = truncnorm(*((BOUNDS[0] - np.log(G)) / 0.3), loc=np.log(G), scale=0.3)
    assert found.quantile(0.3)[0] == pytest.approx(exact.ppf(0.3), abs=2e-3)


def test_a_marginal_keeps_what_belongs_to_it() -> None:
    found = laplace(THETA, np.zeros(4), J, BOUNDS)
    second = found.of(slice(1, 2))
    assert second.mean == pytest.approx(THETA[1:]) and second.sd == pytest.approx(found.sd[1:])
    assert second.bounds.shape == (1, 2) and second.ends() == pytest.approx(found.ends()[1:], abs=1e-3)
