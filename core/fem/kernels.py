"""Compiled loops over cells: deformation gradients, residuals and tangents. No law and no mesh is known here."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def deformation_gradients(u, conn, dN, inverse, F):  # type: ignore[no-untyped-def]
    """F (m, q, 3, 3) = 1 + du/dX of nodal u (n, 3), connectivity (m, k), reference gradients (q, k, 3), dxi/dX (m, 3, 3)."""
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
def spatial_gradients(dN, inverse, e, q, out):  # type: ignore[no-untyped-def]
    """out (k, 3) = dN_a/dX of cell e at point q."""
    for a in range(dN.shape[1]):
        for J in range(3):
            out[a, J] = dN[q, a, 0] * inverse[e, 0, J] + dN[q, a, 1] * inverse[e, 1, J] + dN[q, a, 2] * inverse[e, 2, J]


@njit(cache=True)
def add_internal_force(stress, conn, dN, inverse, weight, out, magnitude):  # type: ignore[no-untyped-def]
    """out (n, 3) += sum_q w P : dN/dX; magnitude += |contribution|, the scale that a residual is compared with."""
    grad = np.empty((dN.shape[1], 3))
    for e in range(conn.shape[0]):
        for q in range(dN.shape[0]):
            spatial_gradients(dN, inverse, e, q, grad)
            w = weight[e, q]
            for a in range(conn.shape[1]):
                for i in range(3):
                    f = w * (
                        stress[e, q, i, 0] * grad[a, 0]
                        + stress[e, q, i, 1] * grad[a, 1]
                        + stress[e, q, i, 2] * grad[a, 2]
                    )
                    out[conn[e, a], i] += f
                    magnitude[conn[e, a], i] += abs(f)


@njit(cache=True)
def add_volumetric_force(g, Np, pressures, weight, out):  # type: ignore[no-untyped-def]
    """out (n_p,) += integral Np g."""
    for e in range(pressures.shape[0]):
        for q in range(Np.shape[0]):
            v = weight[e, q] * g[e, q]
            for a in range(pressures.shape[1]):
                out[pressures[e, a]] += v * Np[q, a]


@njit(cache=True)
def pressure_at_points(p, Np, pressures, out):  # type: ignore[no-untyped-def]
    """out (m, q) = interpolated pressure."""
    for e in range(pressures.shape[0]):
        for q in range(Np.shape[0]):
            v = 0.0
            for a in range(pressures.shape[1]):
                v += p[pressures[e, a]] * Np[q, a]
            out[e, q] = v


@njit(cache=True)
def add_displacement_block(A, dN, inverse, weight, blocks):  # type: ignore[no-untyped-def]
    """blocks (m, d, d) upper part of the displacement rows += B^T A B, unknown order node-major (a, i); A (m, q, 9, 9)."""
    k = dN.shape[1]
    grad = np.empty((k, 3))
    AB = np.empty((3, 3, k, 3))  # A_iJ,lL dN_b,L as [i, l, b, J]
    for e in range(A.shape[0]):
        for q in range(dN.shape[0]):
            spatial_gradients(dN, inverse, e, q, grad)
            w = weight[e, q]
            for i in range(3):
                for m in range(3):
                    for b in range(k):
                        for J in range(3):
                            row = 3 * i + J
                            AB[i, m, b, J] = w * (
                                A[e, q, row, 3 * m] * grad[b, 0]
                                + A[e, q, row, 3 * m + 1] * grad[b, 1]
                                + A[e, q, row, 3 * m + 2] * grad[b, 2]
                            )
            for a in range(k):
                for b in range(a, k):
                    for i in range(3):
                        for m in range(3):
                            blocks[e, 3 * a + i, 3 * b + m] += (
                                grad[a, 0] * AB[i, m, b, 0] + grad[a, 1] * AB[i, m, b, 1] + grad[a, 2] * AB[i, m, b, 2]
                            )


@njit(cache=True)
def add_coupling_block(G, Np, dN, inverse, weight, blocks):  # type: ignore[no-untyped-def]
    """Displacement-pressure columns of blocks (m, d + np, d + np) += integral dg/dF : dN/dX Np."""
    k = dN.shape[1]
    grad = np.empty((k, 3))
    for e in range(G.shape[0]):
        for q in range(dN.shape[0]):
            spatial_gradients(dN, inverse, e, q, grad)
            for a in range(k):
                for i in range(3):
                    v = weight[e, q] * (
                        G[e, q, i, 0] * grad[a, 0] + G[e, q, i, 1] * grad[a, 1] + G[e, q, i, 2] * grad[a, 2]
                    )
                    for c in range(Np.shape[1]):
                        blocks[e, 3 * a + i, 3 * k + c] += v * Np[q, c]


@njit(cache=True)
def smallest_determinant(F, needed):  # type: ignore[no-untyped-def]
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
