"""Restricted likelihood of a covariance: the stiffness is projected out."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

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
