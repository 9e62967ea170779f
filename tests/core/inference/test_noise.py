"""The noise of contours, the weights that do not trust fine detail, and the spread that follows."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.inference.posterior import NoiseFacts, laplace
from palpate.core.observe.contour_noise import (
    Weighting,
    smooth_covariance,
)
from palpate.validate.paper.contour_weights import contour_covariance, weighting_covariance

SD, LENGTH = 0.4, 7.0
BOUNDS = np.log([[1e-6, 1e6], [1e-6, 1e6]])


def sphere(n: int = 300, radius: float = 20.0) -> np.ndarray:
    """Points of a Fibonacci lattice on a sphere, (n, 3) mm."""
    k = np.arange(n) + 0.5
    z, turn = 1.0 - 2.0 * k / n, np.pi * (1.0 + np.sqrt(5.0)) * k
    r = np.sqrt(1.0 - z * z)
    return radius * np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


def test_both_contours_count() -> None:
    points = sphere(50)
    far = np.linalg.norm(points[:, None] - points[None], axis=2) > 15.0
    noise = contour_covariance(points, SD, LENGTH)
    np.testing.assert_allclose(noise[far], 2.0 * smooth_covariance(points, SD, LENGTH)[far], atol=2e-4)
    assert np.diag(noise) == pytest.approx(2.0 * SD**2 + 0.2**2)


def test_the_spread_claimed_is_the_spread_of_many_noisy_estimates() -> None:
    points = sphere()
    J = np.column_stack([points[:, 0] ** 2 / 400.0 - 0.3, points[:, 1] * points[:, 2] / 400.0])
    noise, weighting = contour_covariance(points, SD, LENGTH), Weighting(weighting_covariance(points, SD, LENGTH))
    white = weighting.whiten(J)
    back = weighting.unwhiten_adjoint(white)
    facts = NoiseFacts(back.T @ noise @ back, float(np.trace(weighting.apply(noise))))
    draws = np.linalg.cholesky(noise) @ np.random.default_rng(4).standard_normal((len(points), 4000))
    estimates = np.linalg.lstsq(white, weighting.whiten(draws), rcond=None)[0]
    residual = weighting.whiten(draws[:, 0])
    claimed = laplace(np.zeros(2), np.minimum(1.0, np.sqrt(facts.expected / (residual @ residual))) * residual, white,
                      BOUNDS, facts).covariance  # fmt: skip
    # 4,000 draws know a covariance to about 2 % of its size.
    np.testing.assert_allclose(np.cov(estimates), claimed, atol=0.08 * claimed.max())
    assert facts.expected == pytest.approx((weighting.whiten(draws) ** 2).sum(axis=0).mean(), rel=0.03)


def test_an_error_where_the_sensitivity_is_sharp_moves_the_estimate_little() -> None:
    """Two halves meet in a sharp turn of the sensitivity, and there surface extraction errs by 0.1 mm."""
    points = sphere(1200)
    turn = np.tanh(points[:, 0] / 2.0)
    J = np.column_stack([turn + 0.3, points[:, 1] * points[:, 2] / 400.0])
    error = 0.1 * points[:, 0] * np.exp(-((points[:, 0] / 3.0) ** 2))

    def shift(covariance: np.ndarray) -> float:
        weighting = Weighting(covariance)
        found = np.linalg.lstsq(weighting.whiten(J), weighting.whiten(error), rcond=None)[0]
        return float(np.abs(found).max())

    ours = shift(weighting_covariance(points, SD, LENGTH))
    trusting = shift(2.0 * smooth_covariance(points, SD, LENGTH) + 0.15**2 * np.eye(len(points)))
    assert ours < 0.5 * trusting


@pytest.mark.parametrize("side", [0, 1])
def test_a_value_at_its_bound_lies_within_its_interval(side: int) -> None:
    bounds = np.log([[5.0, 500.0]])
    J = np.full((50, 1), 2.0)
    found = laplace(bounds[:, side], np.zeros(50), J, bounds)
    low, high = found.interval()[0]
    assert (low, high)[side] == pytest.approx((5.0, 500.0)[side])
    # One-sided: 95 % of a half normal lie within 1.96 standard deviations of its bound.
    width = abs(np.log((low, high)[1 - side]) - bounds[0, side])
    assert width == pytest.approx(1.96 * found.sd[0], rel=0.01)


def test_the_interval_of_data_that_say_nothing_spans_what_was_allowed() -> None:
    """Also where the optimum ended anywhere, and one of two regions was seen."""
    bounds = np.log([[5.0, 500.0], [5.0, 500.0]])
    J = np.column_stack([np.zeros(50), np.full(50, 2.0)])
    found = laplace(np.log([11.0, 40.0]), np.zeros(50), J, bounds)
    share = (np.log(found.interval()[0]) - bounds[0, 0]) / (bounds[0, 1] - bounds[0, 0])
    np.testing.assert_allclose(share, [0.025, 0.975], atol=0.002)
    np.testing.assert_allclose(np.log(found.interval()[1] / 40.0), np.array([-1.96, 1.96]) / np.sqrt(200.0), atol=1e-3)
