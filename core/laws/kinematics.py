"""Pieces of finite kinematics shared by the laws' kernels: determinant, cofactor and its derivative."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@njit(cache=True, inline="always")
def determinant(F: FloatArray) -> float:
    """det F of one (3, 3) matrix."""
    return (
        F[0, 0] * (F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1])
        - F[0, 1] * (F[1, 0] * F[2, 2] - F[1, 2] * F[2, 0])
        + F[0, 2] * (F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0])
    )


@njit(cache=True)
def cofactor(F: FloatArray, out: FloatArray) -> None:
    """out = dJ/dF = J F^-T, written without the division so that it exists for singular F too."""
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            out[i, j] = F[i1, j1] * F[i2, j2] - F[i1, j2] * F[i2, j1]


@njit(cache=True)
def add_cofactor_derivative(F: FloatArray, factor: float, out: FloatArray) -> None:
    """out (9, 9) += factor * d2J/dF dF, index 3 i + J; d cof_iJ / dF_kL = e_ikm e_JLn F_mn."""
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            row = 3 * i + j
            out[row, 3 * i1 + j1] += factor * F[i2, j2]
            out[row, 3 * i2 + j2] += factor * F[i1, j1]
            out[row, 3 * i1 + j2] -= factor * F[i2, j1]
            out[row, 3 * i2 + j1] -= factor * F[i1, j2]


@njit(cache=True)
def volumetric_measure(J: float, cof: FloatArray, power: float) -> tuple[float, float, float]:
    """Measure g(J) and its first two derivatives: (J - 1) for power 1, (J^power - 1) otherwise."""
    if power == 1.0:
        return J - 1.0, 1.0, 0.0
    base = J**power
    return base - 1.0, power * base / J, power * (power - 1.0) * base / (J * J)
