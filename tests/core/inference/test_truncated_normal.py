"""Normal distributions cut at bounds, against sums over a fine grid and against draws."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.inference.truncated_normal import cut


@pytest.mark.parametrize(
    "bounds", [(-1.0, 2.0), (0.5, np.inf), (-np.inf, -2.5), (7.0, 9.0), (-np.inf, np.inf), (-60.0, 60.0)]
)
def test_one_variable_has_the_moments_of_a_sum_over_a_grid(bounds: tuple[float, float]) -> None:
    mean, sd = 0.3, 0.8
    found = cut(np.array([mean]), np.array([[sd**2]]), np.array([bounds]))
    x, step = np.linspace(max(bounds[0], mean - 16.0), min(bounds[1], mean + 16.0), 2_000_001, retstep=True)
    density = np.exp(-0.5 * ((x - mean) / sd) ** 2) / (sd * np.sqrt(2.0 * np.pi))
    density[[0, -1]] *= 0.5
    share = float(density.sum() * step)
    exact = float(density @ x) * step / share
    assert found.mean[0] == pytest.approx(exact, abs=1e-6)
    assert found.covariance[0, 0] == pytest.approx(float(density @ (x - exact) ** 2) * step / share, rel=1e-4)
    assert np.exp(found.log_share) == pytest.approx(share, rel=1e-6)


def test_what_hangs_on_a_cut_variable_moves_with_it() -> None:
    """Drawn: one variable has a bound, the other hangs on it."""
    mean, covariance = np.array([0.2, 1.0]), np.array([[1.0, -0.7], [-0.7, 0.9]])
    found = cut(mean, covariance, np.array([[0.8, 4.0]]))
    draws = np.random.default_rng(2).multivariate_normal(mean, covariance, size=400_000)
    left = draws[(draws[:, 0] > 0.8) & (draws[:, 0] < 4.0)]
    np.testing.assert_allclose(found.mean, left.mean(axis=0), atol=0.01)
    np.testing.assert_allclose(found.covariance, np.cov(left.T), atol=0.01)
    assert np.exp(found.log_share) == pytest.approx(len(left) / len(draws), rel=0.02)


def test_two_cut_variables_come_near_draws() -> None:
    mean, covariance = np.zeros(2), np.array([[1.0, 0.5], [0.5, 1.0]])
    found = cut(mean, covariance, np.array([[-1.0, 1.5], [0.0, 3.0]]))
    draws = np.random.default_rng(3).multivariate_normal(mean, covariance, size=400_000)
    left = draws[(draws[:, 0] > -1.0) & (draws[:, 0] < 1.5) & (draws[:, 1] > 0.0) & (draws[:, 1] < 3.0)]
    np.testing.assert_allclose(found.mean, left.mean(axis=0), atol=0.05)
    np.testing.assert_allclose(np.diag(found.covariance), left.var(axis=0), atol=0.05)
    assert np.exp(found.log_share) == pytest.approx(len(left) / len(draws), rel=0.05)
