"""Sums of products of fields in Gaussian windows about every voxel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import Float32Array, FloatArray

TRUNCATE = 2.5


@dataclass(frozen=True, eq=False)
class Windows:
    """Gaussian windows on a grid. sigma_mm : standard deviation. spacing : (3,) mm of the grid."""

    sigma_mm: float
    spacing: FloatArray

    def sum(self, field: Float32Array) -> Float32Array:
        """Weighted mean (ni, nj, nk) of a field about each voxel; weights add up to 1."""
        sigma = self.sigma_mm / self.spacing
        return np.asarray(ndimage.gaussian_filter(field, sigma, mode="constant", truncate=TRUNCATE))

    @property
    def independent_voxels(self) -> float:
        """The number of voxels whose plain mean is as sure as the window's weighted one."""
        return float((2.0 * np.sqrt(np.pi) * self.sigma_mm) ** 3 / np.prod(self.spacing))

    def sum_of_squared_weights(self, field: Float32Array) -> Float32Array:
        """The same with each weight squared: what a sum of independent errors of that variance has as its variance."""
        sigma = self.sigma_mm / np.sqrt(2.0) / self.spacing
        total = ndimage.gaussian_filter(field, sigma, mode="constant", truncate=TRUNCATE * np.sqrt(2.0))
        return np.asarray(total / self.independent_voxels)


def pairs(count: int) -> list[tuple[int, int]]:
    """Index pairs (i, j), j >= i, of a symmetric matrix of that size."""
    return [(i, j) for i in range(count) for j in range(i, count)]


def symmetric(parts: dict[tuple[int, int], Float32Array], count: int) -> FloatArray:
    """Matrices (..., count, count) from their upper parts (...)."""
    first = next(iter(parts.values()))
    out = np.empty((*first.shape, count, count))
    for (i, j), values in parts.items():
        out[..., i, j] = out[..., j, i] = values
    return out
