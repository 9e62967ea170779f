"""Precision of a window's shift: what the noise that is left does to it, and motion that is not constant in the window.

The covariance of a shift is A^-1 M A^-1, with A the window's sum of g g^T and M the covariance of its score under noise
whose size and correlation are measured from the difference that is left. A counts the gradient g of the picture alone:
what noise adds to it is taken off.
"""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.matching.noise import CorrelatedNoise, measured_correlation
from palpate.imaging.matching.scan_pair import ScanPair
from palpate.imaging.matching.window_fits import NormalEquations
from palpate.imaging.matching.window_sums import pairs, symmetric

# Standard deviations by which a window's texture must exceed what noise leaves by chance.
CHANCE = 3.0


def variance_left(pair: ScanPair, at: NormalEquations) -> FloatArray:
    """Variance (mi, mj, mk) HU2 of the difference that is left in every window."""
    share = np.maximum(pair.windows.sum(at.weight), 1e-6)
    mean = pair.windows.sum(at.weight * at.difference) / share
    square = pair.windows.sum(at.weight * at.difference**2) / share
    return np.asarray(np.maximum(square - mean**2, 1e-6), dtype=np.float64)


def precision_of_shifts(pair: ScanPair, at: NormalEquations, variance: FloatArray) -> FloatArray:
    """A M^-1 A (mi, mj, mk, 3, 3) 1/mm2, with what A has lost to noise counted as nothing."""
    noise = measured_correlation(at.difference, at.weight > 0.5)
    A, M = _without_noise(pair, at, variance, noise), _score_covariance(pair, at, variance, noise)
    value, vector = np.linalg.eigh(A)
    A = np.einsum("...ij,...j,...kj->...ik", vector, np.maximum(value, 0.0), vector)
    floor = 1e-9 * np.maximum(np.trace(M, axis1=-2, axis2=-1), 1e-12)
    return np.asarray(A @ np.linalg.solve(M + floor[..., None, None] * np.eye(3), A))


def less_sure(precision: FloatArray, bias: FloatArray) -> FloatArray:
    """Precision (..., 3, 3) when an error (..., 3) mm of unknown sign is added."""
    along = (precision @ bias[..., None])[..., 0]
    share = 1.0 + (bias * along).sum(axis=-1)
    return np.asarray(precision - along[..., :, None] * along[..., None, :] / share[..., None, None])


def _without_noise(pair: ScanPair, at: NormalEquations, variance: FloatArray, noise: CorrelatedNoise) -> FloatArray:
    """A less what the noise's own gradient adds to it: a quarter of the difference's, as the mean of both scans has.

    That part scatters from window to window. CHANCE standard deviations of its scatter are taken off as well, so that
    noise alone does not pass for texture.
    """
    scatter = np.sqrt(2.0 * noise.together / pair.windows.independent_voxels)
    share = (1.0 + CHANCE * scatter) * pair.windows.sum(at.weight)
    A = at.A.copy()
    for axis in range(3):
        kernel = noise.kernels[axis]
        two = kernel[len(kernel) // 2 + 2] if len(kernel) > 4 else 0.0
        A[..., axis, axis] -= share * 0.25 * variance * (1.0 - two) / (2.0 * pair.windows.spacing[axis] ** 2)
    return A


def _score_covariance(pair: ScanPair, at: NormalEquations, variance: FloatArray, noise: CorrelatedNoise) -> FloatArray:
    weighted = [at.weight * f for f in at.gradient]
    spread = [noise.applied(f) for f in weighted]
    parts = {
        (i, j): 0.5 * pair.windows.sum_of_squared_weights(weighted[i] * spread[j] + weighted[j] * spread[i])
        for i, j in pairs(3)
    }
    return symmetric(parts, 3) * variance[..., None, None]
