"""Pieces of finite kinematics shared by the laws' kernels: determinant, cofactor and its derivative, volumetric measure."""

from __future__ import annotations

from numba import njit

from palpate.core.arrays import FloatArray


@njit(cache=True, inline="always")
def flat_with_cofactor(F: FloatArray, n: int, q: int, f: FloatArray, c: FloatArray) -> float:
    """f (9,) = F[n, q] and c (9,) = its cofactor, index 3 i + J; returns det F. Without views of F, which cost more than the sums."""
    for i in range(3):
        for j in range(3):
            f[3 * i + j] = F[n, q, i, j]
    c[0] = f[4] * f[8] - f[5] * f[7]
    c[1] = f[5] * f[6] - f[3] * f[8]
    c[2] = f[3] * f[7] - f[4] * f[6]
    c[3] = f[2] * f[7] - f[1] * f[8]
    c[4] = f[0] * f[8] - f[2] * f[6]
    c[5] = f[1] * f[6] - f[0] * f[7]
    c[6] = f[1] * f[5] - f[2] * f[4]
    c[7] = f[2] * f[3] - f[0] * f[5]
    c[8] = f[0] * f[4] - f[1] * f[3]
    return f[0] * c[0] + f[1] * c[1] + f[2] * c[2]


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
def volumetric_measure(J: float, power: float) -> tuple[float, float, float]:
    """Measure g(J) and its first two derivatives: (J - 1) for power 1, (J^power - 1) otherwise."""
    if power == 1.0:
        return J - 1.0, 1.0, 0.0
    base = J**power
    return base - 1.0, power * base / J, power * (power - 1.0) * base / (J * J)
