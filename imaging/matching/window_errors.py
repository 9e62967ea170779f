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
from palpate.imaging.matching.window_fits import DAMPING, NormalEquations
from palpate.imaging.matching.window_sums import pairs, symmetric

# Standard deviations by which a window's texture must exceed what noise leaves by chance.
CHANCE = 3.0
# Precision, 1/mm2, below which a direction stays where the smooth motion has it: a standard deviation of 3 mm.
LEAST_PRECISION = 1.0 / 9.0
# Variance of the difference of two scans in whole HU, HU2: each is rounded. Scans without noise have no less.
ROUNDED_HU2 = 2.0 / 12.0


def variance_left(pair: ScanPair, at: NormalEquations) -> FloatArray:
    """Variance (mi, mj, mk) HU2 of the difference that is left in every window."""
    share = np.maximum(pair.windows.sum(at.weight), 1e-6)
    mean = pair.windows.sum(at.weight * at.difference) / share
    square = pair.windows.sum(at.weight * at.difference**2) / share
    return np.asarray(np.maximum(square - mean**2, ROUNDED_HU2), dtype=np.float64)


def texture_and_precision(
    pair: ScanPair, at: NormalEquations, variance: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Texture of the picture alone (mi, mj, mk, 3, 3) HU2/mm2, A less what noise adds to it on average; a cautious precision
    A M^-1 A (mi, mj, mk, 3, 3) 1/mm2 of the shift, with A less what noise may add to it by chance; and M (mi, mj, mk, 3, 3)."""
    noise = measured_correlation(at.difference, at.weight > 0.5)
    M = _score_covariance(pair, at, variance, noise)
    texture, A = (_without_noise(pair, at, variance, noise, chance) for chance in (0.0, CHANCE))
    floor = 1e-9 * np.maximum(np.trace(M, axis1=-2, axis2=-1), 1e-12)
    M = M + floor[..., None, None] * np.eye(3)
    return texture, np.asarray(A @ np.linalg.solve(M, A)), M


def one_step(texture: FloatArray, score: FloatArray, precision: FloatArray) -> FloatArray:
    """Shift (..., 3) mm by which a window's score (..., 3) is nothing: one Gauss-Newton step, with the texture (..., 3, 3)
    of the picture alone, for noise has slope but does not move along. No step where the precision (..., 3, 3) is none."""
    value, vector = np.linalg.eigh(texture)
    along = np.einsum("...ij,...i->...j", vector, score) / np.maximum(value, DAMPING)
    step = np.einsum("...ij,...j->...i", vector, along)
    value, vector = np.linalg.eigh(precision)
    told = np.einsum("...ij,...i->...j", vector, step) * (value > LEAST_PRECISION)
    return np.asarray(np.einsum("...ij,...j->...i", vector, told))


def precision_of_step(texture: FloatArray, score: FloatArray, cautious: FloatArray) -> FloatArray:
    """Precision (..., 3, 3) 1/mm2 of `one_step`, which goes only where a cautious precision (..., 3, 3) tells something.

    texture (..., 3, 3) : of the picture alone, on average. score (..., 3, 3) : covariance of the scores.
    """
    value, vector = np.linalg.eigh(texture)
    inverse = np.einsum("...ij,...j,...kj->...ik", vector, 1.0 / np.maximum(value, DAMPING), vector)
    value, vector = np.linalg.eigh(cautious)
    told = (value > LEAST_PRECISION)[..., None, :] * np.eye(3)
    turned = np.swapaxes(vector, -1, -2)
    within = told @ (turned @ inverse @ score @ inverse @ vector) @ told
    return np.asarray(vector @ (np.linalg.inv(within + np.eye(3) - told) - (np.eye(3) - told)) @ turned)


def less_sure(precision: FloatArray, bias: FloatArray) -> FloatArray:
    """Precision (..., 3, 3) when an error (..., 3) mm of unknown sign is added."""
    along = (precision @ bias[..., None])[..., 0]
    share = 1.0 + (bias * along).sum(axis=-1)
    return np.asarray(precision - along[..., :, None] * along[..., None, :] / share[..., None, None])


def noise_of_gradient(noise: CorrelatedNoise, spacing: FloatArray, noise_of_mean: float) -> FloatArray:
    """Variance (3,) 1/mm2 of the slope of the mean's noise along each axis, over the variance of the difference of both scans.

    noise_of_mean : see `NormalEquations`.
    """
    two = np.array([k[len(k) // 2 + 2] if len(k) > 4 else 0.0 for k in noise.kernels])
    return np.asarray(noise_of_mean * (1.0 - two) / (2.0 * spacing**2))


def _without_noise(
    pair: ScanPair, at: NormalEquations, variance: FloatArray, noise: CorrelatedNoise, chance: float
) -> FloatArray:
    """A less what the noise's own gradient adds to it; no direction has less than nothing.

    That part scatters from window to window. `chance` standard deviations of its scatter are taken off as well, so that
    noise alone does not pass for texture.
    """
    scatter = np.sqrt(2.0 * noise.together / pair.windows.independent_voxels)
    share = (1.0 + chance * scatter) * pair.windows.sum(at.weight)
    A = at.A.copy()
    for axis, of_noise in enumerate(noise_of_gradient(noise, pair.windows.spacing, at.noise_of_mean)):
        A[..., axis, axis] -= share * variance * of_noise
    value, vector = np.linalg.eigh(A)
    return np.asarray(np.einsum("...ij,...j,...kj->...ik", vector, np.maximum(value, 0.0), vector))


def _score_covariance(pair: ScanPair, at: NormalEquations, variance: FloatArray, noise: CorrelatedNoise) -> FloatArray:
    weighted = [at.weight * f for f in at.gradient]
    noise = noise.in_windows(pair.windows.sigma_mm, pair.windows.spacing)
    spread = [noise.applied(f) for f in weighted]
    parts = {
        (i, j): 0.5 * pair.windows.sum_of_squared_weights(weighted[i] * spread[j] + weighted[j] * spread[i])
        for i, j in pairs(3)
    }
    return symmetric(parts, 3) * variance[..., None, None]
