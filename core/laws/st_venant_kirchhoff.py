"""St. Venant-Kirchhoff: the linear law in the Green-Lagrange strain E = (F^T F - 1) / 2.

psi = G dev(E):dev(E) + K/2 tr(E)^2. Objective, but it softens and fails in compression: for moderate strain only.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from palpate.core.arrays import FloatArray
from palpate.core.laws.base import Law, bulk_of_G_K, shear_of_G_K


@njit(cache=True)
def _point(
    f: FloatArray, shear: float, S: FloatArray, P: FloatArray, G: FloatArray, A: FloatArray, H: FloatArray, order: int
) -> tuple[float, float]:
    """One point; S (3, 3) receives the deviatoric strain. Returns W and g."""
    for i in range(3):
        for j in range(3):
            c = 0.0
            for k in range(3):
                c += f[k, i] * f[k, j]
            S[i, j] = 0.5 * (c - (1.0 if i == j else 0.0))
    trace = S[0, 0] + S[1, 1] + S[2, 2]
    W = 0.0
    for i in range(3):
        S[i, i] -= trace / 3.0
    for i in range(3):
        for j in range(3):
            W += shear * S[i, j] * S[i, j]
    if order == 0:
        return W, trace
    for i in range(3):
        for j in range(3):
            fs = 0.0
            for k in range(3):
                fs += f[i, k] * S[k, j]
            P[i, j] = 2.0 * shear * fs
            G[i, j] = f[i, j]
    if order == 1:
        return W, trace
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    v = f[i, m] * f[k, j] - 2.0 / 3.0 * f[i, j] * f[k, m]
                    if j == m:
                        for n in range(3):
                            v += f[i, n] * f[k, n]
                    v *= shear
                    if i == k:
                        v += 2.0 * shear * S[j, m]
                    A[3 * i + j, 3 * k + m] = v
                    H[3 * i + j, 3 * k + m] = 1.0 if (i == k and j == m) else 0.0
    return W, trace


@njit(cache=True)
def _kernel(
    F: FloatArray,
    p: FloatArray,
    W: FloatArray,
    g: FloatArray,
    P: FloatArray,
    G: FloatArray,
    A: FloatArray,
    H: FloatArray,
    order: int,
) -> None:
    S, P0, A0 = np.empty((3, 3)), np.empty((3, 3)), np.empty((9, 9))
    for n in range(F.shape[0]):
        for q in range(F.shape[1]):
            Pq, Gq = (P[n, q], G[n, q]) if order >= 1 else (P0, P0)
            Aq, Hq = (A[n, q], H[n, q]) if order >= 2 else (A0, A0)
            W[n, q], g[n, q] = _point(F[n, q], p[n, 0], S, Pq, Gq, Aq, Hq, order)


ST_VENANT_KIRCHHOFF = Law(
    "st-venant-kirchhoff", ("G", "K"), _kernel, bulk_of_G_K, shear_of_G_K, needs_positive_jacobian=False
)
