"""Stiffness of each region for result.json."""

from __future__ import annotations

import numpy as np

from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.identify.mu_split import with_split
from palpate.core.identify.result_record import RegionRecord
from palpate.core.inference.posterior import Posterior

# Distance from a bound, in ln G, below which a stiffness is reported as at the bound.
AT_BOUND = 0.02
# Probabilities of the quantiles that are written down.
PROBABILITIES = np.arange(1, 40) / 40.0


def parameter_facts(
    names: tuple[str, ...], parameters: StiffnessParameters, posterior: Posterior
) -> dict[str, RegionRecord]:
    """Records by region name, from the posterior of all of theta; its mean is the identified value."""
    of_G = posterior.of(parameters.stiffness)
    G, mu = parameters.shear_moduli(posterior.mean), parameters.mu(posterior.mean)
    sd, interval = of_G.sd_kpa(), of_G.interval().tolist()
    quantiles = np.exp(of_G.quantile(PROBABILITIES[:, None]))
    low, high = of_G.bounds.T
    near = (of_G.mean < low + AT_BOUND) | (of_G.mean > high - AT_BOUND)
    records = [
        RegionRecord(
            G_kpa=float(G[k]),
            mu1_kpa=float(mu[k, 0]),
            mu2_kpa=float(mu[k, 1]),
            mu_mean_kpa=float(mu[k].mean()),
            sd_kpa=float(sd[k]),
            ci95_kpa=(interval[k][0], interval[k][1]),
            sd_ln_G=float(of_G.sd[k]),
            at_bound=bool(near[k]),
            quantiles_kpa=quantiles[:, k].tolist(),
        )
        for k in range(len(names))
    ]
    return dict(zip(names, with_split(records, parameters, posterior), strict=True))
