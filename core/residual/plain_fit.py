"""Fit of the plain model: stiffness with a quick element, corrected by a better one, weighed by the estimated noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.forward.composition import Composition
from palpate.core.forward.parameters import StiffnessParameters, middle
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.inference.gauss_newton import gauss_newton
from palpate.core.observe.bone_registration import BoneRegistration
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import IdentificationProblem, StateData, SurfacePair
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_error import QUICK, element_errors, scatter_mm
from palpate.core.residual.joint_states import JointLinearisation, JointModel, apart
from palpate.core.residual.linearised_model import NOTHING, PLAIN, StateModel
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.noise_estimation import NoiseGrid, fit_noise
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.remeshing import Remeshed, left_by_all
from palpate.core.residual.unknown_field import UnknownDiscrepancy
from palpate.core.residual.wall_error_bias import noise_slope
from palpate.core.worker.progress import Progress, part, silent

# Precision of ln G's prior: none to speak of.
FLAT = 1e-4


@dataclass(frozen=True, eq=False)
class PlainFit:
    """The plain model where it fits best.

    model : of all deformed states. linearisation : at the best fit of the quick element, residuals corrected. mesh (n,)
    : mm that the better element changes, the mean over all `meshes` on which it was solved (the fewest of any state), 0
    for none. on_own_mesh (n,) : the same on the case's own mesh, None where unknown. noise_slope (t,) : see
    `noise_slope`. scatter_mm : rms along the surface of one mesh about that mean in the first state, NaN for one mesh.
    noise : all sizes that it may have. sizes : estimated ones. weighting : of the data vector.
    """

    model: JointModel
    linearisation: JointLinearisation
    mesh: FloatArray
    on_own_mesh: FloatArray | None
    meshes: int
    noise_slope: FloatArray
    scatter_mm: float
    noise: NoiseGrid
    sizes: NoiseSizes
    weighting: Weighting

    @property
    def options(self) -> NoiseModelOptions:
        """Numbers of the noise model."""
        return self.noise.options

    @cached_property
    def log_evidence(self) -> float:
        """Log evidence of the plain model, averaged over the noise."""
        J = self.linearisation.in_theta
        return self.noise.log_evidence(self.linearisation.residual, J, np.full(J.shape[1], FLAT))


def fit_plain(
    pairs: Sequence[StateData],
    remeshed: Sequence[Remeshed] = (),
    progress: Progress = silent,
    options: NoiseModelOptions | None = None,
    walls: WallMotionOptions | None = None,
) -> PlainFit:
    """Raises InputError for a problem that cannot be posed, ConvergenceError when nothing can be solved.

    pairs : for each deformed state the problem and the bones. remeshed : other meshes of the same labels; the better
    element's prediction is the mean over all of them. options, walls : the program's own where none are given.
    """
    options, walls = options or NoiseModelOptions(), walls or WallMotionOptions()
    sizes = NoiseSizes.of(options)
    progress(0.0, "plain model: surfaces and distances")
    model = JointModel(
        tuple(_state_model(problem, bones, k, options, walls) for k, (problem, bones) in enumerate(pairs))
    )
    progress(0.2, "plain model: stiffness with the quick element")
    bounds = StiffnessParameters(pairs[0][0].regions, pairs[0][0].facts).bounds
    first = _solved(model, middle(bounds), None)
    noise = NoiseParts.of(first.each, model.data_vectors, options)
    weighting = Weighting(noise.covariance(sizes, np.zeros((model.n, 1))))
    linearisation = _best(model, weighting, [middle(bounds), bounds.mean(axis=1) + 0.2 * np.ptp(bounds, axis=1)], first)
    progress(0.4, "plain model: the better element")
    better = [
        element_errors(b, p, remeshed, part(progress, 0.4, 0.8))
        for b, p in zip(model.each, linearisation.each, strict=True)
    ]
    differences = [d.every for d in better]
    own = [d.own for d in better if d.own is not None]
    on_own_mesh = np.concatenate(own) if len(own) == len(better) else None
    mesh = np.concatenate([d.mean(axis=0) if len(d) else np.zeros(d.shape[1]) for d in differences])
    model, linearisation = model.corrected(mesh), linearisation.corrected(mesh)
    progress(0.8, "plain model: noise of this case's contours")
    noise = NoiseParts.of(linearisation.each, model.data_vectors, options)
    gap = UnknownDiscrepancy.around(linearisation, model.data_vectors, options)
    grid = NoiseGrid.of(
        noise, sizes, np.hstack([left_by_all(differences, sizes.mesh), _of_the_model(gap, differences, options)])
    )
    free = [apart(f) for f in zip(*(_free(data, options) for data in model.data_vectors), strict=True)]
    fitted = fit_noise(grid, linearisation.residual, linearisation.in_theta, gap.free, free)
    weighting = Weighting(fitted.covariance)
    linearisation = _best(model, weighting, [linearisation.theta], linearisation)
    progress(0.95, "plain model: what walls read wrongly do to the stiffness")
    slope = noise_slope(model, weighting, fitted.sizes, linearisation, options)
    linearisation = _solved(model, linearisation.theta, linearisation)  # lets the walls settle further
    scatter = scatter_mm(differences[0], model.first.data)
    meshes = min(map(len, differences))
    return PlainFit(model, linearisation, mesh, on_own_mesh, meshes, slope, scatter, grid, fitted.sizes, weighting)


def _state_model(
    problem: IdentificationProblem,
    bones: SurfacePair | None,
    state: int,
    options: NoiseModelOptions,
    walls: WallMotionOptions,
) -> StateModel:
    geometry = SharedGeometry.of(problem, QUICK, walls=walls)
    floor = np.repeat([options.bone_floor_mm, options.bone_floor_deg], 3)
    centre = problem.organ.rest.points.mean(axis=0)
    bone = None if bones is None else BoneRegistration.of(bones, centre, floor, options.bone_far_mm)
    data = DataVector.of(geometry.observation, bone, options)
    return StateModel(geometry, data, Composition(problem, state=state), np.zeros(data.n))


def _of_the_model(gap: UnknownDiscrepancy, differences: Sequence[FloatArray], options: NoiseModelOptions) -> FloatArray:
    """Columns (n, m) of the model's own smooth error: half of its variance common to all states, half of each state
    alone.

    Where no better element could be solved, it is larger by what that element typically changes.
    """
    unsolved = float(np.hypot(options.model, options.unsolved_mesh_mm / options.force_typical_mm))
    each = [(options.model if len(d) else unsolved) * f.response for f, d in zip(gap.each, differences, strict=True)]
    return np.sqrt(0.5) * np.hstack([np.vstack(each), apart(each)])


def _free(data: DataVector, options: NoiseModelOptions) -> list[FloatArray]:
    """Columns (n, k) of what may move a state's data besides noise and a discrepancy: an offset of the contour, the
    bones."""
    offset = options.free_offset_mm * data.wider[:, None]
    bones = np.zeros((data.n, 6))
    if data.bone is not None:
        bones[-6:] = options.free_bones * np.eye(6)
    return [offset, bones]


def _solved(model: JointModel, theta: FloatArray, near: JointLinearisation | None) -> JointLinearisation:
    linearisation = model.solve(PLAIN, theta, NOTHING, near)
    if linearisation is None:
        raise ConvergenceError(
            "the rest anatomy cannot be deformed into what the other scans show; look at the contours of bladder and "
            "rectum, or mesh more finely"
        )
    return linearisation


def _best(
    model: JointModel, weighting: Weighting, starts: list[FloatArray], near: JointLinearisation
) -> JointLinearisation:
    """Gauss-Newton from every start; the best point of all."""
    best: tuple[float, JointLinearisation] | None = None
    bounds = near.first.scene.parameters.bounds
    for start in starts:
        here = near

        def linearise(theta: FloatArray) -> tuple[FloatArray, FloatArray] | None:
            nonlocal best, here
            linearisation = model.solve(PLAIN, theta, NOTHING, here)
            if linearisation is None:
                return None
            here = linearisation
            residual = weighting.whiten(linearisation.residual)
            if best is None or residual @ residual < best[0]:
                best = float(residual @ residual), linearisation
            return residual, weighting.whiten(linearisation.in_theta)

        gauss_newton(linearise, start, bounds)
    if best is None:
        raise ConvergenceError("no start of Gauss-Newton could be solved; look at the mesh and at the contours")
    # Lets the walls settle further.
    return _solved(model, best[1].theta, best[1])
