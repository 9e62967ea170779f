"""The formulas of docs/method.md, written out densely as the page has them, are what the code computes."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.arrays import FloatArray
from palpate.core.inference.evidence import score
from palpate.core.inference.gauss_newton import gauss_newton
from palpate.core.inference.heldout import Linear, Split
from palpate.core.inference.posterior import NoiseFacts, laplace
from palpate.core.inference.swarm import sphere_centre
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, MOONEY_RIVLIN_PRINTED, bulk_modulus, mooney_rivlin_parameters
from palpate.core.residual.covariance_family import CovarianceFamily
from palpate.core.residual.noise_estimation import NoiseGrid
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.validate.paper.contour_weights import contour_covariance, weighting_covariance

N, T, K = 30, 2, 3  # data, stiffnesses, parameters of an effect
_rng = np.random.default_rng(33)
_root = _rng.normal(size=(N, N))
SIGMA = _root @ _root.T + np.eye(N)
WEIGHT = np.linalg.inv(SIGMA)
R, J, S = _rng.normal(size=N), _rng.normal(size=(N, T)), _rng.normal(size=(N, K))
SCALES = np.array([0.5, 1.0, 2.0])
M = WEIGHT - WEIGHT @ J @ np.linalg.inv(J.T @ WEIGHT @ J) @ J.T @ WEIGHT


def white(x: FloatArray) -> FloatArray:
    """L^-1 x with Sigma = L L'."""
    return np.linalg.solve(np.linalg.cholesky(SIGMA), x)


def log_det(x: FloatArray) -> float:
    """ln |x|."""
    return float(np.linalg.slogdet(x)[1])


@pytest.fixture
def F() -> FloatArray:
    """A deformation gradient with a positive determinant."""
    return np.eye(3) + 0.2 * np.random.default_rng(0).normal(size=(3, 3))


def test_energy_of_the_organ_is_that_of_eq_8(F: FloatArray) -> None:
    K_kpa = bulk_modulus(20.0, 0.495)
    mu1, mu2, v1 = p = mooney_rivlin_parameters(20.0, K_kpa, 0.3)
    C, jacobian = F.T @ F, np.linalg.det(F)
    trace, trace_of_square, third = np.trace(C), np.trace(C @ C), jacobian**2
    I2 = 0.5 * (trace**2 - trace_of_square)
    ours = mu1 * (jacobian ** (-4 / 3) * I2 - 3) + mu2 * (jacobian ** (-2 / 3) * trace - 3) + v1 * (jacobian - 1) ** 2
    printed = 0.5 * mu1 * ((trace**2 - trace_of_square) / third ** (2 / 3) - 6)
    printed += mu2 * (trace / third ** (1 / 3) - 3) + v1 * (third ** (1 / 3) - 1) ** 2
    assert 2 * (mu1 + mu2) == pytest.approx(20.0) and 2 * v1 == pytest.approx(2 * 20.0 * 1.495 / (3 * 0.01))
    assert MOONEY_RIVLIN.energy(F[None], p)[0] == pytest.approx(ours, rel=1e-12)
    assert MOONEY_RIVLIN_PRINTED.energy(F[None], p)[0] == pytest.approx(printed, rel=1e-12)


def test_energy_of_the_tissue_is_that_of_eq_3(F: FloatArray) -> None:
    strain = 0.5 * (F + F.T) - np.eye(3)
    deviator = strain - np.trace(strain) / 3 * np.eye(3)
    written = 20.0 * (deviator**2).sum() + 0.5 * 7.0 * np.trace(strain) ** 2
    assert LINEAR.energy(F[None], np.array([20.0, 7.0]))[0] == pytest.approx(written, rel=1e-12)


def test_contours_err_and_weigh_as_written() -> None:
    points = np.random.default_rng(1).uniform(0.0, 30.0, (12, 3))
    rho = np.linalg.norm(points[:, None] - points, axis=2)
    a = np.sqrt(3.0) * rho / 3.0
    noise = 2 * 0.4**2 * np.exp(-(rho**2) / (2 * 7.0**2)) + 0.2**2 * (1 + a) * np.exp(-a)
    weights = 2 * 0.4**2 * np.exp(-rho / (0.7 * 7.0)) + 0.15**2 * np.eye(12)
    assert np.abs(contour_covariance(points, 0.4, 7.0) - noise).max() < 1e-12
    assert np.abs(weighting_covariance(points, 0.4, 7.0) - weights).max() < 1e-12


