"""Compiled loops over cells: deformation gradients, residuals and tangents. No law and no mesh is known here."""

from __future__ import annotations

import numpy as np
from numba import njit

from palpate.core.arrays import BoolArray, FloatArray, IntArray


@njit(cache=True)
def deformation_gradients(u: FloatArray, conn: IntArray, dN: FloatArray, inverse: FloatArray, F: FloatArray) -> None:
    """F (m, q, 3, 3) = 1 + du/dX of nodal u (n, 3), connectivity (m, k), reference gradients (q, k, 3), dxi/dX (m, 3,
    3).
    """
    for e in range(conn.shape[0]):
        for q in range(dN.shape[0]):
            for i in range(3):
                h0 = h1 = h2 = 0.0
                for a in range(conn.shape[1]):
                    v = u[conn[e, a], i]
                    h0 += v * dN[q, a, 0]
                    h1 += v * dN[q, a, 1]
                    h2 += v * dN[q, a, 2]
                for J in range(3):
                    F[e, q, i, J] = h0 * inverse[e, 0, J] + h1 * inverse[e, 1, J] + h2 * inverse[e, 2, J]
                F[e, q, i, i] += 1.0


@njit(cache=True)
def spatial_gradients(dN: FloatArray, inverse: FloatArray, e: int, q: int, out: FloatArray) -> None:
    """out (k, 3) = dN_a/dX of cell e at point q."""
    for a in range(dN.shape[1]):
        for J in range(3):
            out[a, J] = dN[q, a, 0] * inverse[e, 0, J] + dN[q, a, 1] * inverse[e, 1, J] + dN[q, a, 2] * inverse[e, 2, J]


@njit(cache=True)
def add_internal_force(
    stress: FloatArray,
    cells: IntArray,
    conn: IntArray,
    dN: FloatArray,
    inverse: FloatArray,
    weight: FloatArray,
    out: FloatArray,
    magnitude: FloatArray,
) -> None:
    """out (n, 3) += sum_q w P : dN/dX over cells (m,), stress (m, q, 3, 3); magnitude += |contribution|, a residual's
    scale.
    """
    grad = np.empty((dN.shape[1], 3))
    for k in range(cells.shape[0]):
        e = cells[k]
        for q in range(dN.shape[0]):
            spatial_gradients(dN, inverse, e, q, grad)
            w = weight[e, q]
            for a in range(conn.shape[1]):
                for i in range(3):
                    f = w * (
                        stress[k, q, i, 0] * grad[a, 0]
                        + stress[k, q, i, 1] * grad[a, 1]
                        + stress[k, q, i, 2] * grad[a, 2]
                    )
                    out[conn[e, a], i] += f
                    magnitude[conn[e, a], i] += abs(f)


@njit(cache=True)
def add_volumetric_force(
    g: FloatArray, cells: IntArray, Np: FloatArray, pressures: IntArray, weight: FloatArray, out: FloatArray
) -> None:
    """out (n_p,) += integral Np g over cells (m,), g (m, q)."""
    for k in range(cells.shape[0]):
        e = cells[k]
        for q in range(Np.shape[0]):
            v = weight[e, q] * g[k, q]
            for a in range(pressures.shape[1]):
                out[pressures[e, a]] += v * Np[q, a]


@njit(cache=True)
def pressure_at_points(p: FloatArray, cells: IntArray, Np: FloatArray, pressures: IntArray, out: FloatArray) -> None:
    """out (m, q) = interpolated pressure in cells (m,)."""
    for k in range(cells.shape[0]):
        e = cells[k]
        for q in range(Np.shape[0]):
            v = 0.0
            for a in range(pressures.shape[1]):
                v += p[pressures[e, a]] * Np[q, a]
            out[k, q] = v


@njit(cache=True)
def add_pressure(p: FloatArray, G: FloatArray, P: FloatArray) -> None:
    """P (m, q, 3, 3) += p (m, q) G, in place."""
    for e in range(P.shape[0]):
        for q in range(P.shape[1]):
            factor = p[e, q]
            for i in range(3):
                for J in range(3):
                    P[e, q, i, J] += factor * G[e, q, i, J]


