"""The case's own noise: how wide and how long its contours wander, by restricted likelihood; and models' evidence whatever it is.

The covariance is the mean over all sizes that the likelihood allows, not that of the likeliest: a little more or less data then
changes it a little, and never makes it jump from one grid point to the next.

Whatever an effect or a missing force could have caused is let free as a random effect, so that a gap is not taken for noise; the
stiffness is projected out. How large it is, is not known either: one size of it, and the noise of every case without a gap would be
taken for smaller than it is, to make room. The prior is what the case states, to a factor of about 1.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp, softmax

from palpate.core.arrays import FloatArray
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.noise_model_options import NoiseModelOptions

# Sizes less probable than this, over the most probable one, are left out of the mean: a truncation.
_NEGLIGIBLE = 1e-4
# Precision of ln G's prior: none to speak of, so that a pair that tells nothing of the stiffness does not divide by zero.
FLAT = 1e-3


@dataclass(frozen=True, eq=False)
class NoiseGrid:
    """All sizes that noise may have: covariances (g, n, n) mm2, log_prior (g,)."""

    sizes: Sequence[NoiseSizes]
    covariances: FloatArray
    log_prior: FloatArray
    options: NoiseModelOptions

    @classmethod
    def of(cls, parts: NoiseParts, start: NoiseSizes, left: FloatArray) -> NoiseGrid:
        """left : see `NoiseParts.covariance`."""
        options = parts.options
        sizes = [
            replace(start, length=length, contour=factor, own=own)
            for length in options.lengths_mm
            for factor in options.contour_factors
            for own in options.own_sizes_mm
        ]
        prior = np.array([_prior(s.contour, options.contour_prior) for s in sizes])
        return cls(sizes, np.stack([parts.covariance(s, left) for s in sizes]), prior - logsumexp(prior), options)

    def log_likelihood(self, r: FloatArray, J: FloatArray, more: FloatArray) -> FloatArray:
        """(g,) restricted likelihood of residuals r (n,), stiffness J (n, t) projected out, with a further covariance (n, n)."""
        return np.array([_restricted(C + more, r, J) for C in self.covariances])

    def probable(self, r: FloatArray, J: FloatArray, gap: FloatArray, most: int) -> NoiseGrid:
        """The sizes that are most probable with a gap (n, k) of any size or without one, as many as `most`."""
        if len(self.sizes) <= most:
            return self
        none = np.zeros((len(r), len(r)))
        without, *others = (
            self.log_likelihood(r, J, none if not g else g**2 * gap @ gap.T) for g in self.options.gap_sizes
        )
        weight = softmax(without + self.log_prior) + softmax(logsumexp(others, axis=0) + self.log_prior)
        kept = np.sort(np.argsort(-weight, kind="stable")[:most])
        prior = self.log_prior[kept]
        return NoiseGrid([self.sizes[k] for k in kept], self.covariances[kept], prior - logsumexp(prior), self.options)

    def log_evidence(self, r: FloatArray, J: FloatArray, precision: FloatArray) -> float:
        """Laplace's, averaged over all sizes: each model may have the noise that suits it.

        r (n,) where the model fits best, J (n, k) in its parameters, precision (k,) of their priors. Not refitted for each noise: a
        model bent far from its best fit is not the line that J says.
        """
        return float(logsumexp([_laplace(C, r, J, precision) for C in self.covariances] + self.log_prior))


@dataclass(frozen=True, eq=False)
class FittedNoise:
    """sizes : posterior means (root mean squares of standard deviations). covariance : (n, n) mm2, its posterior mean."""

    sizes: NoiseSizes
    covariance: FloatArray


def fit_noise(
    grid: NoiseGrid, r: FloatArray, J: FloatArray, gap: FloatArray, free: Sequence[FloatArray]
) -> FittedNoise:
    """By the restricted likelihood; gap, free : (n, k) responses to unit normal amplitudes, gap of unknown size."""
    fixed = sum((S @ S.T for S in free), np.zeros((len(r), len(r))))
    logs = np.stack([grid.log_likelihood(r, J, fixed + size**2 * gap @ gap.T) for size in grid.options.gap_sizes])
    weight = np.exp(logsumexp(logs, axis=0) + grid.log_prior - logsumexp(logs + grid.log_prior))
    likely = weight > _NEGLIGIBLE * weight.max()
    covariance = np.tensordot(weight[likely], grid.covariances[likely], 1) / weight[likely].sum()
    contour, own = (float(np.sqrt(weight @ np.square([getattr(s, k) for s in grid.sizes]))) for k in ("contour", "own"))
    length = float(weight @ np.array([s.length for s in grid.sizes]))
    return FittedNoise(replace(grid.sizes[0], contour=contour, own=own, length=length), covariance)


def _prior(factor: float, sd: float) -> float:
    """ln of the density of the contours' factor, whose logarithm is normal."""
    return float(-0.5 * (np.log(factor) / sd) ** 2 - np.log(factor))


def _laplace(C: FloatArray, r: FloatArray, J: FloatArray, precision: FloatArray) -> float:
    """ln of the likelihood times the posterior's volume."""
    L = np.linalg.cholesky(C)
    both = np.linalg.solve(L, np.column_stack([r, J]))
    rw, Jw = both[:, 0], both[:, 1:]
    volume = -0.5 * float(np.linalg.slogdet(Jw.T @ Jw + np.diag(precision))[1])
    return -0.5 * float(rw @ rw) - float(np.log(np.diag(L)).sum()) + volume


def _restricted(C: FloatArray, r: FloatArray, J: FloatArray) -> float:
    """ln of the restricted likelihood."""
    L = np.linalg.cholesky(C)
    both = np.linalg.solve(L, np.column_stack([r, J]))
    rw, Jw = both[:, 0], both[:, 1:]
    A = Jw.T @ Jw + FLAT * np.eye(J.shape[1])  # a pair that tells nothing of the stiffness must not divide by zero
    b = Jw.T @ rw
    Q = float(rw @ rw - b @ np.linalg.solve(A, b))
    return -0.5 * Q - float(np.log(np.diag(L)).sum()) - 0.5 * float(np.linalg.slogdet(A)[1])
