"""How much the data favour a model: score tests and marginal likelihoods with the stiffness projected out.

Everything here is in whitened coordinates: r (n,) residual, J (n, t) derivative in ln G, S (n, k) derivative in phi.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Score:
    """Score test of one variant. statistic and p_value of T; estimate (k,) of phi, its covariance, log_evidence against phi = 0."""

    statistic: float
    p_value: float
    estimate: FloatArray
    covariance: FloatArray
    log_evidence: float


def projected(J: FloatArray, x: FloatArray) -> FloatArray:
    """x (n,) or (n, k) without what changes of stiffness J (n, t) can explain."""
    U, s, _ = np.linalg.svd(J, full_matrices=False)
    U = U[:, s > 1e-9 * max(float(s[0]), 1e-30)] if len(s) and s[0] > 1e-9 else U[:, :0]
    return x - U @ (U.T @ x)


def score(r: FloatArray, J: FloatArray, S: FloatArray, scales: FloatArray) -> Score:
    """Score test and evidence of S under a normal prior of standard deviations `scales` (k,).

    T = (S'Mr)' (S'MS)^-1 (S'Mr) is chi-squared with as many degrees of freedom as S has independent columns.
    """
    rp, Sp = projected(J, r), projected(J, S)
    b, A = Sp.T @ rp, Sp.T @ Sp
    values, vectors = np.linalg.eigh(A)
    seen = values > 1e-9 * max(values[-1], 1e-30)
    statistic = float(((vectors[:, seen].T @ b) ** 2 / values[seen]).sum())
    covariance = np.asarray(np.linalg.inv(A + np.diag(1.0 / scales**2)), dtype=np.float64)
    estimate = -covariance @ b
    _, logdet = np.linalg.slogdet(np.eye(len(scales)) + A * scales**2)
    log_evidence = 0.5 * float(b @ covariance @ b) - 0.5 * float(logdet)
    return Score(
        statistic, float(stats.chi2.sf(statistic, max(int(seen.sum()), 1))), estimate, covariance, log_evidence
    )


def mean_of_exponentials(logs: FloatArray) -> float:
    """ln of the mean of exp(logs): the evidence of an effect that may be at any of several places."""
    top = float(np.max(logs))
    return top + float(np.log(np.mean(np.exp(np.asarray(logs) - top))))


def explained(r: FloatArray, J: FloatArray) -> float:
    """r'Mr: the gap statistic Q, chi-squared with n - t degrees of freedom under the plain model."""
    rp = projected(J, r)
    return float(rp @ rp)
