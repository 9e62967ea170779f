"""Noise of contours: correlated along the surface, so that neighbouring points are not independent observations."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve, lapack, solve_triangular
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray

# Error of voxels, surface extraction and mesh, mm rms of the residual, and how far along the surface it is correlated
# (measured on cases without a hidden effect and without contour noise: 0.16 to 0.20 mm).
EXTRACTION_MM, EXTRACTION_LENGTH_MM = 0.20, 3.0

# Numerical: variance, over the largest, that the low-rank factor of a smooth covariance leaves out at any point.
_LEFT_OUT = 1e-9


def smooth_covariance(points: FloatArray, sd_mm: float, correlation_mm: float) -> FloatArray:
    """Covariance (q, q) mm2 of one contour's smooth error at points (q, 3) mm; squared-exponential kernel."""
    return covariance_between(points, points, sd_mm, correlation_mm)


def covariance_between(a: FloatArray, b: FloatArray, sd_mm: float, correlation_mm: float) -> FloatArray:
    """Covariance (p, q) mm2 of one contour's smooth error between points a (p, 3) and b (q, 3) mm."""
    return np.asarray(sd_mm**2 * np.exp(-0.5 * (cdist(a, b) / correlation_mm) ** 2))


def matern_3_2(distance: FloatArray, length: float) -> FloatArray:
    """Matern kernel of smoothness 3/2 at distances (any shape), 1 at distance 0; length in the unit of the distances."""
    a = np.sqrt(3.0) * distance / length
    return np.asarray((1.0 + a) * np.exp(-a), dtype=np.float64)


def noise_modes(points: FloatArray, sd_mm: float, correlation_mm: float, share: float = 0.99) -> FloatArray:
    """Leading eigenvectors (q, m) mm of `smooth_covariance`, scaled by their standard deviations; they hold `share` of
    its trace."""
    values, vectors = leading_eigenpairs(smooth_covariance(points, sd_mm, correlation_mm))
    kept = int(np.searchsorted(np.cumsum(values), share * values.sum())) + 1
    return vectors[:, :kept] * np.sqrt(values[:kept])


def leading_eigenpairs(covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues (m,), the largest first, and orthonormal eigenvectors (q, m) of a smooth covariance (q, q), m <= q.

    They are those of its Cholesky factor with pivots (LAPACK's dpstrf), which ends where almost nothing is left (`_LEFT_OUT`):
    a smooth covariance has far fewer columns than points. Values are right to `_LEFT_OUT` q; those near that are not to be
    used.
    """
    tolerance = _LEFT_OUT * float(covariance.diagonal().max())
    factor, pivots, rank, _ = lapack.dpstrf(covariance, tol=tolerance, lower=1)
    columns = np.empty((len(covariance), rank))
    columns[pivots - 1] = np.tril(factor)[:, :rank]
    values, vectors = np.linalg.eigh(columns.T @ columns)
    values, vectors = np.maximum(values[::-1], 0.0), vectors[:, ::-1]
    return values, (columns @ vectors) / np.sqrt(np.maximum(values, 1e-300))


class Weighting:
    """Inverse of a residual's covariance Sigma, by its Cholesky factor L.

    covariance : (q, q) mm2. Raises numpy.linalg.LinAlgError when it is not positive definite.
    """

    def __init__(self, covariance: FloatArray) -> None:
        self.covariance = covariance
        self._factor = cho_factor(covariance, lower=True)

    def apply(self, x: FloatArray) -> FloatArray:
        """Sigma^-1 x for x (q,) or (q, k)."""
        return cho_solve(self._factor, x)

    def squared(self, r: FloatArray) -> float:
        """r' Sigma^-1 r."""
        return float(r @ self.apply(r))

    def whiten(self, x: FloatArray) -> FloatArray:
        """L^-1 x for x (q,) or (q, k), so that |whiten(r)|^2 = squared(r)."""
        return np.asarray(solve_triangular(self._factor[0], x, lower=True), dtype=np.float64)

    def unwhiten_adjoint(self, x: FloatArray) -> FloatArray:
        """L^-T x, so that whiten(r)' y = r' unwhiten_adjoint(y)."""
        return np.asarray(solve_triangular(self._factor[0], x, lower=True, trans="T"), dtype=np.float64)
