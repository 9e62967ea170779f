"""Noise of contours along a surface: correlated, so that neighbouring points are not independent looks.

A person's contour errs smoothly: covariance sd^2 exp(-r^2 / (2 l^2)) between points r apart. Voxels, surface extraction and
interpolation add a part of their own to every point, NUGGET_MM. Both scans have a contour, so the variance counts twice.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

FloatArray = NDArray[np.float64]

# Independent error per point, mm: rms of the extracted surface against the true one on voxelised shapes, and of the
# element's interpolation (measured on cases without a hidden effect).
NUGGET_MM = 0.20


def smooth_covariance(points: FloatArray, sd_mm: float, correlation_mm: float) -> FloatArray:
    """(q, q) mm2, one contour's correlated part at points (q, 3) mm."""
    return sd_mm**2 * np.exp(-0.5 * (cdist(points, points) / correlation_mm) ** 2)


def noise_modes(points: FloatArray, sd_mm: float, correlation_mm: float, share: float = 0.99) -> FloatArray:
    """(q, m) mm: columns whose outer products add up to `share` of the trace of `smooth_covariance`."""
    values, vectors = np.linalg.eigh(smooth_covariance(points, sd_mm, correlation_mm))
    order = np.argsort(values)[::-1]
    values, vectors = np.maximum(values[order], 0.0), vectors[:, order]
    kept = int(np.searchsorted(np.cumsum(values), share * values.sum())) + 1
    return vectors[:, :kept] * np.sqrt(values[:kept])


class Weighting:
    """Inverse of a residual's covariance, by its Cholesky factor.

    covariance : (q, q) mm2, positive definite. Raises numpy.linalg.LinAlgError otherwise.
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
        """L^-1 x with Sigma = L L', so that |whiten(r)|^2 = squared(r)."""
        from scipy.linalg import solve_triangular

        return solve_triangular(self._factor[0], x, lower=True)
