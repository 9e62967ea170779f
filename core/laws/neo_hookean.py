"""Neo-Hookean: psi = G/2 (I1bar - 3) + K/2 (J - 1)^2. Mooney-Rivlin without its mu1 term, and without that term's cost."""

from __future__ import annotations

import numpy as np
from numba import njit

from palpate.core.arrays import FloatArray
from palpate.core.laws.base import Law, PointValues, bulk_of_G_K, shear_of_G_K
from palpate.core.laws.kinematics import add_cofactor_derivative, flat_with_cofactor


@njit(cache=True)
def _kernel(F: FloatArray, p: FloatArray, out: PointValues, order: int) -> None:
    W, g, P, G, A, H = out
    f, c = np.empty(9), np.empty(9)
    for n in range(F.shape[0]):
        shear = p[n, 0]
        for q in range(F.shape[1]):
            J = flat_with_cofactor(F, n, q, f, c)
            if not J > 0.0:
                W[n, q] = g[n, q] = np.inf
                continue
            I1 = 0.0
            for k in range(9):
                I1 += f[k] * f[k]
            root = np.cbrt(J)
            w = shear / (root * root)  # G J^(-2/3)
            W[n, q] = 0.5 * (w * I1 - 3.0 * shear)
            g[n, q] = J - 1.0
            if order >= 1:
                slope = -w * I1 / (3.0 * J)
                for i in range(3):
                    for j in range(3):
                        P[n, q, i, j] = w * f[3 * i + j] + slope * c[3 * i + j]
                        G[n, q, i, j] = c[3 * i + j]
            if order >= 2:
                _second_derivatives(f, c, w, I1, J, A[n, q], H[n, q])
                add_cofactor_derivative(F[n, q], slope, A[n, q])
                add_cofactor_derivative(F[n, q], 1.0, H[n, q])


@njit(cache=True)
def _second_derivatives(
    f: FloatArray, c: FloatArray, w: float, I1: float, J: float, A: FloatArray, H: FloatArray
) -> None:
    """A and H (9, 9) but for the term with the cofactor's derivative."""
    both, twice = 2.0 * w / (3.0 * J), 5.0 * w * I1 / (9.0 * J * J)
    for i in range(9):
        of_c, of_f = twice * c[i] - both * f[i], both * c[i]
        for j in range(9):
            A[i, j] = of_c * c[j] - of_f * f[j]
            H[i, j] = 0.0
        A[i, i] += w


NEO_HOOKEAN = Law("neo-hookean", ("G", "K"), _kernel, bulk_of_G_K, shear_of_G_K)
