"""Isotropic linear elasticity, the surrounding tissue's law: Eq 3 of Yang & Lin, MaterialCloning.

psi = G dev(eps):dev(eps) + K/2 tr(eps)^2 with eps the small strain; not objective: a large rotation stores energy, by its nature.
"""

from __future__ import annotations

from numba import njit

from palpate.core.arrays import FloatArray
from palpate.core.laws.base import Law, PointValues, bulk_of_G_K, shear_of_G_K


@njit(cache=True)
def _kernel(F: FloatArray, p: FloatArray, out: PointValues, order: int) -> None:
    W, g, P, G, A, H = out
    for n in range(F.shape[0]):
        shear = p[n, 0]
        for q in range(F.shape[1]):
            f = F[n, q]
            trace = f[0, 0] + f[1, 1] + f[2, 2] - 3.0
            energy = 0.0
            for i in range(3):
                for j in range(3):
                    e = 0.5 * (f[i, j] + f[j, i])
                    if i == j:
                        e -= 1.0 + trace / 3.0
                    energy += shear * e * e
                    if order >= 1:
                        P[n, q, i, j] = 2.0 * shear * e
                        G[n, q, i, j] = 1.0 if i == j else 0.0
            W[n, q] = energy
            g[n, q] = trace
            if order >= 2:
                A[n, q] = 0.0
                H[n, q] = 0.0
                for i in range(3):
                    for j in range(3):
                        A[n, q, 3 * i + j, 3 * i + j] += shear
                        A[n, q, 3 * i + j, 3 * j + i] += shear
                        A[n, q, 4 * i, 4 * j] -= 2.0 * shear / 3.0


LINEAR = Law("linear", ("G", "K"), _kernel, bulk_of_G_K, shear_of_G_K, needs_positive_jacobian=False)


def bulk_modulus(G: float, poisson_ratio: float) -> float:
    """K = 2 G (1 + nu) / (3 (1 - 2 nu)), kPa."""
    return 2.0 * G * (1.0 + poisson_ratio) / (3.0 * (1.0 - 2.0 * poisson_ratio))
