"""Mooney-Rivlin, the organ's law: Eq 8 of Yang & Lin, MaterialCloning (docs/references.bib).

The equation's I2 is read as tr(C^2), so that (I1^2 - I2) / 2 is the second invariant:

psi = mu1 (I2bar - 3) + mu2 (I1bar - 3) + v1 g(J)^2 with I2 = (tr(C)^2 - tr(C^2)) / 2. The volumetric measure is g = J - 1
(bulk modulus 2 v1, `MOONEY_RIVLIN`) or the printed g = I3^(1/3) - 1 (bulk modulus 8/9 v1, `MOONEY_RIVLIN_PRINTED`).
The small-strain shear modulus is G = 2 (mu1 + mu2).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from palpate.core.arrays import FloatArray
from palpate.core.laws.base import Kernel, Law, PointValues
from palpate.core.laws.kinematics import add_cofactor_derivative, flat_with_cofactor, volumetric_measure


@njit(cache=True)
def _second_invariant_slope(f: FloatArray, I1: float, d: FloatArray) -> None:
    """d (9,) = dI2/dF = 2 (I1 F - F C) with C = F^T F."""
    c00 = f[0] * f[0] + f[3] * f[3] + f[6] * f[6]
    c11 = f[1] * f[1] + f[4] * f[4] + f[7] * f[7]
    c22 = f[2] * f[2] + f[5] * f[5] + f[8] * f[8]
    c01 = f[0] * f[1] + f[3] * f[4] + f[6] * f[7]
    c02 = f[0] * f[2] + f[3] * f[5] + f[6] * f[8]
    c12 = f[1] * f[2] + f[4] * f[5] + f[7] * f[8]
    for r in range(0, 9, 3):
        x, y, z = f[r], f[r + 1], f[r + 2]
        d[r] = 2.0 * ((I1 - c00) * x - c01 * y - c02 * z)
        d[r + 1] = 2.0 * ((I1 - c11) * y - c01 * x - c12 * z)
        d[r + 2] = 2.0 * ((I1 - c22) * z - c02 * x - c12 * y)


@njit(cache=True)
def _second_invariant_curvature(f: FloatArray, I1: float, b: float, A: FloatArray) -> None:
    """A (9, 9) = b d2I2/dF dF."""
    for i in range(3):
        for k in range(3):
            left = 0.0  # (F F^T)_ik
            for m in range(3):
                left += f[3 * i + m] * f[3 * k + m]
            for j in range(3):
                for m in range(3):
                    v = 4.0 * f[3 * i + j] * f[3 * k + m] - 2.0 * f[3 * i + m] * f[3 * k + j]
                    if j == m:
                        v -= 2.0 * left
                        if i == k:
                            v += 2.0 * I1
                    if i == k:
                        v -= 2.0 * (f[j] * f[m] + f[3 + j] * f[3 + m] + f[6 + j] * f[6 + m])
                    A[3 * i + j, 3 * k + m] = b * v


@njit(cache=True)
def _second_derivatives(
    f: FloatArray,
    c: FloatArray,
    d: FloatArray,
    w1: float,
    w2: float,
    I1: float,
    I2: float,
    J: float,
    g2: float,
    A: FloatArray,
    H: FloatArray,
) -> None:
    """A and H (9, 9) but for the terms with the cofactor's derivative."""
    _second_invariant_curvature(f, I1, w2, A)
    curvature = (10.0 * w1 * I1 + 28.0 * w2 * I2) / (9.0 * J * J)
    first, second = 4.0 * w1 / (3.0 * J), 4.0 * w2 / (3.0 * J)
    for i in range(9):
        d[i] = first * f[i] + second * d[i]  # minus d2W/dF dJ
    for i in range(9):
        of_c, of_d, volumetric = curvature * c[i] - d[i], c[i], g2 * c[i]
        for j in range(9):
            A[i, j] += of_c * c[j] - of_d * d[j]
            H[i, j] = volumetric * c[j]
        A[i, i] += 2.0 * w1


@njit(cache=True)
def _kernel(F: FloatArray, p: FloatArray, out: PointValues, order: int, power: float) -> None:
    W, g, P, G, A, H = out
    f, c, d = np.empty(9), np.empty(9), np.empty(9)
    for n in range(F.shape[0]):
        mu1, mu2 = p[n, 0], p[n, 1]
        for q in range(F.shape[1]):
            J = flat_with_cofactor(F, n, q, f, c)
            if not J > 0.0:
                W[n, q] = g[n, q] = np.inf
                continue
            I1 = I2 = 0.0
            for k in range(9):
                I1 += f[k] * f[k]
                I2 += c[k] * c[k]  # tr cof C
            root = np.cbrt(J)
            w1 = mu2 / (root * root)  # factor of I1
            w2 = mu1 / (root * J)  # factor of I2
            W[n, q] = w1 * I1 - 3.0 * mu2 + w2 * I2 - 3.0 * mu1
            g[n, q], g1, g2 = volumetric_measure(J, power)
            if order == 0:
                continue
            slope = -(2.0 * w1 * I1 + 4.0 * w2 * I2) / (3.0 * J)  # dW/dJ at fixed I1, I2
            _second_invariant_slope(f, I1, d)
            for i in range(3):
                for j in range(3):
                    k = 3 * i + j
                    P[n, q, i, j] = 2.0 * w1 * f[k] + w2 * d[k] + slope * c[k]
                    G[n, q, i, j] = g1 * c[k]
            if order >= 2:
                _second_derivatives(f, c, d, w1, w2, I1, I2, J, g2, A[n, q], H[n, q])
                add_cofactor_derivative(F[n, q], slope, A[n, q])
                add_cofactor_derivative(F[n, q], g1, H[n, q])


def _with_power(power: float) -> Kernel:
    def kernel(F: FloatArray, p: FloatArray, out: PointValues, order: int) -> None:
        _kernel(F, p, out, order, power)

    return kernel


def _kappa(p: FloatArray) -> FloatArray:
    return 2.0 * p[:, 2]


def _shear_modulus(p: FloatArray) -> FloatArray:
    return 2.0 * (p[:, 0] + p[:, 1])


_PARAMETERS = ("mu1", "mu2", "v1")
MOONEY_RIVLIN = Law("mooney-rivlin", _PARAMETERS, _with_power(1.0), _kappa, _shear_modulus)
MOONEY_RIVLIN_PRINTED = Law("mooney-rivlin-printed", _PARAMETERS, _with_power(2.0 / 3.0), _kappa, _shear_modulus)


def mooney_rivlin_parameters(G: float, bulk_modulus: float, mu1_share: float = 0.5) -> FloatArray:
    """(mu1, mu2, v1) kPa of `MOONEY_RIVLIN` with shear modulus G = 2 (mu1 + mu2) and the given bulk modulus 2 v1, kPa."""
    return np.array([0.5 * G * mu1_share, 0.5 * G * (1.0 - mu1_share), 0.5 * bulk_modulus])
