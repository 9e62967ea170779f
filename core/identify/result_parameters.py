"""What result.json says of each region's stiffness."""

from __future__ import annotations

from typing import Any

from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.identify.mu_split import split_facts
from palpate.core.inference.posterior import Posterior

# A stiffness this close to a bound (in ln G) is reported as at the bound.
AT_BOUND = 0.02


def parameter_facts(
    names: tuple[str, ...], parameters: StiffnessParameters, posterior: Posterior
) -> dict[str, dict[str, Any]]:
    """By region name; posterior : of all of theta, its mean the values found."""
    of_G = posterior.of(parameters.stiffness)
    G, mu = parameters.shear_moduli(posterior.mean), parameters.mu(posterior.mean)
    sd, interval, apart = of_G.sd_kpa(), of_G.interval(), split_facts(parameters, posterior)
    low, high = of_G.bounds.T
    near = (of_G.mean < low + AT_BOUND) | (of_G.mean > high - AT_BOUND)
    return {
        name: {
            "G_kpa": float(G[k]),
            "mu1_kpa": float(mu[k, 0]),
            "mu2_kpa": float(mu[k, 1]),
            "mu_mean_kpa": float(mu[k].mean()),
            "sd_kpa": float(sd[k]),
            "ci95_kpa": interval[k],
            "sd_ln_G": float(of_G.sd[k]),
            "at_bound": bool(near[k]),
            **apart[k],
        }
        for k, name in enumerate(names)
    }
