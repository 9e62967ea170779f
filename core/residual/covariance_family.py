"""Covariances that are sums of the same few matrices: hundreds of them take the memory of those few."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class CovarianceFamily:
    """matrices (b, n, n) mm2. coefficients (g, b) : member k is the sum of coefficients[k, j] * matrices[j]."""

    matrices: FloatArray
    coefficients: FloatArray

    @classmethod
    def one(cls, covariance: FloatArray) -> CovarianceFamily:
        """The family whose only member is a covariance (n, n)."""
        return cls(covariance[None], np.ones((1, 1)))

    def __len__(self) -> int:
        return len(self.coefficients)

    def __getitem__(self, k: int) -> FloatArray:
        return self._sum(self.coefficients[k])

    def __iter__(self) -> Iterator[FloatArray]:
        return (self[k] for k in range(len(self)))

    def only(self, members: IntArray) -> CovarianceFamily:
        """The family of these members."""
        return CovarianceFamily(self.matrices, self.coefficients[members])

    def mean(self, weights: FloatArray) -> FloatArray:
        """Sum (n, n) of all members times weights (g,)."""
        return self._sum(weights @ self.coefficients)

    def _sum(self, coefficients: FloatArray) -> FloatArray:
        return np.asarray(np.tensordot(coefficients, self.matrices, 1))
