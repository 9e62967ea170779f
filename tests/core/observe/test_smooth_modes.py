"""Eigenpairs of a smooth covariance from its low-rank factor."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.observe.contour_noise import leading_eigenpairs, noise_modes, smooth_covariance


@pytest.mark.parametrize("length", [2.0, 7.0, 30.0])
def test_leading_eigenpairs_are_those_of_the_whole_matrix(length: float) -> None:
    """Points on a ball of 20 mm; LAPACK's own pairs of the same matrix."""
    points = np.random.default_rng(3).standard_normal((400, 3))
    points *= 20.0 / np.linalg.norm(points, axis=1, keepdims=True)
    K = smooth_covariance(points, 0.4, length)
    values, vectors = leading_eigenpairs(K)
    expected = np.linalg.eigvalsh(K)[::-1]
    kept = expected > 1e-3 * expected[0]
    np.testing.assert_allclose(values[: kept.sum()], expected[kept], rtol=1e-6)
    U = vectors[:, : kept.sum()]
    np.testing.assert_allclose(U.T @ U, np.eye(kept.sum()), atol=1e-9)
    np.testing.assert_allclose(K @ U, U * expected[kept], atol=1e-7)


def test_noise_modes_hold_the_share_they_are_asked_for() -> None:
    points = np.random.default_rng(4).uniform(0.0, 40.0, (200, 3))
    modes = noise_modes(points, 0.5, 10.0, 0.9)
    variance = (modes**2).sum()
    assert 0.9 * 200 * 0.25 <= variance <= 200 * 0.25
    assert variance - (modes[:, -1] ** 2).sum() < 0.9 * 200 * 0.25, "one mode less would hold too little"
