"""The answer for a pair that tells no stiffness: the one that was allowed before, and no more."""

from __future__ import annotations

import numpy as np
from msgspec import UNSET
from msgspec.structs import replace
from numpy.typing import NDArray

from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.pair.no_information import NoInformation
from palpate.core.identify.result_misfit import misfit_figures
from palpate.core.identify.result_parameters import parameter_facts
from palpate.core.identify.result_record import (
    IdentifiabilityRecord,
    IdentificationRecord,
    MisfitRecord,
    SolverRecord,
)
from palpate.core.inference.posterior import Posterior, laplace
from palpate.core.problem import IdentificationProblem


def prior_of(problem: IdentificationProblem) -> Posterior:
    """What was allowed, as the posterior of data that say nothing."""
    bounds = StiffnessParameters(problem.regions, problem.facts).bounds  # of G alone: nothing says more of mu1 and mu2
    return laplace(bounds.mean(axis=1), np.zeros(1), np.zeros((1, len(bounds))), bounds)


def nothing_found(
    problem: IdentificationProblem, untold: NoInformation, options: IdentifyOptions, seconds: float
) -> tuple[IdentificationRecord, dict[str, NDArray[np.generic]]]:
    """result.json without versions and inputs, and fields.npz, of a pair that tells no stiffness.

    seconds : spent so far.
    """
    prior = prior_of(problem)
    names = tuple(problem.region_names[r] for r in problem.regions)
    result = IdentificationRecord(
        parameters=parameter_facts(names, StiffnessParameters(problem.regions, problem.facts), prior),
        identifiability=IdentifiabilityRecord(
            singular_values=[0.0] * len(names),
            mu1_mu2_separable=False,
            verdict=f"nothing can be identified: {untold.in_words}; "
            "the stiffness given is the middle of what was allowed, its interval the whole of it",
        ),
        misfit=_misfit(problem, untold),
        solver=SolverRecord(forward_solves=0, newton_iterations=0, failed=0, seconds=round(seconds, 2)),
        method=options.method,
        boundary=options.boundary,
        seed=options.seed,
        options=options,
        notes=[f"nothing was searched for: {untold.in_words}", *untold.notes],
        landmarks=UNSET if untold.landmarks is None else dict(untold.landmarks),
    )
    return result, _fields(untold, prior)


def _misfit(problem: IdentificationProblem, untold: NoInformation) -> MisfitRecord:
    """Eqs 10 to 13 after the motion."""
    figures = misfit_figures(problem, untold.points, untold.region, untold.points + untold.displacement)
    return replace(figures, expected_noise_rms_mm=untold.expected_mm)


def _fields(untold: NoInformation, prior: Posterior) -> dict[str, NDArray[np.generic]]:
    return {
        "mesh_displacement": untold.mesh_displacement,
        "surface_points": untold.points,
        "surface_displacement": untold.displacement,
        "surface_region": untold.region,
        "theta": prior.mean,
        "covariance": prior.covariance,
    }
