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


def mixed(unit: float = 1.0) -> tuple[Split, np.ndarray, np.random.Generator]:
    """Two kinds of rows in four patches, the second one's in another unit, and three rows that are never left out."""
    rng = np.random.default_rng(9)
    half = rng.standard_normal((43, 43))
    C = half @ half.T / 43.0 + np.eye(43)
    size = np.repeat([1.0, unit, 1.0], [20, 20, 3])
    patch = np.concatenate([np.tile(np.repeat(np.arange(4), 5), 2), [-1] * 3])
    found = Split(np.eye(43), patch, C * np.outer(size, size), {"surface": slice(0, 20), "tissue": slice(20, 40)})
    return found, size[:, None] * rng.standard_normal((43, 2)), rng


def test_a_mean_over_a_patch_is_of_its_own_rows() -> None:
    s, _, rng = mixed()
    squares = rng.uniform(0.0, 2.0, (43, 2))
    by_hand = [squares[[*range(5 * p, 5 * p + 5), *range(20 + 5 * p, 25 + 5 * p)]].mean(axis=0) for p in range(4)]
    np.testing.assert_allclose(s.patch_means(squares), by_hand)
    before, after = np.arange(43.0), 0.5 * np.arange(43.0)[::-1]
    found = gain(s, before, after)
    a, b = s.patch_means(before**2), s.patch_means(after**2)
    assert found.mean_mm2 == pytest.approx(np.mean(a - b)) and found.share == pytest.approx(np.mean(a - b) / np.mean(a))
    small = gain(s, 1e-3 * before, 1e-3 * after)
    assert small.share == pytest.approx(found.share)
    assert (found.before_mm, found.after_mm) == pytest.approx(
        (np.sqrt(np.mean(before[:20] ** 2)), np.sqrt(np.mean(after[:20] ** 2)))
    )


def test_what_a_model_misses_counts_by_its_own_standard_deviation_whatever_its_unit() -> None:
    """In micrometres or metres the p-value is the same, and a miss among small numbers is not lost beside large ones."""
    found = []
    for unit in (1.0, 1e3, 1e-3):
        s, J, _ = mixed(unit)
        r = np.random.default_rng(3).standard_normal(43) * np.sqrt(np.diag(s.covariance))
        found.append(predictive_p(s, model(r, J), 400))
        r[20:40] *= 4.0
        assert predictive_p(s, model(r, J), 400) < 0.02
    assert found[0] == found[1] == found[2] and found[0] > 0.05
    s, J, _ = mixed()
    kept = np.zeros(43)
    kept[40:] = 5.0  # what is never left out is never missed
    assert predictive_p(s, model(kept, np.zeros((43, 2))), 400) > 0.9
