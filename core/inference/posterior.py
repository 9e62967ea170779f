"""Posterior of the stiffness: Laplace's approximation in log-stiffness within the given bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from palpate.core.arrays import BoolArray, FloatArray

# Ratio of posterior to prior width above which a stiffness counts as not identified.
_BLIND = 0.7


# Share of the prior's precision that is left in the data's own, which keeps it invertible.
_LEAST = 1e-4


# Misfit over what noise leaves, as a factor on the noise, from which on a deformation is not called too small.
_FAR_ABOVE = 2.0
# Probability within one standard deviation of a normal distribution.
_ONE_SD = 0.6827
NOTHING = "nothing can be identified"
_TOO_SMALL = "the deformation this pair shows is too small against the contours' error"
_TOO_LARGE = "the model misses the second scan by far more than the contours' error"


@dataclass(frozen=True, eq=False)
class Posterior:
    """Normal in theta = ln G, cut at the bounds.

    mean (t,), covariance (t, t); singular_values (t,): 1 / value is the standard deviation of ln G along a direction that the
    data see on their own. scale : factor by which the noise was widened because the misfit exceeds what the noise explains (at least 1).
    """

    mean: FloatArray
    covariance: FloatArray
    singular_values: FloatArray
    scale: float
    bounds: FloatArray

    @property
    def sd(self) -> FloatArray:
        """(t,) standard deviation of ln G."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def spread(self) -> FloatArray:
        """(t,) standard deviation of ln G about its own mean, which need not be the optimum."""
        return self.sd

    def interval(self, level: float = 0.95) -> FloatArray:
        """(t, 2) interval of G, kPa, of the normal cut at the bounds: central, but from the bound on where the optimum lies
        at it, so that the value found is always within its own interval. Of data that say nothing it is that of the bounds.
        """
        return np.asarray(np.exp(self.ends(level)), dtype=np.float64)

    def ends(self, level: float = 0.95) -> FloatArray:
        """(t, 2) the same interval of theta itself."""
        tail = 0.5 * (1.0 - level)
        at_low, at_high = self._beyond(level)
        below = np.where(at_high, self.quantile(1.0 - level), self.quantile(tail))
        above = np.where(at_low, self.quantile(level), self.quantile(1.0 - tail))
        return np.stack(
            [np.where(at_low, self.bounds[:, 0], below), np.where(at_high, self.bounds[:, 1], above)], axis=1
        )

    def _beyond(self, level: float) -> tuple[BoolArray, BoolArray]:
        """(t,) whether the value found lies below, and above, the central interval."""
        tail = 0.5 * (1.0 - level)
        return self.mean < self.quantile(tail), self.mean > self.quantile(1.0 - tail)

    def quantile(self, probability: FloatArray | float) -> FloatArray:
        """Theta (..., t) at a probability () or (..., t), each parameter by itself, cut at its bounds."""
        sd = self._data_sd
        low, high = ((self.bounds[:, k] - self.mean) / sd for k in (0, 1))
        return np.asarray(stats.truncnorm(low, high, loc=self.mean, scale=sd).ppf(probability), dtype=np.float64)

    def of(self, rows: slice) -> Posterior:
        """Marginal of some parameters."""
        part = self.covariance[rows, rows]
        return Posterior(self.mean[rows], part, self.singular_values, self.scale, self.bounds[rows])

    @property
    def _data_sd(self) -> FloatArray:
        """(t,) standard deviation of ln G that the data alone leave: the cut at the bounds is the flat prior already."""
        prior = _flat_prior(self.bounds)
        return np.sqrt(np.diag(np.linalg.inv(np.linalg.inv(self.covariance) - (1.0 - _LEAST) * prior)))

    def sd_kpa(self) -> FloatArray:
        """(t,) kPa, half the central 68 % interval of G; where the interval starts at a bound, how far it reaches from the value found."""
        low, high = self.interval(_ONE_SD).T
        at_low, at_high = self._beyond(_ONE_SD)
        G = np.exp(self.mean)
        return np.asarray(np.where(at_low, high - G, np.where(at_high, G - low, 0.5 * (high - low))))


@dataclass(frozen=True, eq=False)
class NoiseFacts:
    """Statistics of a weighted residual r with Jacobian J under the noise.

    score_covariance : (t, t) of J' r. expected : mean of |r|^2 at the truth. Weights that are the noise's own inverse have
    J' J and the number of data.
    """

    score_covariance: FloatArray
    expected: float


