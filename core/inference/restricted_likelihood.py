"""Restricted likelihood of a covariance: the stiffness is projected out (Patterson & Thompson 1971)."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve, lapack, solve_triangular

from palpate.core.arrays import FloatArray

# Precision of ln G's prior: none to speak of, so that a pair that tells nothing of the stiffness does not divide by
# zero.
FLAT = 1e-3


def restricted(C: FloatArray, r: FloatArray, J: FloatArray) -> float:
    """Log of the restricted likelihood of residuals r (n,) with covariance C (n, n), J (n, t) projected out."""
    L = np.linalg.cholesky(C)
    both = solve_triangular(L, np.column_stack([r, J]), lower=True, check_finite=False)
    rw, Jw = both[:, 0], both[:, 1:]
    A = Jw.T @ Jw + FLAT * np.eye(J.shape[1])
    b = Jw.T @ rw
    Q = float(rw @ rw - b @ np.linalg.solve(A, b))
    return -0.5 * Q - float(np.log(np.diag(L)).sum()) - 0.5 * float(np.linalg.slogdet(A)[1])


def restricted_with_gradient(
    C: FloatArray, matrices: FloatArray, r: FloatArray, J: FloatArray
) -> tuple[float, FloatArray]:
    """The same, and its derivative (b,) in the coefficients of matrices (b, n, n) of which C is a sum."""
    factor = cho_factor(C, lower=True)
    WJ = cho_solve(factor, J)
    A = J.T @ WJ + FLAT * np.eye(J.shape[1])
    inverse, _ = lapack.dpotri(factor[0], lower=1)
    P = np.tril(inverse) + np.tril(inverse, -1).T - WJ @ np.linalg.solve(A, WJ.T)
    left = P @ r
    value = -0.5 * float(r @ left) - float(np.log(np.diag(factor[0])).sum()) - 0.5 * float(np.linalg.slogdet(A)[1])
    fits = np.einsum("i,bij,j->b", left, matrices, left, optimize=True)
    return value, 0.5 * (fits - matrices.reshape(len(matrices), -1) @ P.ravel())
