"""Linear elasticity that stiffens with strain: psi = G e:e + B/2 (e:e)^2 + K/2 tr(eps)^2, e the deviator of the small strain.

The tangent shear modulus grows as G + B e:e. Quartic, so that it is linear in its parameters and convex.
"""

from __future__ import annotations

from numba import njit

from palpate.core.arrays import FloatArray
from palpate.core.laws.base import Law, PointValues, bulk_of_G_K, shear_of_G_K


@njit(cache=True)
def _kernel(F: FloatArray, p: FloatArray, out: PointValues, order: int) -> None:
    W, g, P, G, A, H = out
    for n in range(F.shape[0]):
        shear, extra = p[n, 0], p[n, 2]
        for q in range(F.shape[1]):
            f = F[n, q]
            trace = f[0, 0] + f[1, 1] + f[2, 2] - 3.0
            square = 0.0
            for i in range(3):
                for j in range(3):
                    e = 0.5 * (f[i, j] + f[j, i])
                    if i == j:
                        e -= 1.0 + trace / 3.0
                    square += e * e
            W[n, q] = shear * square + 0.5 * extra * square * square
            g[n, q] = trace
            if order == 0:
                continue
            modulus = shear + extra * square
            for i in range(3):
                for j in range(3):
                    e = 0.5 * (f[i, j] + f[j, i])
                    if i == j:
                        e -= 1.0 + trace / 3.0
                    P[n, q, i, j] = 2.0 * modulus * e
                    G[n, q, i, j] = 1.0 if i == j else 0.0
            if order >= 2:
                H[n, q] = 0.0
                for a in range(9):
                    for b in range(9):
                        # d(modulus)/dF = 2 B e = (B / modulus) P
                        slope = extra / (modulus * modulus) if modulus > 0.0 else 0.0
                        A[n, q, a, b] = slope * P[n, q, a // 3, a % 3] * P[n, q, b // 3, b % 3]
                for i in range(3):
                    for j in range(3):
                        A[n, q, 3 * i + j, 3 * i + j] += modulus
                        A[n, q, 3 * i + j, 3 * j + i] += modulus
                        A[n, q, 4 * i, 4 * j] -= 2.0 * modulus / 3.0


STIFFENING = Law(
    "linear-stiffening", ("G", "K", "B"), _kernel, bulk_of_G_K, shear_of_G_K, needs_positive_jacobian=False
)
