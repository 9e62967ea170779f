"""Prediction of patches left out: what is predicted, what a gain is worth, and how sure it is."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.inference.heldout import Gain, Linear, Split, gain, gain_error

N, PATCHES = 120, 12
RULES = DecisionRules()


def split(correlation: float = 3.0) -> Split:
    """Rows along a line, in patches of ten."""
    at = np.arange(N, dtype=float)
    covariance = 0.09 * np.exp(-0.5 * ((at[:, None] - at) / correlation) ** 2) + 0.01 * np.eye(N)
    points = np.column_stack([at, np.zeros((N, 2))])
    return Split(np.eye(N), np.zeros(N), np.repeat(np.arange(PATCHES), N // PATCHES), covariance, points)


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


def test_the_error_of_a_gain_is_how_much_it_varies_with_the_noise() -> None:
    """The model predicts the truth and has nothing to fit: d = off^2 + 2 off e, whose variance is known."""
    s, off = split(), np.linspace(0.0, 1.0, N)
    nothing = np.zeros((N, 1))
    error = gain_error(s, model(off, nothing), model(np.zeros(N), nothing), 200)
    assert error == pytest.approx(2.0 * np.sqrt(off @ s.covariance @ off) / N, rel=0.12)


def test_what_acts_in_one_place_is_confirmed_though_it_gains_nowhere_else() -> None:
    """Its gain differs from patch to patch by much more than by noise."""
    s, rng = split(), np.random.default_rng(3)
    there = 2.0 * np.exp(-0.5 * ((np.arange(N) - 34.5) / 6.0) ** 2)
    noise = np.linalg.cholesky(s.covariance) @ rng.standard_normal(N)
    nothing = np.zeros((N, 1))
    plain, known = model(there + noise, nothing), model(noise, np.column_stack([nothing, there]), 1.0)
    before, after = s.left_out([plain, known])
    found = gain(s, before, after, gain_error(s, plain, known, 200))
    d = s.patch_means(before**2 - after**2)
    assert d.mean() < 2.0 * d.std(ddof=1) / np.sqrt(PATCHES)
    assert found.mean_mm2 == pytest.approx(d.mean())
    assert RULES.accepts(found)


def test_the_spread_between_patches_is_no_error_of_a_gain() -> None:
    """Where all patches happen to gain alike, their spread is nearly 0: the smaller of two errors would confirm anything."""
    s = split()
    before, after = np.full(N, 1.0), np.full(N, 0.9)
    assert gain(s, before, after, 0.3).error_mm2 == 0.3
    assert not RULES.accepts(gain(s, before, after))  # without an error nothing is accepted


def test_noise_is_not_confirmed() -> None:
    """A smooth shape that is fitted to nothing but noise predicts none of it."""
    s, accepted = split(), 0
    shape = np.sin(np.arange(N) / 15.0)[:, None]
    J = np.column_stack([np.zeros(N), shape])
    for seed in range(40):
        noise = np.linalg.cholesky(s.covariance) @ np.random.default_rng(seed).standard_normal(N)
        W = np.linalg.inv(s.covariance)
        phi = float((shape.T @ W @ noise)[0] / (shape.T @ W @ shape + 1.0)[0, 0])
        plain, fitted = model(noise, J[:, :1]), model(noise - phi * shape[:, 0], J, -phi)
        before, after = s.left_out([plain, fitted])
        accepted += RULES.accepts(gain(s, before, after, gain_error(s, plain, fitted, 200)))
    assert accepted <= 4


def test_gains_on_two_sets_of_patches_add_up() -> None:
    a, b = Gain(1.0, 0.8, 0.3, 0.1, 0.3, 20), Gain(2.0, 0.5, 1.5, 0.2, 0.75, 10)
    both = a + b
    assert (both.before_mm, both.after_mm, both.patches) == (1.0, 0.8, 30)
    assert both.total_mm2 == pytest.approx(a.total_mm2 + b.total_mm2)
    assert both.error_mm2 == pytest.approx(np.hypot(20 * 0.1, 10 * 0.2) / 30)
    assert both.share == pytest.approx(21.0 / (20 * 1.0 + 10 * 2.0))
