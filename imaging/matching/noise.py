"""Noise of CT as it is left in a difference of two matched scans: size from place to place, and correlation of neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, Float32Array, FloatArray

# Lags, in voxels along each axis, at which the correlation of neighbours is measured; beyond them it is taken as none.
LAGS = 4
# What is less than this standard deviation of a filter across, in voxels, is fine detail, in which noise shows most. Numerical: no scan
# has less than this share of the noise of both.
FINE_VOXELS, LEAST_SHARE = 1.0, 0.1


@dataclass(frozen=True, eq=False)
class CorrelatedNoise:
    """Correlation of noise as the product of one function of the lag along each axis.

    kernels : one array (2 LAGS + 1,) an axis, 1 in the middle, symmetric: the correlation at lags -LAGS to LAGS.
    """

    kernels: tuple[FloatArray, ...]

    def applied(self, field: Float32Array) -> Float32Array:
        """The field (ni, nj, nk) multiplied by the correlation matrix of its voxels."""
        result = field
        for axis, kernel in enumerate(self.kernels):
            result = ndimage.correlate1d(result, kernel.astype(np.float32), axis=axis, mode="nearest")
        return result

    def in_windows(self, sigma_mm: float, spacing: FloatArray) -> CorrelatedNoise:
        """The correlation times what the weights of two voxels of a Gaussian window have less than the square of that between
        them: exp(-d^2 / (4 sigma^2)) for a distance d."""
        lags = [np.arange(len(k)) - len(k) // 2 for k in self.kernels]
        return CorrelatedNoise(
            tuple(
                k * np.exp(-0.25 * (lag * h / sigma_mm) ** 2)
                for k, lag, h in zip(self.kernels, lags, spacing, strict=True)
            )
        )

    @property
    def together(self) -> float:
        """Voxels that one independent value of the noise stands for."""
        return float(np.prod([kernel.sum() for kernel in self.kernels]))


def measured_correlation(difference: Float32Array, usable: BoolArray, lags: int = LAGS) -> CorrelatedNoise:
    """The correlation of neighbouring values of a difference of two scans (ni, nj, nk), where both voxels are usable.

    Slow changes are taken off first: they are contrast and brightness, not noise.
    """
    weight = usable.astype(np.float32)
    mean = _mean(difference, weight, (6.0,) * 3)
    rough = np.where(usable, difference - mean, 0.0).astype(np.float64)
    kernels = []
    for axis in range(3):
        values = [_at_lag(rough, usable, axis, lag) for lag in range(min(lags, difference.shape[axis] - 1) + 1)]
        positive = _until_none(np.array(values) / max(values[0], 1e-12))
        positive[0] = 1.0  # also where the scans have no noise at all
        kernels.append(np.concatenate([positive[:0:-1], positive]))
    return CorrelatedNoise(tuple(kernels))


def noise_shares(first: Float32Array, second: Float32Array, weight: Float32Array) -> tuple[float, float]:
    """Shares of two aligned scans (ni, nj, nk) HU in the variance of their difference's noise, where voxels have a weight.

    Both show the same picture; what each has in fine detail beyond what both have is its noise. The scans' mean with the other's
    share as weight is the surest one, and its noise goes with no difference of them.
    """
    fine = [scan - ndimage.gaussian_filter(scan, FINE_VOXELS, mode="nearest") for scan in (first, second)]
    own, other, both = (float((weight * fine[a] * fine[b]).sum(dtype=np.float64)) for a, b in ((0, 0), (1, 1), (0, 1)))
    ours, theirs = (max(size - both, 0.0) for size in (own, other))
    share = ours / (ours + theirs) if ours + theirs > 0.0 else 0.5
    share = min(max(share, LEAST_SHARE), 1.0 - LEAST_SHARE)
    return share, 1.0 - share


def _at_lag(rough: FloatArray, usable: BoolArray, axis: int, lag: int) -> float:
    n = rough.shape[axis]
    first = rough.take(range(n - lag), axis=axis)
    second = rough.take(range(lag, n), axis=axis)
    both = usable.take(range(n - lag), axis=axis) & usable.take(range(lag, n), axis=axis)
    return float((first * second)[both].mean()) if both.any() else 0.0


def _until_none(correlation: FloatArray) -> FloatArray:
    """The correlation up to the first lag at which there is none: what comes after is chance."""
    gone = np.flatnonzero(correlation < 0.05)
    cut = correlation.copy()
    if len(gone):
        cut[gone[0] :] = 0.0
    return cut


def _mean(values: Float32Array, weight: Float32Array, sigma: Sequence[float]) -> Float32Array:
    total = ndimage.gaussian_filter(values * weight, sigma, mode="nearest")
    return np.asarray(total / np.maximum(ndimage.gaussian_filter(weight, sigma, mode="nearest"), 1e-6))
