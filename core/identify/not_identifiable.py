"""Result for a pair of scans without information on stiffness: posterior equal to the prior."""

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
from palpate.core.inference.posterior import NOTHING, Posterior, flat
from palpate.core.problem import IdentificationProblem


def prior_of(problem: IdentificationProblem) -> Posterior:
    """Prior of ln G as a `Posterior`: the result of data without information."""
    # Of G alone: mu1 and mu2 have no prior of their own here.
    return flat(StiffnessParameters(problem.regions, problem.facts).bounds)


def nothing_found(
    problem: IdentificationProblem, no_information: NoInformation, options: IdentifyOptions, seconds: float
) -> tuple[IdentificationRecord, dict[str, NDArray[np.generic]]]:
    """result.json without versions and inputs, and the arrays of fields.npz, for a pair without information on
    stiffness.

    no_information : the reason and the motion of the organ. seconds : wall-clock time spent so far.
    """
    prior = prior_of(problem)
    names = tuple(problem.region_names[r] for r in problem.regions)
    result = IdentificationRecord(
        parameters=parameter_facts(names, StiffnessParameters(problem.regions, problem.facts), prior),
        identifiability=IdentifiabilityRecord(
            singular_values=[0.0] * len(names),
            mu1_mu2_separable=False,
            verdict=f"{NOTHING}: {no_information.in_words}; "
            "the stiffness given is the middle of what was allowed, its interval the whole of it",
        ),
        misfit=_misfit(problem, no_information),
        solver=SolverRecord(forward_solves=0, newton_iterations=0, failed=0, seconds=round(seconds, 2)),
        method=options.method,
        boundary=options.boundary,
        seed=options.seed,
        options=options,
        notes=[f"nothing was searched for: {no_information.in_words}", *no_information.notes],
        landmarks=UNSET if no_information.landmarks is None else dict(no_information.landmarks),
    )
    return result, _fields(no_information, prior)


def _misfit(problem: IdentificationProblem, no_information: NoInformation) -> MisfitRecord:
    """Misfit after the motion of the organ (Eqs 10 to 13 of Yang & Lin)."""
    figures = misfit_figures(
        problem, no_information.points, no_information.region, no_information.points + no_information.displacement
    )
    return replace(figures, expected_noise_rms_mm=no_information.expected_mm)


def _fields(no_information: NoInformation, prior: Posterior) -> dict[str, NDArray[np.generic]]:
    return {
        "mesh_displacement": no_information.mesh_displacement,
        "surface_points": no_information.points,
        "surface_displacement": no_information.displacement,
        "surface_region": no_information.region,
        "theta": prior.mean,
        "covariance": prior.covariance,
    }
