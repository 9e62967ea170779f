"""Estimate of the case's own noise by restricted likelihood, and evidence of models averaged over the noise.

The covariance is the posterior mean over points of the sizes (`variance_model`), not that of the likeliest: a little more or less data
changes it a little.

The stiffness is projected out. What an effect or a missing force could have caused is a random effect of unknown size,
so that a discrepancy is not taken for noise; with a fixed size the noise of cases without a discrepancy would be
underestimated. The prior is what the case states, within a factor of about 1.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.inference.evidence import Directions, Products, log_evidence_of
from palpate.core.inference.restricted_likelihood import restricted
from palpate.core.residual.covariance_family import CovarianceFamily
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.variance_model import NoisePart, points_of


@dataclass(frozen=True, eq=False)
class NoiseGrid:
    """Points g of the sizes that the noise may have: covariances (n, n) mm2, and log_prior (g,), the weights by which a sum over them is
    the integral over the prior."""

    sizes: Sequence[NoiseSizes]
    covariances: CovarianceFamily
    log_prior: FloatArray
    options: NoiseModelOptions

    @classmethod
    def of(
        cls,
        parts: NoiseParts,
        discretisation: FloatArray,
        r: FloatArray,
        J: FloatArray,
        gap: FloatArray,
    ) -> NoiseGrid:
        """Points about the likeliest sizes, with a nameless gap and without one.

        discretisation (n, m) mm : see `NoiseParts.known`. r, J, gap : see `fit_noise`.
        """
        options, start = parts.options, NoiseSizes.of(parts.options)
        model = parts.variance_model(start, discretisation)
        typical = NoisePart(1, 1.0, options.size_spread)
        mean, covariance = model.with_part(typical, (gap @ gap.T)[None]).approximation(r, J)
        h = model.unknowns
        points, log_prior = points_of([model.approximation(r, J), (mean[:h], covariance[:h, :h])], options.points)
        coefficients = np.array([model.coefficients(theta)[0] for theta in points])
        sizes = [start.with_varying(row) for row in coefficients]
        family = CovarianceFamily(
            np.concatenate([model.matrices, model.fixed[None]]), np.column_stack([coefficients, np.ones(len(points))])
        )
        return cls(sizes, family, log_prior, options)

    @classmethod
    def known(cls, covariance: FloatArray, options: NoiseModelOptions) -> NoiseGrid:
        """The one point of a noise whose covariance (n, n) is known."""
        return cls([NoiseSizes.of(options)], CovarianceFamily.one(covariance), np.zeros(1), options)

    def log_likelihood(self, r: FloatArray, J: FloatArray, more: FloatArray) -> FloatArray:
        """Restricted log likelihood (g,) of residuals r (n,), J (n, t) projected out; more (n, n) : a further
        covariance."""
        return np.array([restricted(C + more, r, J) for C in self.covariances])

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
    """Posterior of the noise. sizes : of the mean covariance. covariance : (n, n) mm2, mean."""

    sizes: NoiseSizes
    covariance: FloatArray


def fit_noise(grid: NoiseGrid, r: FloatArray, J: FloatArray, gap: FloatArray) -> FittedNoise:
    """Posterior by the restricted likelihood.

    r (n,) : residual. J (n, t) : derivative in ln G, and responses to all else that may be of any size. gap (n, k) : responses to unit
    normal amplitudes, of unknown size.
    """
    logs = np.stack([grid.log_likelihood(r, J, size**2 * gap @ gap.T) for size in grid.options.gap_sizes])
    weight = np.exp(logsumexp(logs, axis=0) + grid.log_prior - logsumexp(logs + grid.log_prior))
    varying = weight @ np.array([sizes.varying for sizes in grid.sizes])
    return FittedNoise(grid.sizes[0].with_varying(varying), grid.covariances.mean(weight))
