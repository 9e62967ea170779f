"""Prediction of patches left out: what is predicted, what is gained, and whether a model misses more than it says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from palpate.core.inference.heldout import Linear, Split, gain, predictive_p

N, PATCHES = 120, 12


def split(correlation: float = 3.0) -> Split:
    """Rows along a line, in patches of ten."""
    at = np.arange(N, dtype=float)
    covariance = 0.09 * np.exp(-0.5 * ((at[:, None] - at) / correlation) ** 2) + 0.01 * np.eye(N)
    return Split(np.eye(N), np.repeat(np.arange(PATCHES), N // PATCHES), covariance, {"surface": slice(0, N)})


def model(r: np.ndarray, J: np.ndarray, phi: float = 0.0) -> Linear:
    """J[:, 0] the stiffness, whose prior is flat, the others of unit prior."""
    k = J.shape[1]
    return Linear(r, J, np.concatenate([[0.0], np.full(k - 1, phi)]), np.concatenate([[1e-6], np.ones(k - 1)]))


def test_a_row_is_predicted_from_other_patches_by_generalised_least_squares() -> None:
    """Against the textbook's formula, patch by patch."""
    s, rng = split(), np.random.default_rng(1)
    J, r = rng.standard_normal((N, 3)), rng.standard_normal(N)
    m = model(r, J, 0.4)
    found = s.left_out([m])[0]
    for p in range(PATCHES):
        out, train = s.patch == p, s.patch != p
        W = np.linalg.inv(s.covariance[np.ix_(train, train)])
        H = J[train].T @ W @ J[train] + np.diag(m.precision)
        step = np.linalg.solve(H, J[train].T @ W @ r[train] + m.precision * m.value)
        np.testing.assert_allclose(found[out], r[out] - J[out] @ step, atol=1e-9)


def test_a_gain_is_the_mean_over_patches_of_what_the_squares_lose() -> None:
    s = split()
    before, after = np.repeat([2.0, 1.0], N // 2), np.ones(N)
    found = gain(s, before, after)
    assert (found.mean_mm2, found.patches) == (pytest.approx(1.5), PATCHES)
    assert found.share == pytest.approx(1.5 / 2.5)
    assert (found.before_mm, found.after_mm) == (pytest.approx(np.sqrt(2.5)), 1.0)


def test_the_predictive_p_value_of_a_true_model_is_uniform() -> None:
    """150 draws of the model itself, whose two parameters are fitted anew from each patch's neighbours."""
    s, rng = split(), np.random.default_rng(6)
    J, L = rng.standard_normal((N, 2)), np.linalg.cholesky(s.covariance)
    p = [predictive_p(s, model(L @ rng.standard_normal(N), J), 60, seed) for seed in range(150)]
    assert stats.kstest(p, "uniform").pvalue > 0.05


def test_a_model_that_lacks_something_does_not_predict_what_was_left_out() -> None:
    """Smooth over several patches and of the noise's own size: what is near does not foretell it."""
    s, rng = split(), np.random.default_rng(7)
    J = np.column_stack([np.ones(N), np.linspace(-1.0, 1.0, N)])
    noise = np.linalg.cholesky(s.covariance) @ rng.standard_normal(N)
    lacking = 0.9 * np.sin(np.arange(N) / 6.0)
    assert predictive_p(s, model(noise, J), 200) > 0.05
    assert predictive_p(s, model(noise + lacking, J), 200) < 0.01
