"""Estimate of the case's own noise by restricted likelihood, and evidence of models averaged over the noise.

The covariance is the posterior mean over a grid of sizes, not that of the likeliest: a little more or less data changes
it a little, and never makes it jump from one grid point to the next.

The stiffness is projected out. What an effect or a missing force could have caused is a random effect of unknown size,
so that a discrepancy is not taken for noise; with a fixed size the noise of cases without a discrepancy would be
underestimated. The prior is what the case states, within a factor of about 1.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp, softmax

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.inference.evidence import Directions, Products, log_evidence_of
from palpate.core.residual.covariance_family import CovarianceFamily
from palpate.core.residual.image_errors import ImageErrorSizes
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.restricted_likelihood import restricted

# Sizes less probable than this, over the most probable one, are left out of the mean: a truncation.
_NEGLIGIBLE = 1e-4


@dataclass(frozen=True, eq=False)
class NoiseGrid:
    """Grid of all g sizes that the noise may have: covariances (n, n) mm2, log_prior (g,)."""

    sizes: Sequence[NoiseSizes]
    covariances: CovarianceFamily
    log_prior: FloatArray
    options: NoiseModelOptions

    @classmethod
    def of(cls, parts: NoiseParts, start: NoiseSizes, discretisation: FloatArray) -> NoiseGrid:
        """Grid over correlation lengths, shares of the long one, contour factors and errors of every mode.

        discretisation (n, m) mm : see `NoiseParts.covariance`.
        """
        options = parts.options
        sizes = [
            replace(start, length=length, long=long, contour=factor, per_mode=per_mode)
            for length in options.lengths_mm
            for long in options.long_shares
            for factor in options.contour_factors
            for per_mode in options.own_sizes_mm
        ]
        prior = np.array([_prior(s.contour, options.contour_prior) for s in sizes])
        return cls(sizes, parts.covariances(start, sizes, discretisation), prior - logsumexp(prior), options)

    @classmethod
    def known(cls, covariance: FloatArray, options: NoiseModelOptions) -> NoiseGrid:
        """The one point of a noise whose covariance (n, n) is known."""
        return cls([NoiseSizes.of(options)], CovarianceFamily.one(covariance), np.zeros(1), options)

    def log_likelihood(self, r: FloatArray, J: FloatArray, more: FloatArray) -> FloatArray:
        """Restricted log likelihood (g,) of residuals r (n,), J (n, t) projected out; more (n, n) : a further
        covariance."""
        return np.array([restricted(C + more, r, J) for C in self.covariances])

    def probable(self, r: FloatArray, J: FloatArray, gap: FloatArray, most: int) -> NoiseGrid:
        """The most probable sizes, with a discrepancy gap (n, k) of any size or without one; at most `most` of them."""
        if len(self.sizes) <= most:
            return self
        none = np.zeros((len(r), len(r)))
        without, *others = (
            self.log_likelihood(r, J, none if not g else g**2 * gap @ gap.T) for g in self.options.gap_sizes
        )
        weight = softmax(without + self.log_prior) + softmax(logsumexp(others, axis=0) + self.log_prior)
        kept = np.sort(np.argsort(-weight, kind="stable")[:most])
        prior = self.log_prior[kept]
        covariances = self.covariances.only(kept)
        return NoiseGrid([self.sizes[k] for k in kept], covariances, prior - logsumexp(prior), self.options)

    def log_evidence(
        self,
        r: FloatArray,
        J: FloatArray,
        precision: FloatArray,
        added: Sequence[Directions],
        free: BoolArray | None = None,
    ) -> FloatArray:
        """Log evidence (v, d) of v hypotheses for residuals r (n, d), averaged over all sizes of the noise.

        J (n, t), precision (t,), added, free : see `evidence.log_evidence`, in mm. Every hypothesis has the same r and J.
        """
        d, t = r.shape[1], J.shape[1]
        columns = np.hstack([r, J, *(one.S for one in added)])
        ends = np.cumsum([t, *(one.S.shape[1] for one in added)])
        each = [np.concatenate([np.arange(t), np.arange(a, b)]) for a, b in pairwise(ends)]
        total = np.full((len(added), d), -np.inf)
        for C, log_prior in zip(self.covariances, self.log_prior, strict=True):
            L = np.linalg.cholesky(C)
            white = solve_triangular(L, columns, lower=True, check_finite=False)
            products = Products.of(white[:, :d], white[:, d:])
            noise = float(log_prior) - float(np.log(np.diag(L)).sum())
            for k, (one, own) in enumerate(zip(added, each, strict=True)):
                here = log_evidence_of(products.only(own), precision, one, free)
                total[k] = np.logaddexp(total[k], here + noise)
        return total


@dataclass(frozen=True, eq=False)
class FittedNoise:
    """Posterior of the noise. sizes : root mean squares of the standard deviations. covariance : (n, n) mm2, mean."""

    sizes: NoiseSizes
    covariance: FloatArray


def fit_noise(
    grid: NoiseGrid, r: FloatArray, J: FloatArray, gap: FloatArray, free: Sequence[FloatArray]
) -> FittedNoise:
    """Posterior by the restricted likelihood.

    r (n,), J (n, t) : residual and its derivative in ln G. gap : (n, k) responses to unit normal amplitudes, of unknown
    size. free : the same of known size.
    """
    fixed = sum((S @ S.T for S in free), np.zeros((len(r), len(r))))
    logs = np.stack([grid.log_likelihood(r, J, fixed + size**2 * gap @ gap.T) for size in grid.options.gap_sizes])
    weight = np.exp(logsumexp(logs, axis=0) + grid.log_prior - logsumexp(logs + grid.log_prior))
    likely = weight > _NEGLIGIBLE * weight.max()
    covariance = grid.covariances.mean(np.where(likely, weight, 0.0) / weight[likely].sum())
    contour, per_mode = (
        float(np.sqrt(weight @ np.square([getattr(s, k) for s in grid.sizes]))) for k in ("contour", "per_mode")
    )
    length, long = (float(weight @ np.array([getattr(s, k) for s in grid.sizes])) for k in ("length", "long"))
    return FittedNoise(replace(grid.sizes[0], contour=contour, per_mode=per_mode, length=length, long=long), covariance)


def fit_image_errors(
    parts: NoiseParts,
    start: NoiseSizes,
    discretisation: FloatArray,
    r: FloatArray,
    J: FloatArray,
    gap: FloatArray,
    free: Sequence[FloatArray],
) -> ImageErrorSizes:
    """Sizes of what the model errs by where images show the motion, by the restricted likelihood; those of `start` where no
    state has matched motion.

    discretisation (n, m) mm : see `NoiseParts.covariance`. r, J, gap, free : see `fit_noise`. The covariance is the mean over
    the grid, lengths included: where the data hardly tell them apart, the likeliest one hangs on the last digits.
    """
    if not parts.image.any:
        return start.image
    options = parts.options
    tried = [
        ImageErrorSizes(edge, ((length, local),))
        for edge in options.edge_sizes_mm
        for local in options.local_sizes_mm
        for length in options.local_lengths_mm
    ]
    fixed = parts.covariance(start, discretisation) - parts.image.covariance(start.image)
    fixed = fixed + sum((S @ S.T for S in free), np.zeros_like(fixed))
    others = [fixed + size**2 * gap @ gap.T for size in options.gap_sizes]
    logs = [logsumexp([restricted(C + parts.image.covariance(s), r, J) for C in others]) for s in tried]
    return ImageErrorSizes.mean(tried, softmax(np.array(logs)))


def _prior(factor: float, sd: float) -> float:
    """Log density of the contours' factor, whose logarithm is normal with this standard deviation."""
    return float(-0.5 * (np.log(factor) / sd) ** 2 - np.log(factor))