def test_a_linear_problem_is_solved_to_the_least_squares_answer() -> None:
    r, jacobian = white(R), white(J)
    found = gauss_newton(lambda x: (r + jacobian @ x, jacobian), np.zeros(T), np.array([[-9.0, 9.0]] * T), 1e-9)
    assert found is not None
    assert np.abs(found.theta + np.linalg.solve(J.T @ WEIGHT @ J, J.T @ WEIGHT @ R)).max() < 1e-6


def test_the_swarms_sphere_is_that_of_eq_17() -> None:
    x, own, heard = np.random.default_rng(2).random((3, 1, T))
    c = 0.5 + np.log(2.0)
    written = (3 * x + c * (own - x) + c * (heard - x)) / 3
    assert np.abs(sphere_centre(x, own, heard, np.array([False])) - written).max() < 1e-15
    assert np.abs(sphere_centre(x, own, own, np.array([True])) - (2 * x + c * (own - x)) / 2).max() < 1e-15


def test_posterior_is_laplaces_widened_where_the_misfit_is_too_large() -> None:
    bounds = np.array([[0.0, 4.0], [1.0, 5.0]])
    prior = np.diag(12.0 / (bounds[:, 1] - bounds[:, 0]) ** 2)
    for r in (0.1 * R, 20.0 * R):
        s = max(1.0, r @ WEIGHT @ r / (N - T))
        written = np.linalg.inv(J.T @ WEIGHT @ J / s + prior)
        assert np.abs(laplace(np.ones(T), white(r), white(J), bounds).covariance - written).max() < 1e-9


def test_posterior_of_the_studies_has_the_sandwich_covariance() -> None:
    noise = np.diag(np.random.default_rng(3).uniform(1.0, 2.0, N))
    bounds = np.array([[0.0, 4.0], [1.0, 5.0]])
    H, spread, expected = J.T @ WEIGHT @ J, J.T @ WEIGHT @ noise @ WEIGHT @ J, float(np.trace(WEIGHT @ noise))
    for r in (R, 20.0 * R):  # a misfit below what noise explains, and one above
        s = max(1.0, r @ WEIGHT @ r / expected)
        prior = np.diag(12.0 / (bounds[:, 1] - bounds[:, 0]) ** 2)
        written = np.linalg.inv(H @ np.linalg.inv(spread) @ H / s + prior)
        found = laplace(np.ones(T), white(r), white(J), bounds, NoiseFacts(spread, expected))
        assert np.abs(found.covariance - written).max() < 1e-9


def test_score_test_and_evidence_of_an_effect() -> None:
    A, b = S.T @ M @ S, S.T @ M @ R
    C = np.linalg.inv(A + np.diag(SCALES**-2))
    found = score(white(R), white(J), white(S), SCALES)
    assert found.statistic == pytest.approx(b @ np.linalg.solve(A, b), rel=1e-9)
    written = 0.5 * b @ C @ b - 0.5 * log_det(np.eye(K) + A @ np.diag(SCALES**2))
    assert found.log_evidence == pytest.approx(written, rel=1e-9)


def test_restricted_likelihood_of_the_noise() -> None:
    grid = NoiseGrid((), CovarianceFamily.one(SIGMA), np.zeros(1), NoiseModelOptions())
    written = -0.5 * R @ M @ R - 0.5 * log_det(SIGMA) - 0.5 * log_det(J.T @ WEIGHT @ J)
    # The code adds 1e-3 to the stiffness' precision, so that a pair that tells nothing divides by nothing.
    assert grid.log_likelihood(R, J, np.zeros((N, N)))[0] == pytest.approx(written, abs=2e-3)


def test_prediction_of_a_patch_from_the_others() -> None:
    patch = np.repeat(np.arange(3), N // 3)
    both, x = np.hstack([J, S]), np.random.default_rng(4).normal(size=T + K)
    prior = np.concatenate([np.full(T, 1e-4), SCALES**-2])
    split = Split(np.eye(N), patch, SIGMA, {"surface": slice(0, N)})
    found = split.left_out([Linear(R, both, x, prior)])[0]
    for p in range(3):
        h, rest = patch == p, patch != p
        weight = np.linalg.inv(SIGMA[np.ix_(rest, rest)])
        H = both[rest].T @ weight @ both[rest] + np.diag(prior)
        written = R[h] - both[h] @ np.linalg.solve(H, both[rest].T @ weight @ R[rest] + prior * x)
        assert np.abs(found[h] - written).max() < 1e-9
