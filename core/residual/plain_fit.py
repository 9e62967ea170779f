"""The plain model fitted: an element that is quick looks for the stiffness, a better one says by how much that was wrong."""

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
from palpate.core.observe.bone_registration import BoneSight
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import IdentificationProblem, StateData, SurfacePair
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_error import QUICK, better_differences, scatter_mm
from palpate.core.residual.joint_states import JointLinearisation, States, apart
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

    bench : of all deformed states. point : at the quick element, residuals corrected. mesh : (n,) what
    the better element changed, the mean over all `meshes` on which it was solved (the fewest of any state), 0 for none; on_own_mesh (n,)
    the same on the case's own mesh alone, None where that is not known. noise_slope (t,) : see the function. scatter_mm : rms along the
    surface of what one mesh differs from that mean in the first state, NaN for one mesh. noise : all that it may be; sizes : of this
    case's. weighting : of the data vector.
    """

    bench: States
    point: JointLinearisation
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
        """The noise model's numbers."""
        return self.noise.options

    @cached_property
    def log_evidence(self) -> float:
        """Of the plain model, whatever the noise."""
        J = self.point.in_theta
        return self.noise.log_evidence(self.point.residual, J, np.full(J.shape[1], FLAT))


def fit_plain(
    pairs: Sequence[StateData],
    remeshed: Sequence[Remeshed] = (),
    progress: Progress = silent,
    options: NoiseModelOptions | None = None,
    walls: WallMotionOptions | None = None,
) -> PlainFit:
    """Raises InputError for a problem that cannot be posed, ConvergenceError when nothing can be solved.

    pairs : for each deformed state the problem and the bones. remeshed : other meshes of the same labels; the better element's prediction
    is the mean over all of them. options, walls : the program's own where none are given.
    """
    options, walls = options or NoiseModelOptions(), walls or WallMotionOptions()
    sizes = NoiseSizes.of(options)
    progress(0.0, "plain model: surfaces and distances")
    bench = States(tuple(_bench(problem, bones, k, options, walls) for k, (problem, bones) in enumerate(pairs)))
    progress(0.2, "plain model: stiffness with the quick element")
    bounds = StiffnessParameters(pairs[0][0].regions, pairs[0][0].facts).bounds
    first = _solved(bench, middle(bounds), None)
    noise = NoiseParts.of(first.each, bench.sights, options)
    weighting = Weighting(noise.covariance(sizes, np.zeros((bench.n, 1))))
    point = _best(bench, weighting, [middle(bounds), bounds.mean(axis=1) + 0.2 * np.ptp(bounds, axis=1)], first)
    progress(0.4, "plain model: the better element")
    better = [
        better_differences(b, p, remeshed, part(progress, 0.4, 0.8))
        for b, p in zip(bench.each, point.each, strict=True)
    ]
    differences = [d.every for d in better]
    own = [d.own for d in better if d.own is not None]
    on_own_mesh = np.concatenate(own) if len(own) == len(better) else None
    mesh = np.concatenate([d.mean(axis=0) if len(d) else np.zeros(d.shape[1]) for d in differences])
    bench, point = bench.corrected(mesh), point.corrected(mesh)
    progress(0.8, "plain model: noise of this case's contours")
    noise = NoiseParts.of(point.each, bench.sights, options)
    gap = UnknownDiscrepancy.around(point, bench.sights, options)
    grid = NoiseGrid.of(
        noise, sizes, np.hstack([left_by_all(differences, sizes.mesh), _of_the_model(gap, differences, options)])
    )
    free = [apart(f) for f in zip(*(_free(sight, options) for sight in bench.sights), strict=True)]
    fitted = fit_noise(grid, point.residual, point.in_theta, gap.free, free)
    weighting = Weighting(fitted.covariance)
    point = _best(bench, weighting, [point.theta], point)
    progress(0.95, "plain model: what walls read wrongly do to the stiffness")
    slope = noise_slope(bench, weighting, fitted.sizes, point, options)
    point = _solved(bench, point.theta, point)  # lets the walls settle further
    scatter = scatter_mm(differences[0], bench.first.sight)
    meshes = min(map(len, differences))
    return PlainFit(bench, point, mesh, on_own_mesh, meshes, slope, scatter, grid, fitted.sizes, weighting)


def _bench(
    problem: IdentificationProblem,
    bones: SurfacePair | None,
    state: int,
    options: NoiseModelOptions,
    walls: WallMotionOptions,
) -> StateModel:
    stage = SharedGeometry.of(problem, QUICK, walls=walls)
    floor = np.repeat([options.bone_floor_mm, options.bone_floor_deg], 3)
    centre = problem.organ.rest.points.mean(axis=0)
    bone = None if bones is None else BoneSight.of(bones, centre, floor, options.bone_far_mm)
    sight = DataVector.of(stage.observation, bone, options)
    return StateModel(stage, sight, Composition(problem, state=state), np.zeros(sight.n))


def _of_the_model(gap: UnknownDiscrepancy, differences: Sequence[FloatArray], options: NoiseModelOptions) -> FloatArray:
    """(n, m) columns of the model's own smooth error: half of its variance the same forces in every state, half each state's own.

    Where no better element could be solved, it is larger by what that would have changed.
    """
    unsolved = float(np.hypot(options.model, options.unsolved_mesh_mm / options.force_typical_mm))
    each = [(options.model if len(d) else unsolved) * f.response for f, d in zip(gap.each, differences, strict=True)]
    return np.sqrt(0.5) * np.hstack([np.vstack(each), apart(each)])


def _free(sight: DataVector, options: NoiseModelOptions) -> list[FloatArray]:
    """What may have moved a state's data besides noise and a gap: an offset of the contour, the bones. (n, k) each."""
    offset = options.free_offset_mm * sight.wider[:, None]
    bones = np.zeros((sight.n, 6))
    if sight.bone is not None:
        bones[-6:] = options.free_bones * np.eye(6)
    return [offset, bones]


def _solved(bench: States, theta: FloatArray, near: JointLinearisation | None) -> JointLinearisation:
    point = bench.solve(PLAIN, theta, NOTHING, near)
    if point is None:
        raise ConvergenceError(
            "the rest anatomy cannot be deformed into what the other scans show; look at the contours of bladder and "
            "rectum, or mesh more finely"
        )
    return point


def _best(
    bench: States, weighting: Weighting, starts: list[FloatArray], near: JointLinearisation
) -> JointLinearisation:
    """Gauss-Newton from every start; the best point of all."""
    best: tuple[float, JointLinearisation] | None = None
    bounds = near.first.scene.parameters.bounds
    for start in starts:
        here = near

        def linearise(theta: FloatArray) -> tuple[FloatArray, FloatArray] | None:
            nonlocal best, here
            point = bench.solve(PLAIN, theta, NOTHING, here)
            if point is None:
                return None
            here = point
            residual = weighting.whiten(point.residual)
            if best is None or residual @ residual < best[0]:
                best = float(residual @ residual), point
            return residual, weighting.whiten(point.in_theta)

        gauss_newton(linearise, start, bounds)
    if best is None:
        raise ConvergenceError("no start of Gauss-Newton could be solved; look at the mesh and at the contours")
    # Lets the walls settle further.
    return _solved(bench, best[1].theta, best[1])
