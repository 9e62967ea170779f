"""Mooney-Rivlin, the organ's law (paper Eq 8).

psi = mu1 (I2bar - 3) + mu2 (I1bar - 3) + v1 g(J)^2 with I2 = (tr(C)^2 - tr(C^2)) / 2. The volumetric measure is g = J - 1
(bulk modulus 2 v1, `MOONEY_RIVLIN`) or the printed g = I3^(1/3) - 1 (bulk modulus 8/9 v1, `MOONEY_RIVLIN_PRINTED`).
The small-strain shear modulus is G = 2 (mu1 + mu2).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from palpate.core.laws.base import FloatArray, Kernel, Law
from palpate.core.laws.kinematics import add_cofactor_derivative, cofactor, determinant, volumetric_measure


@njit(cache=True)
def _invariants(F: FloatArray, B: FloatArray, C: FloatArray) -> tuple[float, float]:
    """I1 and I2 of one F; fills B = F F^T and C = F^T F."""
    for i in range(3):
        for j in range(3):
            b = 0.0
            c = 0.0
            for k in range(3):
                b += F[i, k] * F[j, k]
                c += F[k, i] * F[k, j]
            B[i, j] = b
            C[i, j] = c
    I1 = C[0, 0] + C[1, 1] + C[2, 2]
    trace_of_square = 0.0
    for i in range(3):
        for j in range(3):
            trace_of_square += C[i, j] * C[i, j]
    return I1, 0.5 * (I1 * I1 - trace_of_square)


@njit(cache=True)
def _second_derivative(
    F: FloatArray, B: FloatArray, C: FloatArray, I1: float, a: float, b: float, A: FloatArray
) -> None:
    """A = a d2I1 + b d2I2 (index 3 i + J)."""
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    v = b * (4.0 * F[i, j] * F[k, m] - 2.0 * F[i, m] * F[k, j])
                    if i == k:
                        v -= 2.0 * b * C[m, j]
                    if j == m:
                        v -= 2.0 * b * B[i, k]
                    if i == k and j == m:
                        v += 2.0 * a + 2.0 * b * I1
                    A[3 * i + j, 3 * k + m] = v


@njit(cache=True)
def _point(F, mu1, mu2, power, P, G, A, H, B, C, cof, d1, d2, order):  # type: ignore[no-untyped-def]
    """One quadrature point; returns W and g and fills the derivatives asked for."""
    J = determinant(F)
    if not J > 0.0:
        return np.inf, np.inf
    I1, I2 = _invariants(F, B, C)
    J23 = J ** (-2.0 / 3.0)
    w1 = mu2 * J23  # factor of I1
    w2 = mu1 * J23 * J23  # factor of I2
    W = w1 * I1 - 3.0 * mu2 + w2 * I2 - 3.0 * mu1
    cofactor(F, cof)
    g, g1, g2 = volumetric_measure(J, cof, power)
    if order == 0:
        return W, g
    # dW/dJ at fixed I1, I2
    slope = -(2.0 * w1 * I1 + 4.0 * w2 * I2) / (3.0 * J)
    for i in range(3):
        for j in range(3):
            bf = 0.0
            for k in range(3):
                bf += B[i, k] * F[k, j]
            d1[3 * i + j] = 2.0 * F[i, j]
            d2[3 * i + j] = 2.0 * (I1 * F[i, j] - bf)
            P[i, j] = w1 * d1[3 * i + j] + w2 * d2[3 * i + j] + slope * cof[i, j]
            G[i, j] = g1 * cof[i, j]
    if order == 1:
        return W, g
    _second_derivative(F, B, C, I1, w1, w2, A)
    curvature = (10.0 * w1 * I1 + 28.0 * w2 * I2) / (9.0 * J * J)
    for i in range(9):
        ci = cof[i // 3, i % 3]
        mixed_i = (2.0 * w1 * d1[i] + 4.0 * w2 * d2[i]) / (3.0 * J)
        for j in range(9):
            cj = cof[j // 3, j % 3]
            mixed_j = (2.0 * w1 * d1[j] + 4.0 * w2 * d2[j]) / (3.0 * J)
            A[i, j] += curvature * ci * cj - mixed_i * cj - ci * mixed_j
            H[i, j] = g2 * ci * cj
    add_cofactor_derivative(F, slope, A)
    add_cofactor_derivative(F, g1, H)
    return W, g


@njit(cache=True)
def _kernel(F, p, W, g, P, G, A, H, order, power):  # type: ignore[no-untyped-def]
    B, C, cof = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    d1, d2 = np.empty(9), np.empty(9)
    P0, A0 = np.empty((3, 3)), np.empty((9, 9))
    for n in range(F.shape[0]):
        for q in range(F.shape[1]):
            Pq, Gq = (P[n, q], G[n, q]) if order >= 1 else (P0, P0)
            Aq, Hq = (A[n, q], H[n, q]) if order >= 2 else (A0, A0)
            W[n, q], g[n, q] = _point(F[n, q], p[n, 0], p[n, 1], power, Pq, Gq, Aq, Hq, B, C, cof, d1, d2, order)


def _with_power(power: float) -> Kernel:
    def kernel(F, p, W, g, P, G, A, H, order):  # type: ignore[no-untyped-def]
        _kernel(F, p, W, g, P, G, A, H, order, power)

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
