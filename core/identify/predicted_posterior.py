"""Predicted posterior of the stiffness for a planned deformation, before any scan."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.state import State
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.forward.slipping_walls import let_slip
from palpate.core.inference.posterior import Posterior, laplace
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.linearised_model import NOTHING, Linearisation
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.noise_model_options import NoiseModelOptions


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
    problem: IdentificationProblem,
    theta: FloatArray,
    start: Equilibrium | None = None,
    element: str = "p2p1",
    options: NoiseModelOptions | None = None,
) -> Prediction:
    """Posterior of theta = ln G (t,) after a second scan with the problem's deformed walls.

    The deformed walls are the plan. The organ's deformed surface is predicted by the model; that of `problem` is
    ignored. Contour noise of organ and walls is that of the problem's facts. start : equilibrium of a smaller
    deformation on the same mesh and element. options : of the noise model; the
    program's own where None. Raises InputError for a problem without a load or a support.
    """
    geometry = SharedGeometry.of(problem, element)
    let_slip(geometry)
    scene = CompositionScene(geometry, Composition(problem))
    equilibrium = scene.settle(theta, None if start is None else State(start.u, start.p)).equilibrium
    if not equilibrium.converged:
        return Prediction(None, equilibrium, np.full(len(theta), np.nan), np.nan, str(equilibrium.reason))
    scene.observation = SurfaceObservation.of(_as_predicted(scene, equilibrium), scene.space)
    options = (options or NoiseModelOptions()).for_case(problem)
    data, sensitivities = _data_of(scene, options), scene.displacement_sensitivities(theta, equilibrium)
    in_theta = data.response(scene, equilibrium.u, sensitivities)
    seen = Linearisation(theta, NOTHING, scene, equilibrium, np.zeros(data.n), in_theta, np.zeros(0))
    noise = NoiseParts.of([seen], [data], options).covariance(NoiseSizes.of(options), np.zeros((data.n, 0)))
    jacobian = Weighting(noise).whiten(in_theta)
    posterior = laplace(theta, np.zeros(data.n), jacobian, scene.parameters.bounds)
    signal = scene.observation.jacobian(equilibrium.u, sensitivities)
    motion = scene.observation.operator @ equilibrium.u
    return Prediction(
        posterior,
        equilibrium,
        np.sqrt((signal**2).mean(axis=0)),
        float(np.sqrt((motion**2).sum(axis=1).mean())),
    )


def _data_of(scene: CompositionScene, options: NoiseModelOptions) -> DataVector:
    return DataVector.of(scene.observation, None, options)


def _as_predicted(scene: CompositionScene, equilibrium: Equilibrium) -> IdentificationProblem:
    """The problem with the predicted deformed surface of the organ."""
    rest = scene.problem.organ.rest
    moved = scene.space.interpolation(rest.points, scene.problem.regions) @ equilibrium.u
    deformed = rest.with_points(rest.points + moved)
    return replace(scene.problem, organ=replace(scene.problem.organ, rest=rest, deformed=deformed))
