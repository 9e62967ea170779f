"""Hierarchical model of the noise: a sum of parts whose sizes are unknown, each with a prior, and points to average over.

A part of the noise has a size and one or several correlation lengths, among which its variance is shared. The logarithm of a size is
normal about a median; shares are the softmax of normal logits. The restricted likelihood is maximised with its gradient, and a few
points are drawn from normal approximations there, each with the weight by which a sum over them is the integral over the prior (the
nested approximation of Rue, Martino & Chopin 2009, with quasi-random points instead of a grid).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp, ndtri, softmax
from scipy.stats import multivariate_normal, qmc

from palpate.core.arrays import FloatArray
from palpate.core.inference.restricted_likelihood import restricted_with_gradient

# Numerical: step of the differences of the gradient, in a prior's standard deviations; seed of the quasi-random points.
_STEP, _SEED = 1e-3, 1


@dataclass(frozen=True)
class NoisePart:
    """A part of the noise whose size is unknown. lengths : how many matrices share its variance. median : of its size; spread : standard
    deviation of the size's logarithm."""

    lengths: int
    median: float
    spread: float


@dataclass(frozen=True, eq=False)
class VarianceModel:
    """matrices (b, n, n) mm2 : of all parts of unit size, one after the other. fixed (n, n) mm2 : what is known. logit_spread : standard
    deviation of the logits by which a part's variance is shared among its lengths.

    Unknowns theta (h,) have independent standard normal priors: of each part its size, and one logit a length where it has several.
    A part that the data do not see, with matrices of zeros, stays at its median and has no unknowns.
    """

    parts: Sequence[NoisePart]
    matrices: FloatArray
    fixed: FloatArray
    logit_spread: float

    @cached_property
    def _layout(self) -> list[tuple[NoisePart, slice, slice]]:
        """Of each part its rows of `matrices` and its unknowns."""
        out, row, unknown = [], 0, 0
        for part in self.parts:
            rows = slice(row, row + part.lengths)
            seen = bool(self.matrices[rows].any())
            count = (1 + (part.lengths if part.lengths > 1 else 0)) if seen else 0
            out.append((part, rows, slice(unknown, unknown + count)))
            row, unknown = rows.stop, unknown + count
        return out

    @property
    def unknowns(self) -> int:
        """Number h of unknowns."""
        return self._layout[-1][2].stop

    def coefficients(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coefficients (b,) of the matrices, and their derivative (b, h)."""
        out, slope = np.zeros(len(self.matrices)), np.zeros((len(self.matrices), self.unknowns))
        for part, rows, at in self._layout:
            own = theta[at] if at.stop > at.start else np.zeros(1)
            share = softmax(self.logit_spread * own[1:]) if len(own) > 1 else np.full(part.lengths, 1.0 / part.lengths)
            out[rows] = part.median**2 * np.exp(2.0 * part.spread * own[0]) * share
            if at.stop > at.start:
                slope[rows, at.start] = 2.0 * part.spread * out[rows]
            if len(own) > 1:
                slope[rows, at.start + 1 : at.stop] = self.logit_spread * out[rows, None] * (np.eye(len(share)) - share)
        return out, slope

    def with_part(self, part: NoisePart, matrices: FloatArray) -> VarianceModel:
        """The same with one more part."""
        return replace(self, parts=[*self.parts, part], matrices=np.concatenate([self.matrices, matrices]))

    def log_posterior(self, theta: FloatArray, r: FloatArray, J: FloatArray) -> tuple[float, FloatArray]:
        """Log density of theta given residuals r (n,), J (n, t) projected out, up to a constant, and its gradient (h,)."""
        coefficients, slope = self.coefficients(theta)
        C = self.fixed + np.tensordot(coefficients, self.matrices, 1)
        value, gradient = restricted_with_gradient(C, self.matrices, r, J)
        return value - 0.5 * float(theta @ theta), gradient @ slope - theta

    def approximation(self, r: FloatArray, J: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean (h,) and covariance (h, h) of the normal approximation at the likeliest theta."""

        def downhill(theta: FloatArray) -> tuple[float, FloatArray]:
            value, gradient = self.log_posterior(theta, r, J)
            return -value, -gradient

        mode = minimize(downhill, np.zeros(self.unknowns), jac=True, method="L-BFGS-B").x
        steps = _STEP * np.eye(len(mode))
        rows = [(downhill(mode + s)[1] - downhill(mode - s)[1]) / (2.0 * _STEP) for s in steps]
        values, vectors = np.linalg.eigh(0.5 * (np.array(rows) + np.array(rows).T))
        # Data do not make a size less known than its prior; where the curvature says so, it is that of a flank.
        return mode, (vectors / np.maximum(values, 1.0)) @ vectors.T


def points_of(approximations: Sequence[tuple[FloatArray, FloatArray]], each: int) -> tuple[FloatArray, FloatArray]:
    """Points (g, h) from normal approximations (mean (h,), covariance (h, h)), `each` from each, and the log weights (g,) by which a sum
    of a function over them is its integral over the standard normal prior."""
    points = np.vstack([_drawn(mean, covariance, each) for mean, covariance in approximations])
    density = [multivariate_normal(mean, covariance).logpdf(points) for mean, covariance in approximations]
    mixture = logsumexp(np.atleast_2d(density), axis=0) - np.log(len(approximations))
    prior = multivariate_normal(np.zeros(points.shape[1]), np.eye(points.shape[1])).logpdf(points)
    return points, prior - mixture - np.log(len(points))


def _drawn(mean: FloatArray, covariance: FloatArray, count: int) -> FloatArray:
    uniform = qmc.Sobol(len(mean), scramble=True, rng=_SEED).random(count)
    return np.asarray(mean + ndtri(uniform) @ np.linalg.cholesky(covariance).T)
