"""The plain model fitted: an element that is quick looks for the stiffness, a better one says by how much that was wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import ConvergenceError
from palpate.core.gap.better import QUICK, UNKNOWN_MM, better_differences, scatter_mm
from palpate.core.gap.bone_sight import BoneSight
from palpate.core.gap.composition import Composition
from palpate.core.gap.fit import NOTHING, PLAIN, Bench, Point
from palpate.core.gap.forces import TYPICAL_MM, ForceFields
from palpate.core.gap.noise_fit import NoiseGrid, fit_noise
from palpate.core.gap.noise_model import NoiseParts, NoiseSizes
from palpate.core.gap.remeshed import Remeshed, what_is_left
from palpate.core.gap.sight import Sight
from palpate.core.gap.stage import Stage
from palpate.core.identify.gauss_newton import gauss_newton
from palpate.core.identify.reference import middle
from palpate.core.observe.noise import Weighting
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.worker.progress import Progress, part, silent

FloatArray = NDArray[np.float64]

# Precision of ln G's prior: none to speak of.
FLAT = 1e-4
# How far a contour may be offset, mm, and bones may seem to have moved, mm and degrees, while the noise is estimated.
_OFFSET_MM, _BONES = 1.0, 5.0


@dataclass(frozen=True, eq=False)
class PlainFit:
    """The plain model where it fits best.

    point : at the quick element, residuals corrected; its tangent is the one factorised. mesh : (n,) what the better element
    changed, the mean over all `meshes` on which it was solved, 0 for none. scatter_mm : rms along the surface of
    what one mesh differs from that mean, NaN for one mesh. noise : all that it may be; sizes : of this case's. weighting : of the data
    vector.
    """

    bench: Bench
    point: Point
    mesh: FloatArray
    meshes: int
    scatter_mm: float
    noise: NoiseGrid
    sizes: NoiseSizes
    weighting: Weighting

    @cached_property
    def log_evidence(self) -> float:
        """Of the plain model, whatever the noise."""
        J = self.point.in_theta
        return self.noise.log_evidence(self.point.residual, J, np.full(J.shape[1], FLAT))


def fit_plain(
    problem: IdentificationProblem,
    bones: SurfacePair | None,
    remeshed: Sequence[Remeshed] = (),
    progress: Progress = silent,
) -> PlainFit:
    """Raises InputError for a problem that cannot be posed, ConvergenceError when nothing can be solved.

    remeshed : other meshes of the same labels; the better element's prediction is the mean over all of them.
    """
    sizes = NoiseSizes()
    progress(0.0, "plain model: surfaces and distances")
    stage = Stage.of(problem, QUICK)
    composition = Composition(problem)
    centre = problem.organ.rest.points.mean(axis=0)
    bone = None if bones is None else BoneSight.of(bones, centre)
    sight = Sight.of(stage.observation, bone)
    bench = Bench(stage, sight, composition, np.zeros(sight.n))
    progress(0.2, "plain model: stiffness with the quick element")
    bounds = stage.scene(composition).parameters.bounds
    first = _solved(bench, middle(bounds), None)
    noise = NoiseParts.of(first.scene, sight, first.equilibrium.u)
    weighting = Weighting(noise.covariance(sizes, np.zeros((sight.n, 1))))
    point = _best(bench, weighting, [middle(bounds), bounds.mean(axis=1) + 0.2 * np.ptp(bounds, axis=1)], first)
    progress(0.4, "plain model: the better element")
    differences = better_differences(bench, point, remeshed, part(progress, 0.4, 0.8))
    bench.correction = mesh = differences.mean(axis=0) if len(differences) else np.zeros(sight.n)
    progress(0.8, "plain model: noise of this case's contours")
    point = replace(point, residual=point.residual + mesh)
    noise = NoiseParts.of(point.scene, sight, point.equilibrium.u)
    gap = ForceFields.around(point, sight)
    # Where no better element could be solved, the model's own smooth error is larger by what it would have changed.
    model = sizes.model if len(differences) else float(np.hypot(sizes.model, UNKNOWN_MM / TYPICAL_MM))
    left = np.hstack([what_is_left(differences, sizes.mesh), model * gap.response])
    grid = NoiseGrid.of(noise, sizes, left)
    fitted = fit_noise(grid, point.residual, point.in_theta, gap.free, _free(sight))
    weighting = Weighting(fitted.covariance)
    point = _best(bench, weighting, [point.theta], point)
    return PlainFit(bench, point, mesh, len(differences), scatter_mm(differences, sight), grid, fitted.sizes, weighting)


def _free(sight: Sight) -> list[FloatArray]:
    """What may have moved the data besides noise and a gap: an offset of the contour, the bones. (n, k) each."""
    offset = _OFFSET_MM * sight.wider[:, None]
    bones = np.zeros((sight.n, 6))
    if sight.bone is not None:
        bones[-6:] = _BONES * np.eye(6)
    return [offset, bones]


def _solved(bench: Bench, theta: FloatArray, near: Point | None) -> Point:
    point = bench.solve(PLAIN, theta, NOTHING, near)
    if point is None:
        raise ConvergenceError(
            "the rest anatomy cannot be deformed into what the second scan shows; look at the contours of bladder and "
            "rectum, or mesh more finely"
        )
    return point


def _best(bench: Bench, weighting: Weighting, starts: list[FloatArray], near: Point) -> Point:
    """Gauss-Newton from every start; the best point of all."""
    best: tuple[float, Point] | None = None
    bounds = near.scene.parameters.bounds
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
    # The factor left behind must be that of the best point.
    return _solved(bench, best[1].theta, best[1])
