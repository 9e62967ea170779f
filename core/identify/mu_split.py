"""Posterior of mu1 and mu2 of a region from that of its G and of the share mu1 / (mu1 + mu2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace
from scipy import stats

from palpate.core.arrays import FloatArray
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.identify.result_record import RegionRecord
from palpate.core.inference.posterior import Posterior, unknown

# Number of quantiles of G and of the share from which an interval is computed.
_GRID = 81


def separable(parameters: StiffnessParameters, posterior: Posterior) -> bool:
    """Whether the data identify mu1 and mu2 separately in at least one region."""
    return parameters.split_mu and bool((~unknown(posterior.of(parameters.shares))).any())


def with_split(
    records: Sequence[RegionRecord], parameters: StiffnessParameters, posterior: Posterior
) -> list[RegionRecord]:
    """Records of the regions with shares and intervals of mu1 and mu2; unchanged where the two were not identified
    separately.
    """
    if not parameters.split_mu:
        return list(records)
    shares = posterior.of(parameters.shares)
    rows = []
    for k, (ends, blind) in enumerate(zip(shares.ends().tolist(), unknown(shares), strict=True)):
        mu1, mu2 = _mu_intervals(posterior.of(slice(2 * k, 2 * k + 2))).tolist()
        rows.append(
            replace(
                records[k],
                mu1_share=float(shares.mean[k]),
                mu1_share_ci95=(ends[0], ends[1]),
                mu1_ci95_kpa=(mu1[0], mu1[1]),
                mu2_ci95_kpa=(mu2[0], mu2[1]),
                mu1_mu2_separable=not blind,
            )
        )
    return rows


def _mu_intervals(pair: Posterior, level: float = 0.95) -> FloatArray:
    """(2, 2) kPa, intervals of mu1 and mu2 from the posterior of (ln G, share). Each marginal is truncated at its
    bounds; a Gaussian copula joins them.
    """
    z = stats.norm.ppf((np.arange(_GRID) + 0.5) / _GRID)
    a, b = (axis.ravel() for axis in np.meshgrid(z, z, indexing="ij"))
    rho = pair.covariance[0, 1] / np.sqrt(pair.covariance[0, 0] * pair.covariance[1, 1])
    # Truncation of each marginal by itself: the interval of G must not widen with shares outside their bounds.
    ln_G = pair.of(slice(0, 1)).quantile(stats.norm.cdf(a)[:, None])[:, 0]
    share = pair.of(slice(1, 2)).quantile(stats.norm.cdf(rho * a + np.sqrt(1.0 - rho**2) * b)[:, None])[:, 0]
    mu = 0.5 * np.exp(ln_G) * np.stack([share, 1.0 - share])
    ends = np.quantile(mu, [0.5 * (1.0 - level), 0.5 * (1.0 + level)], axis=1).T
    optimum = 0.5 * np.exp(pair.mean[0]) * np.array([pair.mean[1], 1.0 - pair.mean[1]])
    return np.stack([np.minimum(ends[:, 0], optimum), np.maximum(ends[:, 1], optimum)], axis=1)