@njit(cache=True)
def volume_rates(
    u: FloatArray, conn: IntArray, dN: FloatArray, inverse: FloatArray, G: FloatArray, out: FloatArray
) -> None:
    """out (m, q) = G (m, q, 3, 3) : grad u, for nodal u (n, 3)."""
    for e in range(conn.shape[0]):
        for q in range(dN.shape[0]):
            total = 0.0
            for i in range(3):
                h0 = h1 = h2 = 0.0
                for a in range(conn.shape[1]):
                    v = u[conn[e, a], i]
                    h0 += v * dN[q, a, 0]
                    h1 += v * dN[q, a, 1]
                    h2 += v * dN[q, a, 2]
                for J in range(3):
                    h = h0 * inverse[e, 0, J] + h1 * inverse[e, 1, J] + h2 * inverse[e, 2, J]
                    total += G[e, q, i, J] * h
            out[e, q] = total


@njit(cache=True)
def complete_moduli(A: FloatArray, H: FloatArray, G: FloatArray, factor: FloatArray, curvature: FloatArray) -> None:
    """A (m, q, 9, 9) += factor (m, q) H + curvature (m,) G G^T: the volumetric part of d2psi/dF dF, in place."""
    for e in range(A.shape[0]):
        for q in range(A.shape[1]):
            f = factor[e, q]
            for r in range(9):
                c = curvature[e] * G[e, q, r // 3, r % 3]
                for s in range(9):
                    A[e, q, r, s] += f * H[e, q, r, s] + c * G[e, q, s // 3, s % 3]


@njit(cache=True, fastmath={"contract"})
def tangent_blocks(
    A: FloatArray,
    G: FloatArray,
    Np: FloatArray,
    dN: FloatArray,
    inverse: FloatArray,
    weight: FloatArray,
    cells: IntArray,
    compliance: FloatArray,
    blocks: FloatArray,
) -> None:
    """blocks (m, 3 k + np, 3 k + np) of cells (m,): upper triangle of [[B^T A B, B^T G Np], [., -compliance]].

    Unknowns are ordered component by component (i, a), then pressures, so that the inner loops run along memory;
    entries below the diagonal are not to be read. A (m, q, 9, 9), G (m, q, 3, 3); inverse, weight, compliance for all
    cells of the mesh.
    """
    k = dN.shape[1]
    grad = np.empty((3, k))
    AB = np.empty((9, 3 * k))  # A_r,(m L) dN_b,L as [r, m k + b]
    for e in range(A.shape[0]):
        cell = cells[e]
        block = blocks[e]
        block[:] = 0.0
        for q in range(dN.shape[0]):
            for J in range(3):
                for a in range(k):
                    grad[J, a] = (
                        dN[q, a, 0] * inverse[cell, 0, J]
                        + dN[q, a, 1] * inverse[cell, 1, J]
                        + dN[q, a, 2] * inverse[cell, 2, J]
                    )
            w = weight[cell, q]
            for r in range(9):
                for m in range(3):
                    c0, c1, c2 = w * A[e, q, r, 3 * m], w * A[e, q, r, 3 * m + 1], w * A[e, q, r, 3 * m + 2]
                    for b in range(k):
                        AB[r, m * k + b] = c0 * grad[0, b] + c1 * grad[1, b] + c2 * grad[2, b]
            for i in range(3):
                for a in range(k):
                    g0, g1, g2 = grad[0, a], grad[1, a], grad[2, a]
                    for c in range(i * k, 3 * k):
                        block[i * k + a, c] += g0 * AB[3 * i, c] + g1 * AB[3 * i + 1, c] + g2 * AB[3 * i + 2, c]
                    if Np.shape[1] > 0:
                        v = w * (G[e, q, i, 0] * g0 + G[e, q, i, 1] * g1 + G[e, q, i, 2] * g2)
                        for c in range(Np.shape[1]):
                            block[i * k + a, 3 * k + c] += v * Np[q, c]
        for c in range(Np.shape[1]):
            for d in range(Np.shape[1]):
                block[3 * k + c, 3 * k + d] = -compliance[cell, c, d]


@njit(cache=True)
def smallest_determinant(F: FloatArray, needed: BoolArray) -> float:
    """Smallest det F over the cells marked in needed (m,); +inf when none is."""
    lowest = np.inf
    for e in range(F.shape[0]):
        if needed[e]:
            for q in range(F.shape[1]):
                f = F[e, q]
                d = (
                    f[0, 0] * (f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1])
                    - f[0, 1] * (f[1, 0] * f[2, 2] - f[1, 2] * f[2, 0])
                    + f[0, 2] * (f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0])
                )
                if not d >= lowest:
                    lowest = d
    return lowest
