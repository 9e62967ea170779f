"""The answer for a pair that deforms nothing: the stiffness that was allowed before, and no more."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.identify.misfit_figures import misfit_figures
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.parameters import StiffnessParameters
from palpate.core.identify.posterior import Posterior, laplace
from palpate.core.identify.rigid_pair import RigidPair
from palpate.core.observe.surface_observation import sample_surface
from palpate.core.problem import IdentificationProblem

FloatArray = NDArray[np.float64]


def prior_of(problem: IdentificationProblem) -> Posterior:
    """What was allowed, as the posterior of data that say nothing."""
    bounds = StiffnessParameters(problem.regions, problem.facts).bounds  # of G alone: nothing says more of mu1 and mu2
    return laplace(bounds.mean(axis=1), np.zeros(1), np.zeros((1, len(bounds))), bounds)


def nothing_found(
    problem: IdentificationProblem, pair: RigidPair, options: IdentifyOptions, seconds: float
) -> tuple[dict[str, Any], dict[str, NDArray[np.generic]]]:
    """result.json without versions and inputs, and fields.npz, of a pair that `rigid_pair` explains: nothing is solved.

    seconds : spent so far.
    """
    prior = prior_of(problem)
    names = [problem.region_names[r] for r in problem.regions]
    result = {
        "parameters": {name: _allowed(prior, k) for k, name in enumerate(names)},
        "identifiability": {
            "singular_values": [0.0] * len(names),
            "mu1_mu2_separable": False,
            "verdict": f"nothing can be identified: {pair.in_words}; "
            "the stiffness given is the middle of what was allowed, its interval the whole of it",
        },
        "misfit": _misfit(problem, pair),
        "solver": {"forward_solves": 0, "newton_iterations": 0, "failed": 0, "seconds": round(seconds, 2)},
        "method": options.method,
        "boundary": options.boundary,
        "seed": options.seed,
        "options": asdict(options),
        "convergence": [],
        "notes": [f"nothing was searched for: {pair.in_words}"],
    }
    return result, _fields(problem, pair, prior)


def _allowed(prior: Posterior, k: int) -> dict[str, Any]:
    G = float(np.exp(prior.mean[k]))
    return {
        "G_kpa": G,
        "mu1_kpa": 0.25 * G,
        "mu2_kpa": 0.25 * G,
        "mu_mean_kpa": 0.25 * G,
        "sd_kpa": prior.sd_kpa()[k],
        "ci95_kpa": prior.interval()[k],
        "sd_ln_G": prior.sd[k],
        "at_bound": False,
    }


def _misfit(problem: IdentificationProblem, pair: RigidPair) -> dict[str, Any]:
    """Eqs 10 to 13 after the rigid motion."""
    points, _, region, _ = sample_surface(problem.organ.rest, 2.0)
    figures = misfit_figures(problem, points, region, pair.moved(points))
    return {**figures, "expected_noise_rms_mm": pair.expected_mm["organ"]}


def _fields(problem: IdentificationProblem, pair: RigidPair, prior: Posterior) -> dict[str, NDArray[np.generic]]:
    points, _, region, _ = sample_surface(problem.organ.rest, 2.0)
    return {
        "mesh_displacement": pair.moved(problem.mesh.points) - problem.mesh.points,
        "surface_points": points,
        "surface_displacement": pair.moved(points) - points,
        "surface_region": region,
        "theta": prior.mean,
        "covariance": prior.covariance,
    }
