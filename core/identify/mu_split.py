"""mu1 and mu2 of a region from the posterior of its G and of mu1's share of their sum."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

from palpate.core.arrays import FloatArray
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.inference.posterior import Posterior, unknown

# Quantiles along each of G and share from which an interval is read.
_GRID = 81


def separable(parameters: StiffnessParameters, posterior: Posterior) -> bool:
    """Whether the data tell mu1 from mu2 in any region."""
    return parameters.split_mu and bool((~unknown(posterior.of(parameters.shares))).any())


def split_facts(parameters: StiffnessParameters, posterior: Posterior) -> list[dict[str, Any]]:
    """What result.json says of each region's mu1 and mu2 beyond their values; empty where they were not looked for apart."""
    if not parameters.split_mu:
        return [{} for _ in parameters.regions]
    shares = posterior.of(parameters.shares)
    rows = []
    for k, (ends, untold) in enumerate(zip(shares.ends(), unknown(shares), strict=True)):
        mu = _mu_intervals(posterior.of(slice(2 * k, 2 * k + 2)))
        rows.append(
            {
                "mu1_share": shares.mean[k],
                "mu1_share_ci95": ends,
                "mu1_ci95_kpa": mu[0],
                "mu2_ci95_kpa": mu[1],
                "mu1_mu2_separable": not untold,
            }
        )
    return rows


def _mu_intervals(pair: Posterior, level: float = 0.95) -> FloatArray:
    """(2, 2) kPa, intervals of mu1 and mu2 from the posterior of (ln G, share): each cut at its bounds, joined as normals are."""
    z = stats.norm.ppf((np.arange(_GRID) + 0.5) / _GRID)
    a, b = (axis.ravel() for axis in np.meshgrid(z, z, indexing="ij"))
    rho = pair.covariance[0, 1] / np.sqrt(pair.covariance[0, 0] * pair.covariance[1, 1])
    # Each by itself: what the data say of G must not widen by all that the share could be beyond its bounds.
    ln_G = pair.of(slice(0, 1)).quantile(stats.norm.cdf(a)[:, None])[:, 0]
    share = pair.of(slice(1, 2)).quantile(stats.norm.cdf(rho * a + np.sqrt(1.0 - rho**2) * b)[:, None])[:, 0]
    mu = 0.5 * np.exp(ln_G) * np.stack([share, 1.0 - share])
    ends = np.quantile(mu, [0.5 * (1.0 - level), 0.5 * (1.0 + level)], axis=1).T
    found = 0.5 * np.exp(pair.mean[0]) * np.array([pair.mean[1], 1.0 - pair.mean[1]])
    return np.stack([np.minimum(ends[:, 0], found), np.maximum(ends[:, 1], found)], axis=1)
