"""Normal distribution cut at bounds: its share within them, and its mean and covariance there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from palpate.core.arrays import FloatArray
from palpate.core.inference.evidence import log_share


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
        shift, shrink = (float(moment) for moment in stats.truncnorm.stats(a, b, moments="mv"))
        along = covariance[:, k] / sd
        mean = mean + along * shift
        covariance = covariance - (1.0 - shrink) * np.outer(along, along)
        share += float(log_share(np.array(a), np.array(b)))
    return Cut(share, mean, covariance)
