"""What a model errs by in truth, told from residuals that hold the drawing's noise as well."""

from __future__ import annotations

import numpy as np
import pytest
from organ_case import organ_case

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.leave_out import data_split
from palpate.core.diagnose.verdict import true_error as module
from palpate.core.diagnose.verdict.shrinkage import _shares
from palpate.core.diagnose.verdict.true_error import NoiseOfPoints, TrueError, error_given

POINTS, CASES, DRAWS = 40, 400, 400


def smooth(sd_mm: float, length: float) -> FloatArray:
    at = np.arange(POINTS, dtype=float)
    return np.asarray(sd_mm**2 * np.exp(-0.5 * ((at[:, None] - at) / length) ** 2) + 1e-4 * np.eye(POINTS))


def told(error: FloatArray, noise: FloatArray, seen: FloatArray) -> TrueError:
    return TrueError(
        np.ones(1), [error_given(error, noise, seen)], np.eye(POINTS), np.array([np.trace(noise) / POINTS])
    )


def test_one_point_is_the_closed_form() -> None:
    """Variances 0.09 and 0.16, seen 1.0: mean 0.36, variance 0.09 * 0.16 / 0.25."""
    mean, factor = error_given(np.array([[0.09]]), np.array([[0.16]]), np.array([1.0]))
    assert mean[0] == pytest.approx(0.36)
    assert factor[0, 0] ** 2 == pytest.approx(0.0576)


def test_a_drawing_without_noise_shows_the_error_itself() -> None:
    seen = np.sin(np.arange(POINTS) / 5.0)
    left = told(smooth(0.5, 4.0), 1e-10 * np.eye(POINTS), seen).draws(20, np.random.default_rng(0))
    np.testing.assert_allclose(left, np.tile(seen, (20, 1)), atol=1e-3)


def test_a_drawing_that_shows_nothing_leaves_what_the_model_may_err_by() -> None:
    """Nothing is subtracted to zero: the error is what the noise model says of it."""
    error = smooth(0.3, 4.0)
    left = told(error, 1e6 * np.eye(POINTS), np.zeros(POINTS)).draws(4000, np.random.default_rng(0))
    assert np.square(left).mean() == pytest.approx(np.trace(error) / POINTS, rel=0.05)


def test_the_share_that_is_gone_is_held_as_often_as_stated() -> None:
    """Errors and drawings drawn from their covariances: 95 % intervals hold the true share, of an effect that moves the surface."""
    rng = np.random.default_rng(3)
    error, noise = smooth(0.3, 6.0), smooth(0.45, 4.0)
    moved = 0.8 * np.cos(np.arange(POINTS) / 7.0)
    inside = []
    for _ in range(CASES):
        left = np.linalg.cholesky(error) @ rng.standard_normal(POINTS)
        seen = left + np.linalg.cholesky(noise) @ rng.standard_normal(POINTS)
        true = 1.0 - np.linalg.norm(left) / np.linalg.norm(left + moved)
        low, high = np.quantile(_shares(told(error, noise, seen), moved, DRAWS, rng), [0.025, 0.975])
        inside.append(low <= true <= high)
    assert 0.92 <= np.mean(inside) <= 0.98


def test_draws_take_every_part_as_often_as_it_is_probable() -> None:
    """Two sizes of the noise: the error near 0 with a quarter of the probability, near 2 with the rest."""
    parts = [(np.full(POINTS, at), np.zeros((POINTS, POINTS))) for at in (0.0, 2.0)]
    left = TrueError(np.array([0.25, 0.75]), parts, np.eye(POINTS), np.array([1.0, 3.0]))
    assert left.draws(4000, np.random.default_rng(1))[:, 0].mean() == pytest.approx(1.5, abs=0.06)
    assert left.floor_mm2 == pytest.approx(2.5)


def test_the_points_of_the_organ_are_read_in_a_basis_of_all_that_the_data_can_be_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fit = organ_case()
    split, data = data_split(fit, DecisionRules()), fit.model.data_vectors[0]
    rng = np.random.default_rng(8)
    half, free = rng.standard_normal((data.n, data.n)), rng.standard_normal((data.n, 3))

    def drawn(each: object, vectors: object, options: object, shapes: object) -> object:
        assert (each, vectors) == (fit.linearisation.each, fit.model.data_vectors)
        assert (options, shapes) == (fit.options, fit.shapes)
        return lambda sizes: sizes.contour * half @ half.T

    monkeypatch.setattr(module, "organ_noise", drawn)
    found = NoiseOfPoints.of(fit, split, free)
    read = split.reader[split.organ]
    np.testing.assert_allclose(found.basis.T @ found.basis, np.eye(found.basis.shape[1]), atol=1e-9)
    np.testing.assert_allclose(found.basis @ found.reader, read, atol=1e-9)
    assert found.free is free and found.noise is fit.noise and found.fit is fit
    matched = np.zeros((data.n, data.n))
    matched[data.motion, data.motion] = np.eye(data.n_motion)
    np.testing.assert_allclose(found.of_organ(fit.sizes), half @ half.T + matched)
    np.testing.assert_allclose(found.drawing(0), found.reader @ (half @ half.T + matched) @ found.reader.T)