def laplace(
    theta: FloatArray, residual: FloatArray, jacobian: FloatArray, bounds: FloatArray, noise: NoiseFacts | None = None
) -> Posterior:
    """Posterior at an optimum from the weighted residual (q,) and Jacobian (q, t).

    The covariance is H^-1 S H^-1 with H = J' J and S = noise.score_covariance, joined with a flat prior over the bounds.
    noise : None for weights that are the inverse of the noise's covariance. A misfit above its expectation means errors
    the noise model does not know; the covariance is widened by that ratio, as a least-squares fit would.
    """
    H = jacobian.T @ jacobian
    noise = noise or NoiseFacts(H, float(max(len(residual) - len(theta), 1)))
    scale = max(1.0, float(residual @ residual) / noise.expected)
    ridge = 1e-12 * max(float(np.trace(noise.score_covariance)), 1e-30) * np.eye(len(theta))
    information = H @ np.linalg.solve(noise.score_covariance + ridge, H)
    singular = np.sqrt(np.maximum(np.linalg.eigvalsh(0.5 * (information + information.T))[::-1], 0.0))
    # A direction the data do not see at all keeps the width of a flat prior over the bounds.
    covariance = np.asarray(np.linalg.inv(information / scale + _flat_prior(bounds)), dtype=np.float64)
    return Posterior(theta, covariance, singular, float(np.sqrt(scale)), bounds)


def flat(bounds: FloatArray) -> Posterior:
    """Posterior of data without information: as wide as a flat prior over bounds (t, 2), about its middle."""
    return laplace(bounds.mean(axis=1), np.zeros(1), np.zeros((1, len(bounds))), bounds)


def prior_precision(bounds: FloatArray) -> FloatArray:
    """Precision (t,) of a normal as wide as a flat prior over bounds (t, 2)."""
    return np.asarray(12.0 / (bounds[:, 1] - bounds[:, 0]) ** 2)


def _flat_prior(bounds: FloatArray) -> FloatArray:
    """(t, t) the same as a matrix."""
    return np.diag(prior_precision(bounds))


def unknown(posterior: Posterior) -> BoolArray:
    """(t,) whether a region's stiffness is about as uncertain as it was before the scans."""
    return as_before(posterior.spread, posterior.bounds)


def as_before(sd: FloatArray, bounds: FloatArray) -> BoolArray:
    """(t,) whether standard deviations sd (t,) of ln G are about that of a flat prior over bounds (t, 2)."""
    return np.asarray(sd > _BLIND / np.sqrt(prior_precision(bounds)))


def verdict(
    names: tuple[str, ...], posterior: Posterior, shares: Posterior | None = None, other_law: str = "", untold: str = ""
) -> str:
    """In words: which regions' stiffness this pair of scans tells, and how well.

    posterior : of ln G of each region. shares : of mu1 / (mu1 + mu2), where they were looked for. other_law : than Mooney-Rivlin.
    untold : why nothing is told, where that is not for the size of the deformation.
    """
    parts = []
    blind = unknown(posterior)
    if blind.all():
        of_deformation = _TOO_SMALL if posterior.scale < _FAR_ABOVE else _TOO_LARGE
        parts.append(f"{NOTHING}: {untold or of_deformation}")
    for name, (low, high), as_wide in zip(names, posterior.ends(), blind, strict=True):
        label, half = name.replace("_", " "), 0.5 * (high - low)
        if as_wide:
            parts.append(f"{label}: not identifiable, this pair says no more than the allowed range did")
        elif half < 0.2:
            parts.append(f"{label}: known within {100 * np.expm1(half):.0f} % (95 %)")
        else:
            parts.append(f"{label}: known within a factor of {np.exp(half):.1f} (95 %)")
    if other_law:
        parts.append(f"G is the initial shear modulus of the law {other_law}")
    elif shares is None:
        parts.append("mu1 and mu2 cannot be told apart by one pair; only G = 2 (mu1 + mu2) is identified")
    else:
        parts += _on_shares(names, shares)
    parts.append("all stiffness is relative to the assumed stiffness of the surrounding tissue")
    return "; ".join(parts)


def _on_shares(names: tuple[str, ...], shares: Posterior) -> list[str]:
    parts = []
    for name, (low, high), untold in zip(names, shares.ends(), unknown(shares), strict=True):
        label, from_to = name.replace("_", " "), f"{100 * low:.0f} to {100 * high:.0f} %"
        parts.append(
            f"{label}: mu1 and mu2 cannot be told apart, mu1 may be {from_to} of their sum; only G = 2 (mu1 + mu2) is identified"
            if untold
            else f"{label}: mu1 is {from_to} of mu1 + mu2 (95 %)"
        )
    return parts
