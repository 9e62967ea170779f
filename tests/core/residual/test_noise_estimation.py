"""The noise of a case is not taken for smaller than it is to make room for a gap that is not there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.stats import multivariate_normal

from palpate.core.inference.evidence import Directions
from palpate.core.observe.contour_noise import noise_modes, smooth_covariance
from palpate.core.residual import noise_estimation
from palpate.core.residual.covariance_family import CovarianceFamily
from palpate.core.residual.noise_covariance import NoiseSizes
from palpate.core.residual.noise_estimation import NoiseGrid, fit_noise
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.variance_model import NoisePart, VarianceModel

FACTORS = (0.4, 0.6, 0.8, 1.0, 1.2)
X = np.random.default_rng(0).uniform(-20.0, 20.0, (60, 3))
STIFFNESS = (X[:, :2] / 20.0) ** 2
GAP = noise_modes(X, 0.6, 11.0, 0.95)
OWN = 0.2**2 * np.eye(len(X))
NUMBERS = NoiseModelOptions()


def covariance(factor: float) -> np.ndarray:
    return factor**2 * smooth_covariance(X, 0.5, 6.0) + OWN


@pytest.fixture(scope="module")
def grid() -> NoiseGrid:
    sizes = [replace(NoiseSizes.of(NUMBERS), contour=f) for f in FACTORS]
    even = np.full(len(FACTORS), -np.log(len(FACTORS)))
    return NoiseGrid(
        sizes,
        CovarianceFamily(np.stack([smooth_covariance(X, 0.5, 6.0), OWN]), np.array([[f**2, 1.0] for f in FACTORS])),
        even,
        NUMBERS,
    )


def fitted(grid: NoiseGrid, gap: float, true: float = 1.0) -> float:
    """Mean over 30 draws of the contours' factor that is found, the truth `true`, with a gap of so many times its usual size."""
    rng = np.random.default_rng(1)
    L = np.linalg.cholesky(covariance(true))
    found = []
    for _ in range(30):
        r = L @ rng.standard_normal(len(X)) + gap * GAP @ rng.standard_normal(GAP.shape[1])
        found.append(fit_noise(grid, r, STIFFNESS, GAP).sizes.contour)
    return float(np.mean(found))


def test_without_a_gap_the_noise_is_what_it_is(grid: NoiseGrid) -> None:
    found = fitted(grid, 0.0)
    assert found == pytest.approx(1.0, abs=0.1)
    there = replace(grid, options=replace(NUMBERS, gap_sizes=(1.0,)))
    assert fitted(there, 0.0) < found - 0.05  # a gap that must be there takes the noise's place


@pytest.mark.parametrize("true", [0.5, 1.0])
def test_a_gap_is_not_taken_for_noise(grid: NoiseGrid, true: float) -> None:
    assert fitted(grid, 2.0, true) == pytest.approx(true, abs=0.15)


def test_each_model_may_have_the_noise_that_suits_it(grid: NoiseGrid) -> None:
    """A model that leaves little is believed more than at the noise of one that leaves much."""
    rng = np.random.default_rng(4)
    little = np.linalg.cholesky(covariance(0.4)) @ rng.standard_normal((len(X), 1))
    much = np.linalg.cholesky(covariance(1.2)) @ rng.standard_normal((len(X), 1))
    none, loose, nothing = np.zeros((len(X), 1)), np.ones(1), [Directions.none(len(X))]
    wide = NoiseGrid(grid.sizes[-1:], grid.covariances.only(np.array([len(grid.sizes) - 1])), np.zeros(1), NUMBERS)
    free, held = (
        float((g.log_evidence(little, none, loose, nothing) - g.log_evidence(much, none, loose, nothing))[0, 0])
        for g in (grid, wide)
    )
    assert free > held + 3.0


def test_sizes_and_covariance_are_means_over_all_sizes_and_gaps_by_their_probability(grid: NoiseGrid) -> None:
    """Bayes' theorem, with the projected likelihood of a basis of what the stiffness does not change."""
    rng = np.random.default_rng(7)
    r = np.linalg.cholesky(covariance(0.8)) @ rng.standard_normal(len(X)) + 0.3 * GAP @ rng.standard_normal(
        GAP.shape[1]
    )
    prior = np.log([0.1, 0.3, 0.2, 0.3, 0.1])
    N = null_space(STIFFNESS.T)
    likelihood = np.zeros(len(FACTORS))
    for size in NUMBERS.gap_sizes:
        for k, factor in enumerate(FACTORS):
            C = covariance(factor) + size**2 * GAP @ GAP.T
            likelihood[k] += multivariate_normal(cov=N.T @ C @ N).pdf(N.T @ r)
    weight = likelihood * np.exp(prior)
    weight = weight / weight.sum()
    found = fit_noise(replace(grid, log_prior=prior), r, STIFFNESS, GAP)
    assert found.sizes.contour**2 == pytest.approx(weight @ np.square(FACTORS), rel=1e-4)
    mean = sum(w * covariance(f) for w, f in zip(weight, FACTORS, strict=True))
    np.testing.assert_allclose(found.covariance, mean, rtol=1e-4, atol=1e-6)
    assert weight.max() < 0.9  # several sizes count


def test_the_points_of_a_case_are_the_integral_over_its_prior() -> None:
    """A noise of one size, seen directly: the mean variance is that of a fine sum over the prior."""
    n, spread = 40, NUMBERS.contour_prior
    shape = np.eye(n)
    parts: Any = SimpleNamespace(
        options=replace(NUMBERS, points=64),
        variance_model=lambda start, left: VarianceModel(
            [NoisePart(1, 1.0, spread)], shape[None], 1e-9 * np.eye(n), 1.5
        ),
    )
    r = 1.3 * np.random.default_rng(2).standard_normal(n)
    no_columns = np.zeros((n, 0))
    fake = SimpleNamespace(of=lambda options: SimpleNamespace(with_varying=lambda row: row))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(noise_estimation, "NoiseSizes", fake)
        grid = NoiseGrid.of(parts, no_columns, r, no_columns, 0.5 * np.eye(n)[:, :3])
    assert len(grid.log_prior) == 128
    logs = grid.log_likelihood(r, no_columns, np.zeros((n, n))) + grid.log_prior
    weight = np.exp(logs - logs.max())
    found = (weight / weight.sum()) @ np.array([C[0, 0] for C in grid.covariances])
    z = np.linspace(-6.0, 6.0, 4001)
    variance = np.exp(2.0 * spread * z)
    exact = np.exp(-0.5 * z**2 - 0.5 * n * np.log(variance) - 0.5 * (r @ r) / variance)
    assert found == pytest.approx((exact / exact.sum()) @ variance, rel=0.02)


def test_what_was_measured_is_no_surprise_to_the_priors() -> None:
    """Voxels: 0.37 to 0.57 mm a mode; contours: half of what is stated to a fifth more, correlated over 5.0 to 7.8 mm."""
    for measured, median, spread in (
        ((0.37, 0.57), NUMBERS.own_mm, NUMBERS.contour_prior),
        ((0.5, 1.2), 1.0, NUMBERS.contour_prior),
    ):
        assert (np.abs(np.log(measured) - np.log(median)) < 2.0 * spread).all()
    assert min(NUMBERS.lengths_mm) <= 5.0 and max(NUMBERS.lengths_mm) >= 7.8
