"""What a deformation would tell before anybody has scanned it: the spread of the stiffness that its contours would leave."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.state import State
from palpate.core.forward.coupled_scene import CoupledScene, SceneOptions
from palpate.core.identify.misfit import Misfit, wall_response
from palpate.core.inference.posterior import NoiseFacts, Posterior, laplace
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.problem import IdentificationProblem, SurfacePair


@dataclass(frozen=True, eq=False)
class Prediction:
    """posterior : at the assumed stiffness; None where the deformation has no equilibrium, and then `reason` says why.

    equilibrium : of that deformation. signal_mm (t,) : rms change of the organ's surface along its normal when a region's G
    grows e-fold. motion_mm : rms displacement of the organ's surface.
    """

    posterior: Posterior | None
    equilibrium: Equilibrium
    signal_mm: FloatArray
    motion_mm: float
    reason: str = ""


def predict(
    problem: IdentificationProblem, theta: FloatArray, start: Equilibrium | None = None, element: str = "p2p1"
) -> Prediction:
    """The posterior of theta = ln G (t,) that a second scan with the problem's deformed walls would leave.

    The walls' deformed surfaces are what is planned; the organ's deformed surface is predicted, the one of `problem` is
    not looked at. Contours are taken to err as the problem's facts say, organ and walls alike. start : equilibrium of a
    smaller deformation on the same mesh and element.

    Raises InputError for a problem that nothing drives or holds.
    """
    scene = CoupledScene(problem, SceneOptions(element=element))
    settled = scene.settle(theta, None if start is None else State(start.u, start.p))
    found = settled.equilibrium
    if not found.converged:
        return Prediction(None, found, np.full(len(theta), np.nan), np.nan, str(found.reason))
    scene.observation = SurfaceObservation.of(_as_predicted(scene, found), scene.space)
    misfit = Misfit.of(scene, wall_response(scene, found))
    sensitivities = scene.displacement_sensitivities(theta, found)
    jacobian = misfit.jacobian(found.u, sensitivities)
    noise = NoiseFacts(misfit.score_covariance(jacobian), misfit.expected)
    posterior = laplace(theta, np.zeros(len(jacobian)), jacobian, scene.parameters.bounds, noise)
    signal = scene.observation.jacobian(found.u, sensitivities)
    motion = scene.observation.operator @ found.u
    return Prediction(
        posterior,
        found,
        np.sqrt((signal**2).mean(axis=0)),
        float(np.sqrt((motion**2).sum(axis=1).mean())),
    )


def _as_predicted(scene: CoupledScene, found: Equilibrium) -> IdentificationProblem:
    """The problem with the organ's deformed surface where the model says it goes."""
    rest = scene.problem.organ.rest
    moved = scene.space.interpolation(rest.points, scene.problem.regions) @ found.u
    deformed = rest.with_points(rest.points + moved)
    return replace(scene.problem, organ=SurfacePair(rest, deformed))
