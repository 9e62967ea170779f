"""The noise's unknown sizes: gradient, normal approximation, and points whose weighted sum is an integral."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import check_grad
from scipy.special import logsumexp
from scipy.stats import norm

from palpate.core.inference.restricted_likelihood import restricted, restricted_with_gradient
from palpate.core.observe.contour_noise import smooth_covariance
from palpate.core.residual.variance_model import NoisePart, VarianceModel, points_of

RNG = np.random.default_rng(3)
X = RNG.uniform(-20.0, 20.0, (50, 3))
J = (X[:, :2] / 20.0) ** 2
LENGTHS = (4.0, 8.0, 16.0)
MATRICES = np.stack([*(smooth_covariance(X, 1.0, length) for length in LENGTHS), np.eye(len(X))])


@pytest.fixture
def model() -> VarianceModel:
    """A smooth part, whose length is unknown, and one of every datum."""
    return VarianceModel([NoisePart(3, 0.5, 0.7), NoisePart(1, 0.3, 0.7)], MATRICES, 0.01 * np.eye(len(X)), 1.5)


def drawn(coefficients: list[float], seed: int = 0) -> np.ndarray:
    C = np.tensordot(coefficients, MATRICES, 1) + 0.01 * np.eye(len(X))
    return np.linalg.cholesky(C) @ np.random.default_rng(seed).standard_normal(len(X))


def test_the_restricted_likelihood_has_the_slope_that_differences_have(model: VarianceModel) -> None:
    r, at = drawn([0.0, 0.3, 0.0, 0.05]), RNG.standard_normal(model.unknowns)
    coefficients, _ = model.coefficients(at)
    C = model.fixed + np.tensordot(coefficients, MATRICES, 1)
    assert restricted_with_gradient(C, MATRICES, r, J)[0] == pytest.approx(restricted(C, r, J), abs=1e-9)
    error = check_grad(lambda x: model.log_posterior(x, r, J)[0], lambda x: model.log_posterior(x, r, J)[1], at)
    assert error < 1e-4 * np.linalg.norm(model.log_posterior(at, r, J)[1])


def test_a_part_keeps_its_variance_however_it_is_shared_among_lengths(model: VarianceModel) -> None:
    at = RNG.standard_normal(model.unknowns)
    at[0] = 1.0
    coefficients, _ = model.coefficients(at)
    assert coefficients[:3].sum() == pytest.approx((0.5 * np.exp(0.7)) ** 2)
    even, _ = model.coefficients(np.zeros(model.unknowns))
    np.testing.assert_allclose(even, [0.25 / 3.0] * 3 + [0.09])


def test_sizes_and_lengths_are_found_again(model: VarianceModel) -> None:
    """Twelve draws of smooth noise of 0.6 mm over 8 mm, and 0.15 mm of every datum."""
    found = []
    for seed in range(12):
        theta, _ = model.approximation(drawn([0.0, 0.36, 0.0, 0.15**2], seed), J)
        found.append(model.coefficients(theta)[0])
    mean = np.mean(found, axis=0)
    assert np.sqrt(mean[:3].sum()) == pytest.approx(0.6, abs=0.12)
    assert np.sqrt(mean[3]) == pytest.approx(0.15, abs=0.04)
    assert mean[1] > 1.5 * max(mean[0], mean[2])


def test_a_part_that_the_data_do_not_see_stays_at_its_median(model: VarianceModel) -> None:
    unseen = replace(model, matrices=np.concatenate([MATRICES[:3], np.zeros((1, len(X), len(X)))]))
    assert unseen.unknowns == model.unknowns - 1
    assert unseen.coefficients(np.ones(unseen.unknowns))[0][3] == pytest.approx(0.09)


def test_the_points_integrate_over_the_prior() -> None:
    """One size: the evidence by the points and by a fine grid agree to 3 %, near the prior's middle and two
    standard deviations away, where the approximation is centred elsewhere than the prior."""
    model = VarianceModel([NoisePart(1, 0.3, 0.7)], MATRICES[3:], np.zeros((len(X), len(X))), 1.5)
    for size in (0.3, 1.2):
        r = size * np.random.default_rng(1).standard_normal(len(X))
        other = (np.full(1, 0.5), np.eye(1))
        points, weights = points_of([model.approximation(r, J), other], 32)

        def log_likelihood(theta: float, r: np.ndarray = r) -> float:
            C = np.tensordot(model.coefficients(np.array([theta]))[0], model.matrices, 1)
            return restricted(C, r, J)

        by_points = logsumexp([log_likelihood(t) + w for (t,), w in zip(points, weights, strict=True)])
        grid = np.linspace(-6.0, 6.0, 2001)
        fine = logsumexp([log_likelihood(t) + norm.logpdf(t) for t in grid]) + np.log(grid[1] - grid[0])
        assert by_points == pytest.approx(fine, abs=0.03)


def test_the_curvature_is_that_of_the_posterior() -> None:
    """The size of n independent data is known to 1 / sqrt(2 n) of itself, with a wide prior."""
    model = VarianceModel([NoisePart(1, 0.3, 5.0)], MATRICES[3:], np.zeros((len(X), len(X))), 1.5)
    _, covariance = model.approximation(0.5 * np.random.default_rng(2).standard_normal(len(X)), J)
    assert 5.0 * np.sqrt(covariance[0, 0]) == pytest.approx(1.0 / np.sqrt(2.0 * (len(X) - 2)), rel=0.05)


def test_data_do_not_make_a_size_less_known_than_its_prior() -> None:
    """One datum of 3 mm beside a known error of 2 mm: there the log likelihood curves upwards, by 0.04 of the prior's curvature."""
    none = np.zeros((1, 0))
    flank = VarianceModel([NoisePart(1, 1.0, 0.7)], np.eye(1)[None], 4.0 * np.eye(1), 1.5)
    mode, covariance = flank.approximation(np.array([3.0]), none)
    slopes = [flank.log_posterior(mode + step, np.array([3.0]), none)[1][0] for step in (-1e-3, 1e-3)]
    assert 0.95 < (slopes[0] - slopes[1]) / 2e-3 < 0.97
    assert covariance[0, 0] == 1.0
