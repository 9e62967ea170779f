"""Covariances kept as sums of a few matrices are those that the parts add up to."""

from __future__ import annotations

import numpy as np

from palpate.core.residual.covariance_family import CovarianceFamily


def family() -> CovarianceFamily:
    rng = np.random.default_rng(4)
    root = rng.normal(size=(3, 5, 5))
    return CovarianceFamily(root @ root.transpose(0, 2, 1), rng.uniform(0.1, 2.0, size=(7, 3)))


def test_members_are_the_sums_that_the_coefficients_say() -> None:
    several = family()
    assert len(several) == len(list(several)) == 7
    for k, member in enumerate(several):
        expected = sum(c * M for c, M in zip(several.coefficients[k], several.matrices, strict=True))
        np.testing.assert_allclose(member, expected, rtol=1e-13)
        np.testing.assert_array_equal(member, several[k])
    np.testing.assert_array_equal(several.only(np.array([5, 2]))[1], several[2])


def test_a_mean_is_the_weighed_sum_of_the_members() -> None:
    several, weights = family(), np.linspace(0.0, 0.4, 7)
    expected = sum(w * C for w, C in zip(weights, several, strict=True))
    np.testing.assert_allclose(several.mean(weights), expected, rtol=1e-12)
    np.testing.assert_array_equal(CovarianceFamily.one(several[0])[0], several[0])
