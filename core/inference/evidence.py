"""Evidence for a model: its marginal likelihood, and score tests with the stiffness projected out.

Everything here is in whitened coordinates: r (n,) residual, J (n, t) derivative in ln G, S (n, k) derivative in phi.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.linalg import cho_factor, cho_solve
from scipy.special import log_ndtr, logsumexp

from palpate.core.arrays import BoolArray, FloatArray, IntArray

# Bounds farther from 0 than so many of the prior's standard deviations cut off nothing.
_FAR = 3.0


@dataclass(frozen=True, eq=False)
class Directions:
    """What a hypothesis adds to a model, linear about phi (k,): S (n, k) derivative of the data; scales (k,) standard deviations of phi's
    prior around 0, bounds (k, 2) of phi."""

    S: FloatArray
    scales: FloatArray
    bounds: FloatArray
    phi: FloatArray

    @classmethod
    def at_zero(cls, S: FloatArray, scales: FloatArray, bounds: FloatArray | None = None) -> Directions:
        """At phi = 0. bounds : none where they are not given."""
        anywhere = np.tile([-np.inf, np.inf], (len(scales), 1))
        return cls(S, scales, anywhere if bounds is None else bounds, np.zeros(len(scales)))

    @classmethod
    def none(cls, n: int) -> Directions:
        """Nothing, for n data."""
        return cls.at_zero(np.zeros((n, 0)), np.zeros(0))


@dataclass(frozen=True, eq=False)
class Products:
    """Scalar products of whitened data: squares (d,) of residuals r (n, d), right (p, d) = X'r and gram (p, p) = X'X, X (n, p) derivatives.
    Several hypotheses are looked at with those of all their derivatives together."""

    squares: FloatArray
    right: FloatArray
    gram: FloatArray

    @classmethod
    def of(cls, r: FloatArray, X: FloatArray) -> Products:
        """Of residuals r (n, d) and derivatives X (n, p)."""
        return cls(np.einsum("nd,nd->d", r, r), X.T @ r, X.T @ X)

    def only(self, columns: IntArray) -> Products:
        """With some of the derivatives."""
        return Products(self.squares, self.right[columns], self.gram[np.ix_(columns, columns)])


def log_evidence(
    r: FloatArray, J: FloatArray, precision: FloatArray, added: Directions, free: BoolArray | None = None
) -> FloatArray:
    """Log marginal likelihood (d,) of residuals r (n, d) of a model that is linear in all its parameters, without the noise's own terms.

    J (n, t) : derivative in ln G, whose prior is normal about the linearisation with precision (t,). added : what the hypothesis adds, S
    in the coordinates of r. free (t + k,) : parameters that are not held at a bound; the others stay where they are. Exact where the
    model is linear, for the noise that r is whitened by: a hypothesis at its optimum and one that is only looked at from the plain fit
    are weighed by the same integral.
    """
    return log_evidence_of(Products.of(r, np.hstack([J, added.S])), precision, added, free)


def log_evidence_of(
    products: Products, precision: FloatArray, added: Directions, free: BoolArray | None = None
) -> FloatArray:
    """The same from the products of r with J and S, whose columns come in this order; `added.S` is not read."""
    t, z = len(precision), added.phi / added.scales
    scale = np.concatenate([np.ones(t), added.scales])
    H = products.gram * np.outer(scale, scale) + np.diag(np.concatenate([precision, np.ones(len(z))]))
    slope = products.right * scale[:, None] + np.concatenate([np.zeros(t), z])[:, None]
    moving = np.ones(len(H), dtype=bool) if free is None else free
    step = np.zeros_like(slope)
    step[moving] = -cho_solve(cho_factor(H[np.ix_(moving, moving)], lower=True), slope[moving])
    out = -0.5 * products.squares - 0.5 * float(z @ z) - 0.5 * np.einsum("pd,pd->d", slope, step)
    out += 0.5 * float(np.log(precision).sum()) - 0.5 * float(np.linalg.slogdet(H)[1])
    if not len(z):
        return np.asarray(out)
    sd = np.sqrt(np.diag(np.linalg.inv(H))[t:])
    return np.asarray(out + _within(z[:, None] + step[t:], sd, added.bounds / added.scales[:, None]))


def _within(estimate: FloatArray, sd: FloatArray, limits: FloatArray) -> FloatArray:
    """ln (d,) of how much more of the posterior than of the prior lies within limits (k, 2), parameter by parameter.

    estimate (k, d), sd (k,) : of the posterior, in prior standard deviations.
    """
    out = np.zeros(estimate.shape[1])
    for mean, s, (low, high) in zip(estimate, sd, limits, strict=True):
        if low > -_FAR or high < _FAR:
            out += log_share((low - mean) / s, (high - mean) / s) - log_share(low, high)
    return out


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


def score(r: FloatArray, J: FloatArray, S: FloatArray, scales: FloatArray, bounds: FloatArray | None = None) -> Score:
    """Score test and evidence of S under a normal prior of standard deviations `scales` (k,), cut off at `bounds` (k, 2).

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
    if bounds is not None:
        log_evidence += allowed(estimate, np.sqrt(np.diag(covariance)), scales, bounds)
    return Score(
        statistic, float(stats.chi2.sf(statistic, max(int(seen.sum()), 1))), estimate, covariance, log_evidence
    )


def allowed(estimate: FloatArray, sd: FloatArray, scales: FloatArray, bounds: FloatArray) -> float:
    """Contribution of bounds (k, 2) to a log evidence without bounds: ln of the posterior's mass within them over the prior's.

    estimate, sd (k,) : of the posterior, normal; scales (k,) : standard deviations of the prior around 0. Parameters one by one. An
    effect with one sign only gains ln 2 where the data agree with it, and loses evidence where they do not.
    """
    posterior = log_share((bounds[:, 0] - estimate) / sd, (bounds[:, 1] - estimate) / sd)
    return float((posterior - log_share(bounds[:, 0] / scales, bounds[:, 1] / scales)).sum())


def log_share(low: FloatArray, high: FloatArray) -> FloatArray:
    """ln of the share of a standard normal distribution between low and high, far in the tails too."""
    tail = low > 0.0
    low, high = np.where(tail, -high, low), np.where(tail, -low, high)
    top = log_ndtr(high)
    return np.asarray(top + np.log1p(-np.exp(np.minimum(log_ndtr(low) - top, -1e-15))))


def mean_of_exponentials(logs: FloatArray) -> float:
    """ln of the mean of exp(logs): the evidence of an effect that may be at any of several places."""
    return float(means_of_exponentials(logs))


def means_of_exponentials(logs: Sequence[FloatArray] | FloatArray) -> FloatArray:
    """The same of each column of logs (k, ...)."""
    return np.asarray(logsumexp(logs, axis=0) - np.log(len(logs)))


def explained(r: FloatArray, J: FloatArray) -> float:
    """r'Mr: the gap statistic Q, chi-squared with n - t degrees of freedom under the plain model."""
    rp = projected(J, r)
    return float(rp @ rp)
