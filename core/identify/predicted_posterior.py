"""Predicted posterior of the stiffness for a planned deformation, before any scan."""

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
    """Predicted information of one deformation.

    posterior : at the assumed stiffness, None where the deformation has no equilibrium. equilibrium : of the
    deformation. signal_mm : (t,) rms change of the organ's surface along its normal per unit of ln G of each region.
    motion_mm : rms displacement of the organ's surface. reason : why there is no equilibrium, "" otherwise.
    """

    posterior: Posterior | None
    equilibrium: Equilibrium
    signal_mm: FloatArray
    motion_mm: float
    reason: str = ""


def predict(
    problem: IdentificationProblem, theta: FloatArray, start: Equilibrium | None = None, element: str = "p2p1"
) -> Prediction:
    """Posterior of theta = ln G (t,) after a second scan with the problem's deformed walls.

    The deformed walls are the plan. The organ's deformed surface is predicted by the model; that of `problem` is
    ignored. Contour noise of organ and walls is that of the problem's facts. start : equilibrium of a smaller
    deformation on the same mesh and element. Raises InputError for a problem without a load or a support.
    """
    scene = CoupledScene(problem, SceneOptions(element=element))
    settled = scene.settle(theta, None if start is None else State(start.u, start.p))
    equilibrium = settled.equilibrium
    if not equilibrium.converged:
        return Prediction(None, equilibrium, np.full(len(theta), np.nan), np.nan, str(equilibrium.reason))
    scene.observation = SurfaceObservation.of(_as_predicted(scene, equilibrium), scene.space)
    misfit = Misfit.of(scene, wall_response(scene, equilibrium))
    sensitivities = scene.displacement_sensitivities(theta, equilibrium)
    jacobian = misfit.jacobian(equilibrium.u, sensitivities)
    noise = NoiseFacts(misfit.score_covariance(jacobian), misfit.expected)
    posterior = laplace(theta, np.zeros(len(jacobian)), jacobian, scene.parameters.bounds, noise)
    signal = scene.observation.jacobian(equilibrium.u, sensitivities)
    motion = scene.observation.operator @ equilibrium.u
    return Prediction(
        posterior,
        equilibrium,
        np.sqrt((signal**2).mean(axis=0)),
        float(np.sqrt((motion**2).sum(axis=1).mean())),
    )


def _as_predicted(scene: CoupledScene, equilibrium: Equilibrium) -> IdentificationProblem:
    """The problem with the predicted deformed surface of the organ."""
    rest = scene.problem.organ.rest
    moved = scene.space.interpolation(rest.points, scene.problem.regions) @ equilibrium.u
    deformed = rest.with_points(rest.points + moved)
    return replace(scene.problem, organ=SurfacePair(rest, deformed))
