"""Normal distribution cut at bounds: its share within them, and its mean and covariance there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.inference.evidence import log_share

_HALF_LOG_2PI = 0.5 * float(np.log(2.0 * np.pi))


@dataclass(frozen=True, eq=False)
class Cut:
    """log_share : ln of the probability within the bounds. mean (n,), covariance (n, n) : of what lies within."""

    log_share: float
    mean: FloatArray
    covariance: FloatArray


def cut(mean: FloatArray, covariance: FloatArray, bounds: FloatArray) -> Cut:
    """Normal of this mean (n,) and covariance (n, n), its first variables held within bounds (k, 2), k at most n.

    Exact for one bounded variable. Several are cut one after the other, each time the normal with the moments of what was left
    (assumed density filtering; Minka 2001, section 3.1).
    """
    mean, covariance, share = mean.copy(), covariance.copy(), 0.0
    for k, (low, high) in enumerate(bounds):
        sd = float(np.sqrt(covariance[k, k]))
        a, b = (low - mean[k]) / sd, (high - mean[k]) / sd
        inside = float(log_share(np.array(a), np.array(b)))
        shift, shrink = _moments(float(a), float(b), inside)
        along = covariance[:, k] / sd
        mean = mean + along * shift
        covariance = covariance - (1.0 - shrink) * np.outer(along, along)
        share += inside
    return Cut(share, mean, covariance)


def _moments(a: float, b: float, inside: float) -> tuple[float, float]:
    """Mean and variance of a standard normal between a and b, whose share there is exp(inside)."""
    at_a, at_b = (_hazard(x, inside) for x in (a, b))
    mean = at_a - at_b
    variance = 1.0 + _times(a, at_a) - _times(b, at_b) - mean**2
    return mean, max(variance, 1e-9)


def _hazard(x: float, inside: float) -> float:
    return float(np.exp(-0.5 * x * x - _HALF_LOG_2PI - inside)) if np.isfinite(x) else 0.0


def _times(x: float, density: float) -> float:
    return x * density if np.isfinite(x) else 0.0
